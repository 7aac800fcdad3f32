"""Suggest a map from the contents of logs."""
