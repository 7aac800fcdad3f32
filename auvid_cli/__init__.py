"""auvid: hydrodynamic coefficients of an underwater vehicle from its own manoeuvre data."""

__version__ = "0.1.0"
