"""The noise of a signal, from the signal alone."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.angles import wrap

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
