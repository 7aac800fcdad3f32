"""Validation of an estimate on other data."""
