"""Many runs: seeds, settings and filters, on one machine or a cluster."""
