"""Allan deviation."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Averages over more than this share of the record are of too few pieces.
_LONGEST_SHARE = 0.1
# What a flicker's Allan deviation is of its bias instability, IEEE Std 952-1997, annex C.
_FLICKER = (2.0 * np.log(2.0) / np.pi) ** 0.5


class BiasInstability(NamedTuple):
    """Least Allan deviation of a rate, over the share of it that flicker noise has, and its averaging time, s."""

    value: float
    time: float


def allan_deviation(rate: Array, step: float, points: int = 30) -> tuple[Array, Array]:
    """Return the overlapping Allan deviation, IEEE Std 952-1997, annex C.

    Parameters
    ----------
    rate : ndarray, shape (n,)
        Evenly spaced, without gaps.
    step : float
        s.
    points : int
        About how many averaging times, evenly spaced in their logarithm.

    Returns
    -------
    time, deviation : ndarray
        Averaging times, s, and deviations in the unit of the rate.
    """
    angle = np.append(0.0, np.cumsum(rate)) * step
    longest = max(int(_LONGEST_SHARE * rate.size), 1)
    counts = np.unique(np.geomspace(1, longest, points).astype(np.int64))
    times = step * counts.astype(np.float64)
    squares = [np.mean((angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]) ** 2) for m in counts]
    return times, np.sqrt(np.array(squares) / 2.0) / times


def bias_instability(rate: Array, step: float) -> BiasInstability | None:
    """Find where the Allan deviation is least, None if it still falls at the longest averaging time."""
    if rate.size < 100:
        return None
    times, deviation = allan_deviation(rate, step)
    least = int(deviation.argmin())
    if least == times.size - 1:
        return None
    return BiasInstability(float(deviation[least]) / _FLICKER, float(times[least]))
