"""Where a sensor is silent for long."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.gaps import gap_limit

Array = NDArray[np.float64]
TimeSpans = Sequence[tuple[float, float]]


class Gaps(NamedTuple):
    """How many gaps there are, how long the longest is (s), and when it begins (s)."""

    number: int
    longest: float
    begin: float


def find_gaps(time: Array, use: TimeSpans, exclude: TimeSpans) -> Gaps | None:
    """Find the times over which a sensor is silent, see `gap_limit`; None if there are none.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, of the samples that are there, increasing.
    use : sequence of tuple of float
        Spans whose insides count; all if it is empty.
    exclude : sequence of tuple of float
        Spans whose samples were left out on purpose: a gap that reaches into one does not count.
    """
    intervals = np.diff(time)
    if not intervals.size:
        return None
    gaps = [
        (float(intervals[k]), float(time[k]))
        for k in np.flatnonzero(intervals > gap_limit(intervals))
        if not any(begin <= time[k + 1] and time[k] <= end for begin, end in exclude)
        and (not use or any(begin <= time[k] and time[k + 1] <= end for begin, end in use))
    ]
    return Gaps(len(gaps), *max(gaps)) if gaps else None
