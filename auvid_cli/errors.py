"""Errors that the user can fix: each is reported in one clear line, with exit code 2."""


class AuvidError(Exception):
    """Base of all errors that auvid reports without a traceback."""


class ConfigError(AuvidError):
    """Mistakes in a settings file or an override, one paragraph each."""


class FileError(AuvidError):
    """A file is missing, damaged, of another program or schema, or cannot be written."""


class SimulationError(AuvidError):
    """The simulated vehicle left the range of the model: capsized, pitch near 90 degrees, or unstable."""


class DataError(AuvidError):
    """A dataset is not sufficient for the request: no usable sensor, inputs that end too early, ..."""


class InvalidDataError(DataError, ValueError):
    """A dataset, an estimate or a part of one has values of a wrong type, a wrong shape, or an impossible size."""


class ClusterError(AuvidError):
    """The workers of a campaign cannot be reached."""
