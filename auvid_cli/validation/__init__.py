"""An estimate on data that it has not seen."""
