"""Numbers that figures and pages draw: convergence, paths, residuals of free runs, series and scales."""

from collections.abc import Iterable, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.angles import wrap
from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import EstimateHistory
from auvid_cli.evaluation.predicted_motion import FreeRun
from auvid_cli.report.table import unit_text
from auvid_cli.vehicle.kinematics import dead_reckoned
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, Quantity, state_of

_DEGREES = float(np.rad2deg(1.0))
Array = NDArray[np.float64]
# Of the usual interval, and s.
_JUMP, _LEAST_JUMP = 20.0, 1.0
# Per cent of a run's estimates that an axis shows for certain; brief excursions beyond them are cut off.
SHOWN_PERCENT = 98.0


class Scale(NamedTuple):
    """A unit, and how many of it an SI unit is."""

    unit: str
    factor: float


_READABLE = {"rad": Scale("°", _DEGREES), "rad/s": Scale("°/s", _DEGREES), "T": Scale("µT", 1e6)}


def scale_of(quantity: Quantity) -> Scale:
    """Return the unit in which a quantity is shown: angles and rates in degrees."""
    return _READABLE.get(quantity.unit, Scale(unit_text(quantity.unit), 1.0))


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


def free_run_residual(quantity: Quantity, time: Array, measured: Array, run: FreeRun) -> Array | None:
    """Return measurements minus a free run, SI; None where that has no such motion.

    Parameters
    ----------
    quantity : Quantity
        Component of a sensor.
    time, measured : ndarray, shape (n,)
    run : FreeRun

    Returns
    -------
    ndarray, shape (n,), or None
        NaN outside of the run and where it is not finite; angles between -pi and pi.
    """
    state = state_of(quantity)
    if state not in MOTION_AND_DEPTH_SYMBOLS or run.time.size < 2:
        return None
    column = MOTION_AND_DEPTH_SYMBOLS.index(state)
    if column >= run.motion.shape[1]:
        return None
    left = measured - interpolated(time, run, column)
    return wrap(left) if quantity.unit == "rad" else left


def interpolated(time: Array, run: FreeRun, column: int) -> Array:
    """Return a motion state of a free run at other times, s; NaN outside of it and where it is not finite."""
    finite = np.isfinite(run.motion[:, column])
    values = np.where(finite, run.motion[:, column], 0.0)
    if MOTION_AND_DEPTH_SYMBOLS[column] in ("phi", "theta", "psi"):
        values = np.unwrap(values)
    result = np.interp(time, run.time, values, left=np.nan, right=np.nan)
    # Between two samples one of which is not finite nothing is known.
    return np.where(np.interp(time, run.time, finite.astype(np.float64)) == 1.0, result, np.nan)


class TravelledPath(NamedTuple):
    """A path.

    Attributes
    ----------
    filter : str or None
        None of the true one.
    time : ndarray, shape (n,)
        s.
    position : ndarray, shape (n, 3)
        North, east, down, m.
    """

    filter: str | None
    time: Array
    position: Array


def travelled_paths(truth: TruthRecord | None, motions: Iterable[EstimateHistory]) -> list[TravelledPath]:
    """Return the true path, as far as it is finite, and dead reckoning from its start, or from zero.

    Parameters
    ----------
    truth : TruthRecord or None
    motions : iterable of Course
        Of the nine motion states; one that is not finite from the second time on has no path.
    """
    paths, start = list[TravelledPath](), np.zeros(3)
    if truth is not None:
        known = np.isfinite(truth.position).all(axis=1)
        if known.any():
            paths.append(TravelledPath(None, truth.time[known], truth.position[known]))
            start = paths[0].position[0]
    for motion in motions:
        position = start + dead_reckoned(motion.time, motion.mean)
        if len(position) > 1:
            paths.append(TravelledPath(motion.filter, motion.time[: len(position)], position))
    return paths


def travelled(position: Array) -> Array:
    """Return the horizontal distance along a path, m, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(position[:, :2], axis=0).T))])
