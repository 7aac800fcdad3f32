"""The two clocks of a message, of who recorded it and of who sent it: how far apart, and whether one drifts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of the median interval, and s: differences that vary by less hardly matter.
_PART_OF_INTERVAL, _LEAST = 0.5, 0.02
_QUANTILES = (0.05, 0.95)
# s; a log that was made so much later than its messages was played back. Smaller times are counted from when something
# was switched on.
_LATER, _LEAST_EPOCH = 60.0, 1e8


class ClockDrift(NamedTuple):
    """How a clock differs from another one of the same messages.

    Attributes
    ----------
    clock, other : str
    unsteady : bool
        Whether it is the less even one, by more than hardly matters.
    later : float
        s, median of the difference; 0 if not both are counted from the same epoch.
    spread, furthest : float
        s, of the difference about its median: from the 5 % to the 95 % quantile, and at most.
    """

    clock: str
    other: str
    unsteady: bool
    later: float
    spread: float
    furthest: float


def find_clock_drift(taken: Array, other: Array, names: tuple[str, str]) -> ClockDrift | None:
    """Compare the clock that is taken with the other one of the same messages.

    Jitter that is not in the messages themselves makes intervals uneven, so the more even clock is the better one. What
    matters less than half of an interval or 20 ms does not count, nor does being late by less than a minute, or early.

    Parameters
    ----------
    taken, other : ndarray, shape (n,)
        s; NaN or zero where a clock was not set.
    names : tuple of str
        Of the two clocks.

    Returns
    -------
    ClockDrift or None
        None if there is nothing to say, or if the other one was hardly ever set.
    """
    known = np.isfinite(taken) & np.isfinite(other) & (taken != 0.0) & (other != 0.0)
    taken, other = taken[known], other[known]
    if 2 * taken.size < known.size or taken.size < 3 or not np.ptp(other) > 0.0:
        return None
    difference = taken - other
    later = float(np.median(difference))
    difference -= later
    is_epoch = min(np.median(taken), np.median(other)) > _LEAST_EPOCH
    furthest = float(np.abs(difference).max())
    interval = float(np.median(np.abs(np.diff(other))))
    unsteady = furthest > min(_PART_OF_INTERVAL * interval, _LEAST) and _unevenness(taken) > _unevenness(other)
    if not unsteady and not (is_epoch and later > _LATER):
        return None
    low, high = np.quantile(difference, _QUANTILES)
    return ClockDrift(*names, unsteady, later if is_epoch else 0.0, float(high - low), furthest)


def _unevenness(time: Array) -> float:
    """Return the mean size, s, of what intervals differ from their median by."""
    intervals = np.diff(time)
    return float(np.abs(intervals - np.median(intervals)).mean())
