"""Names of the export formats, in a module of their own so that the command line starts fast."""

from enum import StrEnum


class FormatName(StrEnum):
    """A form of an identified model, or of a whole run, by the name that the command uses."""

    YAML = "yaml"
    JSON = "json"
    PYTHON = "python"
    MATLAB = "matlab"
    SDF = "sdf"
    HOLOOCEAN = "holoocean"
    SIMULATOR = "simulator"
    MSS = "mss"
    MCAP = "mcap"

    @property
    def is_of_a_run(self) -> bool:
        """Whether it holds the estimates over time, instead of the model."""
        return self is FormatName.MCAP
