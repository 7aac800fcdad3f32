"""Dataset and Estimate: the two value objects and their HDF5 files."""
