"""Checks of a dataset before identification."""
