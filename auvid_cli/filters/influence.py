"""How measurements move a batch estimate: the value object that corrections of its standard deviations go through."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import Indices

Array = NDArray[np.float64]

BIN = 0.1
"""s; residuals are averaged, and scores summed, over so long before they are correlated."""


class Influence(NamedTuple):
    """How consecutive scalar measurements move an estimate.

    Attributes
    ----------
    time : ndarray, shape (m,)
        s, in order.
    channel : ndarray of int, shape (m,)
        Which component of which sensor it is.
    residual : ndarray, shape (m,)
        By the standard deviation that it should have.
    rows : ndarray, shape (m, n)
        By how much each parameter moves for each unit of it.
    """

    time: Array
    channel: Indices
    residual: Array
    rows: Array


INFLUENCE = types.NamedTuple(
    (types.float64[::1], types.int64[::1], types.float64[::1], types.float64[:, ::1]), Influence
)


@compiled(types.int64(types.float64, types.float64), inline=True)
def bin_at(time, start):
    """Return in which bin of a segment a time lies; what comes regularly is in its middle, safe from rounding."""
    return int((time - start) / BIN + 0.5)
