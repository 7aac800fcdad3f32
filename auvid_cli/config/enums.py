"""Names of filters, export formats and figure formats, apart from what implements them: the command line needs only
these.
"""

from enum import StrEnum
from typing import TypeVar, assert_never

from auvid_cli.errors import ConfigError

Member = TypeVar("Member", bound=StrEnum)


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


class FigureFormat(StrEnum):
    """A form of a figure's file, by the name that commands use, which is also how the file's name ends."""

    PNG = "png"
    SVG = "svg"
    PDF = "pdf"


def named(kind: type[Member], name: str, noun: str) -> Member:
    """Return the member of a name, such as ``"tukf"``; a member itself is its own name.

    Parameters
    ----------
    kind : enumeration of text
    name : str
    noun : str
        Noun for such a member in the message.

    Raises
    ------
    ConfigError
        If there is none of that name.
    """
    try:
        return kind(name)
    except ValueError:
        raise ConfigError(f"{name!r} is no {noun}; auvid knows {', '.join(kind)}") from None
