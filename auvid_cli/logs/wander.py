"""The two clocks of a message, of who recorded it and of who sent it: how far one wanders from the other."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of the median interval, and s: differences that vary by less hardly matter.
_PART_OF_INTERVAL, _LEAST = 0.5, 0.02
_QUANTILES = (0.05, 0.95)


class Wander(NamedTuple):
    """How far a clock wanders from one that ticks more evenly, about the median of their difference.

    Attributes
    ----------
    clock, better : str
    spread : float
        s, from the 5 % to the 95 % quantile.
    furthest : float
        s.
    """

    clock: str
    better: str
    spread: float
    furthest: float


def find_wander(taken: Array, other: Array, names: tuple[str, str]) -> Wander | None:
    """Compare the clock that is taken with the other one of the same messages.

    Jitter that is not in the messages themselves makes intervals uneven, so the more even clock is the better one. A
    constant difference, and what matters less than half of an interval or 20 ms, do not count.

    Parameters
    ----------
    taken, other : ndarray, shape (n,)
        s; NaN or zero where a clock was not set.
    names : tuple of str
        Of the two clocks.

    Returns
    -------
    Wander or None
        None if the clock that is taken is the better one or as good, or if the other one was hardly ever set.
    """
    known = np.isfinite(taken) & np.isfinite(other) & (taken != 0.0) & (other != 0.0)
    taken, other = taken[known], other[known]
    if 2 * taken.size < known.size or taken.size < 3 or not np.ptp(other) > 0.0:
        return None
    difference = taken - other
    difference -= np.median(difference)
    furthest = float(np.abs(difference).max())
    interval = float(np.median(np.abs(np.diff(other))))
    if furthest <= min(_PART_OF_INTERVAL * interval, _LEAST) or _unevenness(taken) <= _unevenness(other):
        return None
    low, high = np.quantile(difference, _QUANTILES)
    return Wander(*names, float(high - low), furthest)


def _unevenness(time: Array) -> float:
    """Mean size, s, of what intervals differ from their median by."""
    intervals = np.diff(time)
    return float(np.abs(intervals - np.median(intervals)).mean())
