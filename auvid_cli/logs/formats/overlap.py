"""Files that continue each other, and whether their clocks do."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Overlap(NamedTuple):
    """Span in which a file and those before it both have rows.

    Attributes
    ----------
    file : int
        Place of the later file among all, from 1.
    begin, end : float
        s.
    own : bool
        Whether each has measurements of its own there; else one repeats the other.
    """

    file: int
    begin: float
    end: float
    own: bool


def find_overlaps(time: Array, files: Array, values: Array) -> list[Overlap]:
    """Find the files that begin before those before them end.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, NaN where there is none.
    files : ndarray, shape (n,)
        File of each row, counted from 1, never falling.
    values : ndarray, shape (n, c)
    """
    known = np.isfinite(time)
    time, files, values = time[known], files[known], values[known]
    starts = np.flatnonzero(np.diff(files, prepend=files[:1]))
    overlaps = []
    for start, stop in zip(starts, (*starts[1:], time.size), strict=True):
        begin = max(time[:start].min(), time[start:stop].min())
        end = min(time[:start].max(), time[start:stop].max())
        inside = (time >= begin) & (time <= end)
        before, after = np.flatnonzero(inside[:start]), start + np.flatnonzero(inside[start:stop])
        # A row at the end of one file and at the beginning of the next is no span.
        if begin < end and before.size and after.size:
            common, first, second = np.intersect1d(time[before], time[after], return_indices=True)
            repeats = np.array_equal(values[before[first]], values[after[second]], equal_nan=True)
            is_own = not repeats or common.size < min(np.unique(time[before]).size, np.unique(time[after]).size)
            overlaps.append(Overlap(int(files[start]), float(begin), float(end), is_own))
    return overlaps
