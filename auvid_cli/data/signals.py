"""Signal processing: noise, quantisation, gaps, repeated measurements and rates of change."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array, release_memory, wrap
from auvid_cli.data.dataset import SensorRecord

# Standard deviation of a normal variable divided by the median of its absolute value.
_PER_MEDIAN = 1.4826022185056018
# Smaller differences are rounding errors, as a share of the largest value.
_ROUNDING = 16.0 * np.finfo(np.float64).eps
# A quantisation step is a small quantile of the differences between values, or the median if single values are off the
# grid.
_STEP_QUANTILES = (0.05, 0.5)
_MAX_STEP_ERROR = 0.01  # steps; largest error of a difference that counts as a multiple of the step
_MIN_STEP_SHARE = 0.8  # smallest share of differences that are multiples of the step
# A signal is filtered if successive third differences have a larger correlation than this.
_MAX_WHITE_CORRELATION = -0.68
_MIN_PAIRS = 400
_CLIPPING_QUANTILE = 0.95  # quantile at which third differences are clipped, because of spikes
_MIN_GAP = 1.0  # s
_MIN_GAP_INTERVALS = 10.0  # median intervals
# A sensor with noise hardly ever repeats a measurement, a quantised one may for a while.
MAX_REPEAT = 2.0  # s
_NEIGHBOUR_STEPS = 1.5  # quantisation steps; largest jump to a neighbouring level
_NOISE_STEPS = 2.5  # quantisation steps; largest jump to a neighbouring level with noise
TURN_RATE_WINDOW = 1.0  # s; window of the change of attitude that gives a turn rate


class Noise(NamedTuple):
    """Noise of a signal."""

    standard_deviation: float  # NaN if unknown
    step: float = 0.0  # quantisation step, if the standard deviation follows from it; otherwise 0


def estimate_noise(values: Array, is_angle: bool = False) -> Noise:
    """Return the noise of a signal: `noise_standard_deviation`, or step / sqrt(12) of its quantisation if larger."""
    deviation, step = noise_standard_deviation(values, is_angle), quantisation_step(values)
    least = step / np.sqrt(12.0)
    if step > 0.0 and deviation < least:
        return Noise(float(least), step)
    rounding = _ROUNDING * float(np.nanmax(np.abs(values), initial=0.0))
    return Noise(deviation if deviation > rounding else float("nan"))


def noise_standard_deviation(values: Array, is_angle: bool = False) -> float:
    """Return the standard deviation of white noise on a slowly changing signal.

    Second differences of such a signal are mainly noise, times the root of six. Their median is robust to spikes.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where missing.
    is_angle : bool
        Whether values are in rad and may jump by whole turns.

    Returns
    -------
    float
        NaN if there are fewer than three consecutive samples.
    """
    second = np.abs(_second_differences(values, is_angle))
    second = second[np.isfinite(second)]
    return float(_PER_MEDIAN * np.median(second) / np.sqrt(6.0)) if second.size else float("nan")


def is_smoothed(values: Array, is_angle: bool = False) -> bool:
    """Whether a signal was low-pass filtered, so that its scatter is less than its noise.

    Successive third differences of white noise have a correlation of -3/4, those of a filtered signal a larger one.
    Second differences would contain too much of the motion: half a hertz at ten samples a second. For the arguments
    see `noise_standard_deviation`.
    """
    third = np.diff(_second_differences(values, is_angle))
    size = float(np.nanquantile(np.abs(third), _CLIPPING_QUANTILE)) if np.isfinite(third).any() else 0.0
    pairs = np.clip(np.stack([third[1:], third[:-1]]), -size, size)
    pairs = pairs[:, np.isfinite(pairs).all(axis=0)]
    if pairs.shape[1] < _MIN_PAIRS or not size > 0.0:
        return False
    return float(np.mean(pairs[0] * pairs[1]) / np.mean(pairs[0] * pairs[0])) > _MAX_WHITE_CORRELATION


def _second_differences(values: Array, is_angle: bool) -> Array:
    steps = np.diff(values)
    return np.diff(wrap(steps) if is_angle else steps)


def quantisation_step(values: Array) -> float:
    """Return the step of which most differences of neighbouring values are multiples; 0 if there is none."""
    return step_between(np.unique(values[np.isfinite(values)]))


def step_between(levels: Array) -> float:
    """Return the `quantisation_step` of values that are finite, distinct and sorted."""
    differences = np.diff(levels)
    differences = differences[differences > _ROUNDING * np.abs(levels).max(initial=0.0)]
    if not differences.size:
        return 0.0
    for step in np.quantile(differences, _STEP_QUANTILES, method="higher"):
        multiples = differences / step
        if np.mean(np.abs(multiples - np.maximum(np.rint(multiples), 1.0)) < _MAX_STEP_ERROR) >= _MIN_STEP_SHARE:
            return float(step)
    return 0.0


def gap_limit(intervals: Array) -> float:
    """Return the longest of the intervals between measurements, s, that is not a gap."""
    return max(_MIN_GAP, _MIN_GAP_INTERVALS * float(np.median(intervals)))


def longer_intervals(time: Array, limit: float) -> Array:
    """Return begin and end, s, of the intervals between times that are longer than a limit, shape (n, 2)."""
    long = np.flatnonzero(np.diff(time) > limit)
    return np.stack([time[long], time[long + 1]], axis=1)


def gaps(time: Array) -> Array:
    """Return begin and end, s, of each gap between times of measurement, shape (n, 2); see `gap_limit`."""
    intervals = np.diff(time)
    return longer_intervals(time, gap_limit(intervals) if intervals.size else np.inf)


def repeats(record: SensorRecord) -> Array:
    """Return first and last time, s, of every run of equal measurements, shape (n, 2); one measurement is a run."""
    present, edges = _runs(record)
    time, runs = record.time[present], np.empty((edges.size - 1, 2))
    runs[:, 0] = time[edges[:-1]]
    runs[:, 1] = time[edges[1:] - 1]
    return runs


def stuck_times(record: SensorRecord) -> Array:
    """Return the `repeats` that are longer than `MAX_REPEAT` and not due to quantisation."""
    runs = repeats(record)
    return runs[(runs[:, 1] - runs[:, 0] > MAX_REPEAT) & ~rounded_repeats(record, runs)]


def rounded_repeats(record: SensorRecord, repeated: Array) -> NDArray[np.bool_]:
    """Whether each of the `repeats` of a record is due to quantisation of a slowly changing value.

    The values before and after such a run differ from it by one step. A run at an end of the record, or with a
    second step due to noise on one side, counts only if it is not longer than these. All are False if no run is longer
    than `MAX_REPEAT`.
    """
    duration = repeated[:, 1] - repeated[:, 0]
    # Quantisation takes time and memory to find, and is rarely needed.
    if not (duration > MAX_REPEAT).any() or not (steps := rounding_steps(record)).any():
        return np.zeros(len(repeated), np.bool_)
    present, edges = _runs(record)
    runs = record.values[present][edges[:-1]]
    # Missing components are ignored.
    jumps = np.abs(np.diff(runs, axis=0))
    neighbours, noisy = (
        (np.isnan(jumps) | (jumps <= limit * steps)).all(axis=1) for limit in (_NEIGHBOUR_STEPS, _NOISE_STEPS)
    )
    before, after = np.append(False, neighbours), np.append(neighbours, False)
    certain = before & after
    longest = float(duration.max(initial=0.0, where=certain))
    possible = (before | after) & np.append(True, noisy) & np.append(noisy, True)
    return certain | (possible & (duration <= longest))


def rounding_steps(record: SensorRecord) -> Array:
    """Return the quantisation step of each component, shape (c,); 0 where there is none."""
    levels = (np.unique(column[np.isfinite(column)]) for column in record.values.T)
    # Two levels are not yet a grid.
    return np.array([step_between(level) if level.size > 2 else 0.0 for level in levels])


def _runs(record: SensorRecord) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return the mask of the rows with a measurement, and the edges of runs of equal measurements.

    Edges are the index of the first measurement of each run, and the number of measurements.
    """
    present = np.asarray(np.isfinite(record.values).any(axis=1))
    n = np.count_nonzero(present)
    # Without measurements there is no run.
    is_edge = np.zeros(n + 1, np.bool_)
    is_edge[[0, n]] = True
    # One component at a time, because ten hours are too long to copy.
    for column in record.values.T:
        values = column[present]
        is_edge[1:n] |= (values[1:] != values[:-1]) & np.isfinite(values[1:])
    release_memory()
    return present, np.flatnonzero(is_edge).astype(np.int64, copy=False)


