"""Noise of a signal, and gaps in a record."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.angles import wrap
from auvid_cli.data.dataset import SensorRecord

Array = NDArray[np.float64]
# Standard deviation of a normal variable per median of its size.
_PER_MEDIAN = 1.4826022185056018
# Of a signal's largest value: differences below that are rounding of the arithmetic.
_ROUNDING = 16.0 * np.finfo(np.float64).eps
# How near to whole steps how many of the differences between neighbouring values are, if there is a step; it is among
# the smallest of them, or in the middle where single values off the grid make smaller ones.
_NEAR, _SHARE, _CANDIDATES = 0.01, 0.8, (0.05, 0.5)
# Correlation of successive third differences from where on a signal was filtered, by how many of them; of their sizes
# what counts as usual, for spikes do not.
_SMOOTH, _FEWEST_PAIRS, _USUAL = -0.68, 400, 0.95
# s, and times the usual interval.
_LONGEST, _INTERVALS = 1.0, 10.0
# s; a sensor with noise does not repeat itself to the last bit, and some quantised ones do for a while.
MAX_REPEAT = 2.0
# Steps by which a rounded measurement changes that hardly does.
_NEIGHBOURS, _BY_NOISE = 1.5, 2.5


class Noise(NamedTuple):
    """Noise of a signal.

    Attributes
    ----------
    standard_deviation : float
        NaN if the signal does not tell.
    step : float
        Of quantisation, if it is this that the standard deviation was taken from; else 0.
    """

    standard_deviation: float
    step: float = 0.0


def estimate_noise(values: Array, is_angle: bool = False) -> Noise:
    """Estimate noise by `noise_standard_deviation`, but no less than that of rounding to steps: step / sqrt(12).

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where one is missing.
    is_angle : bool
        Whether it is in rad and may jump by whole turns.
    """
    deviation, step = noise_standard_deviation(values, is_angle), quantisation_step(values)
    least = step / np.sqrt(12.0)
    if step > 0.0 and deviation < least:
        return Noise(float(least), step)
    rounding = _ROUNDING * float(np.nanmax(np.abs(values), initial=0.0))
    return Noise(deviation if deviation > rounding else float("nan"))


def noise_standard_deviation(values: Array, is_angle: bool = False) -> float:
    """Find the standard deviation of white noise on a signal that changes slowly from sample to sample.

    Second differences leave of such a signal little but the noise, times the root of six; their median size does not
    mind spikes.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where one is missing.
    is_angle : bool
        Whether it is in rad and may jump by whole turns.

    Returns
    -------
    float
        NaN if there are fewer than three samples in a row.
    """
    second = np.abs(_second_differences(values, is_angle))
    second = second[np.isfinite(second)]
    return float(_PER_MEDIAN * np.median(second) / np.sqrt(6.0)) if second.size else float("nan")


def is_smoothed(values: Array, is_angle: bool = False) -> bool:
    """Say whether a signal goes on from sample to sample as only a filter makes it: its scatter is not its noise.

    Successive third differences of white noise correlate by -3/4, those of what was filtered less, or positively; of
    second differences a motion of half a hertz, ten samples a second, is still the larger part.

    Parameters
    ----------
    values, is_angle
        As of `noise_standard_deviation`.
    """
    third = np.diff(_second_differences(values, is_angle))
    size = float(np.nanquantile(np.abs(third), _USUAL)) if np.isfinite(third).any() else 0.0
    pairs = np.clip(np.stack([third[1:], third[:-1]]), -size, size)
    pairs = pairs[:, np.isfinite(pairs).all(axis=0)]
    if pairs.shape[1] < _FEWEST_PAIRS or not size > 0.0:
        return False
    return float(np.mean(pairs[0] * pairs[1]) / np.mean(pairs[0] * pairs[0])) > _SMOOTH


def _second_differences(values: Array, is_angle: bool) -> Array:
    steps = np.diff(values)
    return np.diff(wrap(steps) if is_angle else steps)


def quantisation_step(values: Array) -> float:
    """Find the step of a quantised signal, 0 if it is none: most differences of neighbours are multiples of it."""
    known = np.unique(values[np.isfinite(values)])
    gaps = np.diff(known)
    gaps = gaps[gaps > _ROUNDING * np.abs(known).max(initial=0.0)]
    if not gaps.size:
        return 0.0
    for step in np.quantile(gaps, _CANDIDATES, method="higher"):
        multiples = gaps / step
        if np.mean(np.abs(multiples - np.maximum(np.rint(multiples), 1.0)) < _NEAR) >= _SHARE:
            return float(step)
    return 0.0


def gap_limit(intervals: Array) -> float:
    """Return the longest interval between measurements that is not a gap, s.

    Parameters
    ----------
    intervals : ndarray, shape (n,)
        Those between all measurements, s; at least one.
    """
    return max(_LONGEST, _INTERVALS * float(np.median(intervals)))


def longer_intervals(time: Array, longest: float) -> Array:
    """Return begin and end, s, of the intervals between times that are longer than a limit, shape (n, 2)."""
    long = np.flatnonzero(np.diff(time) > longest)
    return np.stack([time[long], time[long + 1]], axis=1)


def gaps(time: Array) -> Array:
    """Return begin and end, s, of each gap between times of measurement, shape (n, 2); see `gap_limit`."""
    intervals = np.diff(time)
    return longer_intervals(time, gap_limit(intervals) if intervals.size else np.inf)


def repeats(record: SensorRecord) -> Array:
    """Find first and last time, s, of every run of the same measurement, shape (n, 2); one alone is a run, too."""
    time, _, edges = _runs(record)
    return np.stack([time[edges[:-1]], time[edges[1:] - 1]], axis=1)


def stuck_times(record: SensorRecord) -> Array:
    """Return those of the `repeats` that last too long, and not because measurements are rounded."""
    runs = repeats(record)
    long = runs[:, 1] - runs[:, 0] > MAX_REPEAT
    # Whether measurements are rounded takes sorting them all, and hardly ever matters.
    return runs[long & ~rounded_repeats(record)] if long.any() else runs[long]


def rounded_repeats(record: SensorRecord) -> NDArray[np.bool_]:
    """Say of each of the `repeats` whether it is one of a rounded measurement that changed by less than a step.

    It then comes from a neighbouring step and goes on to one. Noise may take it two steps to one side, and what it
    begins or ends the record with has but one: these are no longer than those with neighbours on both.
    """
    time, values, edges = _runs(record)
    steps = rounding_steps(record)
    runs = values[edges[:-1]]
    if not steps.any():
        return np.zeros(len(runs), np.bool_)
    # A component that is missing says nothing.
    jumps = np.abs(np.diff(runs, axis=0))
    near, by_noise = ((np.isnan(jumps) | (jumps <= most * steps)).all(axis=1) for most in (_NEIGHBOURS, _BY_NOISE))
    lasted = time[edges[1:] - 1] - time[edges[:-1]]
    before, after = np.append(False, near), np.append(near, False)
    surely = before & after
    longest = float(lasted.max(initial=0.0, where=surely))
    perhaps = (before | after) & np.append(True, by_noise) & np.append(by_noise, True)
    return surely | (perhaps & (lasted <= longest))


def rounding_steps(record: SensorRecord) -> Array:
    """Return the step in which each component is recorded, shape (c,); 0 where it is in none that shows."""
    levels = (np.unique(column[np.isfinite(column)]) for column in record.values.T)
    # Two levels alone are no grid.
    return np.array([quantisation_step(level) if level.size > 2 else 0.0 for level in levels])


def _runs(record: SensorRecord) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return times and values that are there, and where each run of the same measurement begins and the last ends."""
    present = np.isfinite(record.values).any(axis=1)
    time, values = record.time[present], record.values[present]
    moved = np.flatnonzero(np.any((values[1:] != values[:-1]) & np.isfinite(values[1:]), axis=1)) + 1
    return time, values, np.concatenate([[0], moved, [len(values)]])
