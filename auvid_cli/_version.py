"""The version of auvid."""

__version__ = "0.2.0"
