"""An identified model in the forms that other programs read."""
