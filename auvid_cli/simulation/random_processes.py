"""Random numbers of a simulation: a stream for each cause, and noise that is correlated in time."""

from zlib import crc32

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled

Array = NDArray[np.float64]

_vector = types.float64[::1]


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the random numbers of one cause, by its names, which leave those of all others as they are."""
    return np.random.default_rng([seed, *(crc32(name.encode()) for name in names)])


def gauss_markov(time: Array, time_constant: float, numbers: np.random.Generator) -> Array:
    """Draw a stationary first-order Gauss-Markov process of variance 1.

    Its autocorrelation over a lag is ``exp(-lag / time_constant)``, exactly and at any times.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, increasing.
    time_constant : float
        s.
    numbers : numpy.random.Generator

    Returns
    -------
    ndarray, shape (n,)
    """
    values = numbers.standard_normal(time.size)
    lag = np.diff(time) / time_constant
    values[1:] *= np.sqrt(-np.expm1(-2.0 * lag))
    _carry_on(np.exp(-lag), values)
    return values


@compiled(types.void(_vector, _vector))
def _carry_on(left, values):
    for k in range(left.size):
        values[k + 1] += left[k] * values[k]