def rate_of_change(values: Array, interval: float, half: int) -> Array:
    """Return the slope at each of evenly spaced samples, per second, of a cubic (Savitzky and Golay 1964).

    Parameters
    ----------
    values : ndarray, shape (n,)
    interval : float
        s, between samples.
    half : int
        Number of samples on either side in the fit of the cubic; the slope is NaN without them.
    """
    rate = np.full(values.size, np.nan)
    if values.size > 2 * half:
        rate[half : values.size - half] = np.convolve(values, _slope_weights(interval, half), "valid")
    return rate


def response_to_rates(rates: Array, interval: float, half: int) -> Array:
    """Return `rate_of_change` of an angle with these rates, which are linear between samples."""
    smoothed = np.full(rates.size, np.nan)
    if rates.size > 2 * half:
        # The change of the angle between two samples counts in all later ones.
        later = interval * np.cumsum(_slope_weights(interval, half))[:-1]
        smoothed[half : rates.size - half] = np.convolve(rates, np.convolve(later, [0.5, 0.5]), "valid")
    return smoothed


def rate_noise(interval: float, half: int, averaged: int = 1) -> float:
    """Return the standard deviation of a mean of `averaged` slopes, divided by that of white samples, 1/s."""
    return float(np.linalg.norm(np.convolve(_slope_weights(interval, half), np.full(averaged, 1.0 / averaged))))


@cache
def _slope_weights(interval: float, half: int) -> Array:
    """Return the weights of a Savitzky-Golay filter: slope of the cubic polynomial that fits the samples best.

    Those of scipy.signal are the same, but that package takes half a second to load.
    """
    # In the order of a convolution.
    offsets = np.arange(half, -half - 1, -1.0) / half
    weights = np.linalg.pinv(np.vander(offsets, 4))[2] / (half * interval)
    weights.setflags(write=False)
    return weights
