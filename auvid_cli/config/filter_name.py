"""What auvid identifies with, apart from its settings so that a command line can name it at once."""

from enum import StrEnum


class FilterName(StrEnum):
    """A filter, the smoother or the output-error method, by the name that commands, settings and files use."""

    EKF = "ekf"
    CKF = "ckf"
    TUKF = "tukf"
    UKF = "ukf"
    SMOOTHER = "smoother"
    OUTPUT_ERROR = "output_error"

    @property
    def in_one_batch(self) -> bool:
        """Say whether it fits all data at once, instead of going from measurement to measurement."""
        return self in (FilterName.SMOOTHER, FilterName.OUTPUT_ERROR)

    @property
    def is_free_run_fit(self) -> bool:
        """Whether it fits the motion left to itself: without process noise and, unless asked, without the prior."""
        return self is FilterName.OUTPUT_ERROR
