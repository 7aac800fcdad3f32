"""What auvid identifies with, apart from its settings so that a command line can name it at once."""

from enum import StrEnum
from typing import assert_never


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
        match self:
            case FilterName.EKF | FilterName.CKF | FilterName.TUKF | FilterName.UKF:
                return False
            case FilterName.SMOOTHER | FilterName.OUTPUT_ERROR:
                return True
            case _:
                assert_never(self)

    @property
    def is_free_run_fit(self) -> bool:
        """Say whether it fits the motion left to itself: without process noise and, unless asked, without the prior."""
        match self:
            case FilterName.OUTPUT_ERROR:
                return True
            case FilterName.EKF | FilterName.CKF | FilterName.TUKF | FilterName.UKF | FilterName.SMOOTHER:
                return False
            case _:
                assert_never(self)


# It weighs all data together, each state with what is measured later as well, and so sees where a filter went wrong.
JUDGE = FilterName.SMOOTHER
