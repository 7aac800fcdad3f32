"""A first map from what logs are seen to hold."""
