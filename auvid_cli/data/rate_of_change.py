"""How fast a signal of evenly spaced samples changes, by cubics through a second of it (Savitzky and Golay 1964)."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_coeffs

Array = NDArray[np.float64]

# s; over which a change of attitude tells a turn rate.
TURN_RATE_WINDOW = 1.0


def rate_of_change(values: Array, interval: float, half: int) -> Array:
    """Return the slope of the cubic through each sample and so many on either side, per second; NaN without them."""
    rate = np.full(values.size, np.nan)
    if values.size > 2 * half:
        rate[half : values.size - half] = np.convolve(values, _weights(interval, half), "valid")
    return rate


def response_to_rates(rates: Array, interval: float, half: int) -> Array:
    """Return what `rate_of_change` makes of an angle that changes by these rates, linear from sample to sample."""
    smoothed = np.full(rates.size, np.nan)
    if rates.size > 2 * half:
        # The angle's change from one sample to the next is added by each weight of a later one.
        later = interval * np.cumsum(_weights(interval, half))[:-1]
        smoothed[half : rates.size - half] = np.convolve(rates, np.convolve(later, [0.5, 0.5]), "valid")
    return smoothed


def rate_noise(interval: float, half: int, averaged: int = 1) -> float:
    """Return the standard deviation of such a slope, or of a mean of so many, over that of white samples, 1/s."""
    return float(np.linalg.norm(np.convolve(_weights(interval, half), np.full(averaged, 1.0 / averaged))))


def _weights(interval: float, half: int) -> Array:
    return np.asarray(savgol_coeffs(2 * half + 1, 3, deriv=1, delta=interval), dtype=np.float64)
