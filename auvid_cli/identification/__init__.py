"""Dataset -> Estimate: augmented state, priors, event timeline."""
