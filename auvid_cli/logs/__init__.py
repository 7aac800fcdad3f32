"""Read logs of vehicles, and convert them to a dataset."""
