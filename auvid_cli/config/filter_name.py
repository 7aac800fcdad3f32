"""Names of the estimators, in a module of their own so that the command line starts fast."""

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
        """Whether it fits all data at once, instead of one measurement after another."""
        match self:
            case FilterName.EKF | FilterName.CKF | FilterName.TUKF | FilterName.UKF:
                return False
            case FilterName.SMOOTHER | FilterName.OUTPUT_ERROR:
                return True
            case _:
                assert_never(self)

    @property
    def description(self) -> str:
        """Return a description of one line."""
        match self:
            case FilterName.EKF:
                return "Extended Kalman filter: linearised along the motion; exact or first-order transition."
            case FilterName.CKF:
                return "Cubature Kalman filter: third-degree spherical rule, in square-root form."
            case FilterName.TUKF:
                return "Transformed unscented Kalman filter: cubature points, turned so that none goes far in a state."
            case FilterName.UKF:
                return "Unscented Kalman filter with the scaled transformation."
            case FilterName.SMOOTHER:
                return "Smoother: the most probable coefficients and motion of all data; judges the others."
            case FilterName.OUTPUT_ERROR:
                return (
                    "Output-error method (OE in tables): fit of coefficients and initial motion, without process noise."
                )
            case _:
                assert_never(self)

    @property
    def is_free_run_fit(self) -> bool:
        """Whether it fits the free motion: without process noise and, by default, without the prior."""
        match self:
            case FilterName.OUTPUT_ERROR:
                return True
            case FilterName.EKF | FilterName.CKF | FilterName.TUKF | FilterName.UKF | FilterName.SMOOTHER:
                return False
            case _:
                assert_never(self)


# It weighs all data together, each state with what is measured later as well, and so sees where a filter went wrong.
JUDGE = FilterName.SMOOTHER
