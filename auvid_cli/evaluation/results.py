"""Results of evaluations that do not need the compiled code: identifiability and free runs."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.checks import NamedRows, frames
from auvid_cli.data.interop import LabelledSeries, import_xarray
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

# Largest bound of each class, in percent of the value, and name of the class.
CLASSES = ((1.0, "within 1 %"), (5.0, "within 5 %"), (20.0, "within 20 %"), (np.inf, "not identified"))


class CoefficientBound(NamedTuple):
    """A row of ``identifiability.csv``.

    Attributes
    ----------
    value : float
        Value at which the bound holds, SI.
    cramer_rao_bound : float
        Smallest standard deviation of any unbiased estimate, SI; infinite if the data do not determine it.
    percent : float
        Bound in percent of the value or, if that is zero, of the natural magnitude of a body of this size.
    percent_with_noise : float
        The same with process noise; NaN if unknown.
    label : str
        Name of the class in `CLASSES`, by the larger of the two percentages; the column ``verdict``.
    best_sensor : str
        Sensor with the largest share of the information.
    best_share : float
        Its share of the information, 0 to 1.
    group : str
        Coefficients that are confounded with it.
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
        Linear combination that is determined best, for example ``Y_uvl + 0.9 Y_uudr``.
    percent : float
        Bound of the combination in percent of its value.
    worst_percent : float
        Largest bound of a single member, in percent of its value.
    """

    members: tuple[str, ...]
    combination: str
    percent: float
    worst_percent: float


class SensorErrorBound(NamedTuple):
    """Least standard deviation of a sensor's own error.

    Attributes
    ----------
    bound : float
        From the data alone, SI.
    prior : float
        Standard deviation before any data, SI.
    observed : bool
        Whether data and prior together leave less than half of the prior standard deviation.
    """

    bound: float
    prior: float
    observed: bool


class FixSuggestion(NamedTuple):
    """Coefficients to fix and coefficients to estimate, for data that do not determine all.

    Attributes
    ----------
    held : tuple of str
        Coefficients to fix; with these at known values, the others are known to 20 %.
    kept : tuple of str
        Coefficients to estimate.
    worst_percent : float
        Largest bound of a kept coefficient, in percent of its value.
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
        Share of each sensor in the information, by sensor; the shares add up to 1.
    correlation : ndarray, shape (coefficients, coefficients)
        Correlation of the errors at the bound; NaN if undefined.
    growth : list of (float, ndarray)
        Duration, s, and bounds in percent after it.
    sensor_errors : dict of SensorErrorBound
        By symbol.
    remark : str
        Missing data and assumptions.
    holding : FixSuggestion or None
        None if all coefficients are known, or if fixing some does not help.
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
        Motion, and the depth if it is predicted, SI; not finite after the model diverged.
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
