"""Logs of vehicles as they come: what is in them, and the numbers."""
