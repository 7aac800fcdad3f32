"""What auvid identifies with, apart from its settings so that a command line can name it at once."""

from enum import StrEnum


class FilterName(StrEnum):
    """A filter, or the output-error method, by the name that commands, settings and files use."""

    EKF = "ekf"
    CKF = "ckf"
    TUKF = "tukf"
    UKF = "ukf"
    OUTPUT_ERROR = "output_error"

    @property
    def in_one_batch(self) -> bool:
        """Say whether it fits all data at once, instead of going from measurement to measurement."""
        return self is FilterName.OUTPUT_ERROR
