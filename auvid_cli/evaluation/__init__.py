"""Estimate (and truth, where there is one) -> errors, consistency, free run."""
