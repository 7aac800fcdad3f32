"""The value object of a free run, apart from the compiled code that makes one."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.interop import LabelledSeries
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Array = NDArray[np.float64]


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
        """Return what its columns are."""
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
