"""Results of evaluations that do not need the compiled code: identifiability and free runs."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import NamedRows, frames
from auvid_cli.data.interop import LabelledSeries, import_xarray
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Array = NDArray[np.float64]

# Bounds in percent of the value, and what a coefficient with such a bound is called.
CLASSES = ((1.0, "within 1 %"), (5.0, "within 5 %"), (20.0, "within 20 %"), (np.inf, "not identified"))


class CoefficientBound(NamedTuple):
    """A row of ``identifiability.csv``.

    Attributes
    ----------
    value : float
        At which the bound holds, SI.
    cramer_rao_bound : float
        Smallest standard deviation of any unbiased estimate, SI; infinite where the data say nothing.
    percent : float
        In percent of the value or, if that is zero, of the natural magnitude of a body of this size.
    percent_with_noise : float
        The same where process noise moves the vehicle, too; NaN where that is not known.
    label : str
        One of `CLASSES`, by the larger of these two; the column ``verdict``.
    best_sensor : str
        Sensor with the largest share of the information.
    best_share : float
        Its share of the information, 0 to 1.
    group : str
        Coefficients that it cannot be separated from.
    """

    coefficient: str
    unit: str
    value: float
    cramer_rao_bound: float
    percent: float
    percent_with_noise: float
    label: str
    best_sensor: str
    best_share: float
    group: str


class Collinear(NamedTuple):
    """Coefficients that the data cannot separate.

    Attributes
    ----------
    combination : str
        The best determined one, for example ``Y_uvl + 0.9 Y_uudr``.
    percent : float
        Its bound in percent of its own value.
    worst_percent : float
        Largest bound of a member alone.
    """

    members: tuple[str, ...]
    combination: str
    percent: float
    worst_percent: float


class SensorErrorBound(NamedTuple):
    """Least standard deviation of a sensor's own error.

    Attributes
    ----------
    bound, prior : float
        Standard deviation from the data alone, and before any data, SI.
    observed : bool
        Whether both together leave less than half of the prior's.
    """

    bound: float
    prior: float
    observed: bool


class FixSuggestion(NamedTuple):
    """Coefficients to estimate from data that do not determine all.

    Attributes
    ----------
    held : tuple of str
        Coefficients to fix; with these at known values, the others are known to 20 %.
    worst_percent : float
        Largest bound of one that is kept, in percent of its value.
    motions : tuple of str
        Motions with kept coefficients: "surge", "sway" and so on.
    unstated : tuple of str
        Coefficients to fix that have no value in the vehicle file.
    """

    held: tuple[str, ...]
    kept: tuple[str, ...]
    worst_percent: float
    motions: tuple[str, ...]
    unstated: tuple[str, ...]


class Identifiability(NamedTuple):
    """Bounds of coefficients and sensor errors.

    Attributes
    ----------
    shares : dict of ndarray, shape (coefficients,)
        Share of the information of each sensor, by sensor; the shares add up to one.
    correlation : ndarray, shape (coefficients, coefficients)
        Correlation of the errors at the bound; NaN where there is none.
    growth : list of (float, ndarray)
        Duration, s, and bounds in percent after it.
    sensor_errors : dict of SensorErrorBound
        By symbol.
    remark : str
        Missing data and assumptions.
    holding : Holding or None
        Where some coefficients are better held; None if all are known, or none would be.
    """

    bounds: list[CoefficientBound]
    groups: list[Collinear]
    shares: dict[str, Array]
    correlation: Array
    growth: list[tuple[float, Array]]
    sensor_errors: dict[str, SensorErrorBound]
    remark: str = ""
    holding: FixSuggestion | None = None

    def tables(self) -> dict[str, NamedRows]:
        """Return the rows of each CSV file, by its name."""
        columns = tuple("verdict" if name == "label" else name for name in CoefficientBound._fields)
        groups = [group._replace(members=" ".join(group.members)) for group in self.groups]
        return {
            "identifiability": NamedRows(columns, self.bounds),
            "collinear": NamedRows(Collinear._fields, groups),
        }

    def to_pandas(self) -> "dict[str, pd.DataFrame]":
        """Return tables with the names and columns of the CSV files: ``identifiability`` and ``collinear``."""
        return frames(self.tables())

    def to_xarray(self) -> "xr.Dataset":
        """Return ``correlation``, ``share`` of each sensor, and ``bound`` in percent after each duration, s.

        Raises
        ------
        DataError
            If xarray is not installed.
        """
        names = [bound.coefficient for bound in self.bounds]
        return import_xarray().Dataset(
            {
                "correlation": (("coefficient", "other"), self.correlation),
                "share": (("sensor", "coefficient"), np.array(list(self.shares.values()))),
                "bound": (("duration", "coefficient"), np.array([bound for _, bound in self.growth]), {"units": "%"}),
            },
            {
                "coefficient": names,
                "other": names,
                "sensor": list(self.shares),
                "duration": ("duration", [duration for duration, _ in self.growth], {"units": "s"}),
            },
        )


class FreeRun(NamedTuple):
    """Motion predicted from the inputs alone.

    Attributes
    ----------
    time : ndarray, shape (n,)
    motion : ndarray, shape (n, 9) or (n, 10)
        Not finite from where the model blew up, if it did; the depth behind it where that is predicted.
    """

    time: Array
    motion: Array

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return the quantities of the columns."""
        return MOTION_AND_DEPTH[: self.motion.shape[1]]

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a column for each motion state, indexed by time, s."""
        return LabelledSeries(self.time, self.quantities, self.motion).to_pandas()

    def to_xarray(self) -> "xr.Dataset":
        """Return a variable over time for each motion state.

        Raises
        ------
        DataError
            If xarray is not installed.
        """
        return LabelledSeries(self.time, self.quantities, self.motion).to_xarray()
