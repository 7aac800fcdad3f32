"""The version of auvid."""

__version__ = "0.1.0"
