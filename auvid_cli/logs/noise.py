"""The noise of a signal, from the signal alone."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Standard deviation of a normal variable per median of its size.
_PER_MEDIAN = 1.4826022185056018


def noise_standard_deviation(values: Array, is_angle: bool = False) -> float:
    """Standard deviation of white noise on a signal that changes slowly from sample to sample.

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
    steps = np.diff(values)
    if is_angle:
        steps -= 2.0 * np.pi * np.rint(steps / (2.0 * np.pi))
    second = np.abs(np.diff(steps))
    second = second[np.isfinite(second)]
    return float(_PER_MEDIAN * np.median(second) / np.sqrt(6.0)) if second.size else float("nan")
