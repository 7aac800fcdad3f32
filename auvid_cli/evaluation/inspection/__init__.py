"""Verdicts on recorded data before anybody identifies from them."""
