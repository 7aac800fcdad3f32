"""Series as short as a screen can show, with their extremes."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of the usual interval, and s: a line does not bridge more.
_JUMP, _LEAST_JUMP = 20.0, 1.0


def envelope(time: Array, values: Array, spans: int) -> tuple[Array, Array]:
    """Keep of each column the least and the greatest value in each of equal parts, in the order in which they come.

    Parameters
    ----------
    time : ndarray, shape (n,)
    values : ndarray, shape (n, c)
        What is not finite is a gap; a gap that fills a part remains one, and so does a jump of time.
    spans : int
        How many parts, each of the same number of samples.

    Returns
    -------
    time : ndarray, shape (m,)
        Those of the samples if they are few; else beginning and middle of each part.
    values : ndarray, shape (m, c)
    """
    time, values = _with_gaps(time, np.where(np.isfinite(values), values, np.nan))
    n, columns = values.shape
    if n <= 2 * spans:
        return time, values
    length = -(-n // spans)
    parts = -(-n // length)
    padded = np.full((parts * length, columns), np.nan)
    padded[:n] = values
    block = padded.reshape(parts, length, columns)
    gap = np.isnan(block)
    least = np.where(gap, np.inf, block).argmin(axis=1)
    greatest = np.where(gap, -np.inf, block).argmax(axis=1)
    order = np.stack([np.minimum(least, greatest), np.maximum(least, greatest)], axis=1)
    kept = np.take_along_axis(block, order, axis=1).reshape(2 * parts, columns)
    begin = np.arange(parts) * length
    middle = np.minimum(begin + length // 2, n - 1)
    return time[np.stack([begin, middle], axis=1).ravel()], kept


def _with_gaps(time: Array, values: Array) -> tuple[Array, Array]:
    """Put a gap wherever time jumps on."""
    steps = np.diff(time)
    if not steps.size:
        return time, values
    jumps = np.flatnonzero(steps > max(_JUMP * float(np.median(steps)), _LEAST_JUMP)) + 1
    return np.insert(time, jumps, time[jumps]), np.insert(values, jumps, np.nan, axis=0)
