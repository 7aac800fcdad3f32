"""Convergence of a coefficient over time: its estimates, and their distance from the true or the final value."""

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Per cent of a run's estimates that an axis shows for certain; brief excursions beyond them are cut off.
SHOWN_PERCENT = 98.0


class Convergence(NamedTuple):
    """Distance of an estimate from its origin over time.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, the beginning of each of equal parts.
    percent : ndarray, shape (n,)
        Greatest distance in each part, in percent of the origin; NaN where there is none, or where it is zero.
    last : float
        The last distance that is neither, %; NaN if there is none.
    """

    time: Array
    percent: Array
    last: float


def origin_of(true: float | None, final: float) -> float | None:
    """Return what distances are percents of: the truth, or where that is not known, or zero, the final value.

    None where that is zero as well, or not finite.
    """
    origin = true or final
    return origin if isfinite(origin) and origin != 0.0 else None


def convergence_of(time: Array, mean: Array, origin: float, spans: int) -> Convergence:
    """Return how far an estimate is from its origin over time.

    Parameters
    ----------
    time, mean : ndarray, shape (n,)
    origin : float
        Not zero.
    spans : int
        How many parts at most.
    """
    percent = 100.0 * np.abs(mean / origin - 1.0)
    # A batch estimate is constant, and where it ends it is always.
    percent[~np.isfinite(percent) | (percent == 0.0)] = np.nan
    known = percent[~np.isnan(percent)]
    begin = np.arange(0, percent.size, -(-percent.size // spans))
    return Convergence(time[begin], np.fmax.reduceat(percent, begin), float(known[-1]) if known.size else float("nan"))


def shown_range(means: Sequence[Array], true: float | None) -> tuple[float, float] | None:
    """Return the range of a linear axis from which the convergence of estimates can be read.

    Parameters
    ----------
    means : sequence of ndarray, shape (n,)
        Estimates of one coefficient over time, by each filter.
    true : float or None

    Returns
    -------
    (float, float) or None
        Holds the true value, the start, the end, and `SHOWN_PERCENT` of each filter's estimates; None without any
        finite value.
    """
    cut = 0.5 * (100.0 - SHOWN_PERCENT)
    finite = [mean[np.isfinite(mean)] for mean in means]
    values = [np.append(np.percentile(mean, [cut, 100.0 - cut]), mean[[0, -1]]) for mean in finite if mean.size]
    if not values:
        return None
    shown = np.concatenate([*values, [] if true is None else [true]])
    return float(shown.min()), float(shown.max())
