"""The one family of errors that are the user's to mend: one clear line each, exit code 2."""


class AuvidError(Exception):
    """Base of every error that auvid reports in plain words instead of a traceback."""


class ConfigError(AuvidError):
    """A settings file or an override is wrong; the message holds one paragraph per mistake."""


class FileError(AuvidError):
    """A data file is missing, truncated, foreign, of another schema, or cannot be written."""


class SimulationError(AuvidError):
    """The simulated vehicle left the model's validity: capsize, pitch near 90 degrees, blow-up."""


class DataError(AuvidError):
    """A dataset cannot serve the request: no usable sensor, inputs that end too early, ..."""


class ClusterError(AuvidError):
    """The workers of a campaign cannot be reached, or no longer."""
