"""What auvid exports to, apart from the writers so that a command line can name it at once."""

from enum import StrEnum


class FormatName(StrEnum):
    """A form of an identified model, by the name that the command uses."""

    YAML = "yaml"
    JSON = "json"
    PYTHON = "python"
    MATLAB = "matlab"
    SDF = "sdf"
