"""Search for the model of a dataset: from loose settings to one that holds, one addition after another."""
