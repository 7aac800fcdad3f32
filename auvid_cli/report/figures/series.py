"""Long series made short enough to draw."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of the usual interval, and s.
_JUMP, _LEAST_JUMP = 20.0, 1.0


def finite(values: Array) -> Array:
    """Put NaN for what is infinite, which breaks a line instead of shooting off."""
    return np.where(np.isfinite(values), values, np.nan)


def thin(time: Array, values: Array, points: int = 2000) -> tuple[Array, Array]:
    """Keep the least and the greatest value of each bucket, so that noise keeps its width.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
        Values that are not finite are gaps; a gap that fills a bucket remains one.
    points : int
        About how many to keep.

    Returns
    -------
    time, values : ndarray
        A subset in order, or all of them if they are few.
    """
    time, values = _broken(time, finite(values))
    n = values.size
    if n <= points:
        return time, values
    length = -(-n // (points // 2))
    buckets = -(-n // length)
    padded = np.full(buckets * length, np.nan)
    padded[:n] = values
    block = padded.reshape(buckets, length)
    gap = np.isnan(block)
    begin = np.arange(buckets) * length
    least = begin + np.where(gap, np.inf, block).argmin(axis=1)
    greatest = begin + np.where(gap, -np.inf, block).argmax(axis=1)
    kept = np.unique(np.concatenate([[0], least, greatest, [n - 1]]))
    return time[kept], values[kept]


def _broken(time: Array, values: Array) -> tuple[Array, Array]:
    """Put a gap wherever time jumps on."""
    steps = np.diff(time)
    if not steps.size:
        return time, values
    jumps = np.flatnonzero(steps > max(_JUMP * float(np.median(steps)), _LEAST_JUMP)) + 1
    return np.insert(time, jumps, time[jumps]), np.insert(values, jumps, np.nan)


def spaced(n: int, points: int) -> NDArray[np.int64]:
    """Return indices of at most `points` samples evenly spaced, with the first and the last; for smooth series."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, points)).astype(np.int64))


def log_spaced(time: Array, first: float, points: int) -> NDArray[np.int64]:
    """Return indices of at most `points` samples evenly spaced in the logarithm of time from `first`, s, to the end."""
    last = float(time[-1])
    wanted = np.geomspace(min(first, last), last, points) if last > 0.0 else np.zeros(1)
    return np.unique(np.clip(np.searchsorted(time, wanted), 0, time.size - 1))


def unwrapped(angle: Array) -> Array:
    """Take the jumps of a turn out of an angle, rad; gaps stay gaps."""
    result = finite(angle)
    is_known = ~np.isnan(result)
    result[is_known] = np.unwrap(result[is_known])
    return result
