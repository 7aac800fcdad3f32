"""Lags between signals on a grid: shifts, and where a likelihood over lags peaks."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def shifted(values: Array, cells: int) -> Array:
    """Shift values so many cells earlier, or later if negative; NaN where nothing is known."""
    lost = np.full(min(abs(cells), values.size), np.nan)
    return np.concatenate([values[cells:], lost] if cells > 0 else [lost, values[: max(values.size + cells, 0)]])


def peak(likelihood: Array, at: int) -> tuple[float, float]:
    """Return how far beyond one of evenly spaced log-likelihoods the parabola about it peaks, and its deviation there.

    Both are 0 where there is no such peak.
    """
    if not 0 < at < likelihood.size - 1 or likelihood[at] < max(likelihood[at - 1], likelihood[at + 1]):
        return 0.0, 0.0
    before, here, after = likelihood[at - 1 : at + 2]
    curvature = before - 2.0 * here + after
    return (float(0.5 * (before - after) / curvature), float((-curvature) ** -0.5)) if curvature < 0.0 else (0.0, 0.0)


def likeliest_lag(likelihood: Array) -> tuple[float, float]:
    """Return the likeliest of lags that are even about 0, and its standard deviation, in cells."""
    at = int(likelihood.argmax())
    beyond, error = peak(likelihood, at)
    return at - likelihood.size // 2 + beyond, error
