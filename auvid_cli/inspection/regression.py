"""Robust linear regression of one signal on others."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MOST_ROWS = 20_000
_FEWEST_WINDOWS = 15
# Of Huber's weights: 95 % as good as least squares where the noise is normal.
_TUNING, _ROUNDS = 1.345, 12


class Regression(NamedTuple):
    """Regression of one signal on another, those beside it taken into account.

    Attributes
    ----------
    gain, error : float
        Slope and its standard error; samples within one window count as one.
    correlation : float
        Partial.
    spread : float
        Standard deviation of what the others do not explain of the regressor.
    independent : float
        How many windows would tell as much if each told the same: few where a single event tells all.
    """

    gain: float
    error: float
    correlation: float
    spread: float
    independent: float


def fit(
    values: Array, regressor: Array, others: Sequence[Array], window: int, constant: bool = True
) -> Regression | None:
    """Regress on one signal, on others beside it, and on a constant.

    Parameters
    ----------
    values, regressor : ndarray, shape (n,)
        NaN where not known.
    others : sequence of ndarray
    window : int
        Samples over which the signals were averaged.
    constant : bool
        Whether there is one beside: not where the regressor itself is as good as constant.

    Returns
    -------
    Regression or None
        None if too little is known.
    """
    columns = np.stack([values, regressor, *others])
    complete = np.flatnonzero(np.isfinite(columns).all(axis=0))
    windows = complete.size / window
    if windows < _FEWEST_WINDOWS + len(others):
        return None
    y, *rows = columns[:, complete[:: 1 + complete.size // _MOST_ROWS]]
    beside = np.stack([*(_unit(row) for row in rows[1:]), *[np.ones(y.size)] * constant], axis=1)
    x = rows[0]
    weighted = _weighted(y, x, beside, np.ones(y.size))
    for _ in range(_ROUNDS):
        residual = np.abs(weighted.residual)
        scale = _TUNING * 1.4826 * float(np.median(residual))
        if scale == 0.0:
            break
        weighted = _weighted(y, x, beside, np.minimum(1.0, scale / np.maximum(residual, scale)))
    if not weighted.power > 0.0:
        return Regression(0.0, np.inf, 0.0, 0.0, 0.0)
    correlation = (
        weighted.gain * np.sqrt(weighted.power / weighted.power_of_values) if weighted.power_of_values > 0.0 else 0.0
    )
    error = np.sqrt(weighted.variance / weighted.power / (windows - len(rows)))
    return Regression(
        weighted.gain, float(error), float(correlation), float(np.sqrt(weighted.power)), weighted.evenness * windows
    )


class _Weighted(NamedTuple):
    """A weighted least-squares fit; powers are those of what the others leave.

    Evenness is the share of samples that would tell as much if each told the same.
    """

    gain: float
    residual: Array
    variance: float
    power: float
    power_of_values: float
    evenness: float


def _weighted(y: Array, x: Array, beside: Array, weights: Array) -> _Weighted:
    y_left, x_left = _left(np.stack([y, x], axis=1), beside, weights).T
    share = weights / weights.sum()
    power = float(share @ x_left**2)
    # What is left of a signal that the others hold whole is rounding.
    gain, power = (float(share @ (x_left * y_left)) / power, power) if power > 1e-20 * float(x @ x) else (0.0, 0.0)
    residual = y_left - gain * x_left
    told = share * x_left**2
    evenness = power**2 / (x.size * float(told @ told)) if power > 0.0 else 0.0
    return _Weighted(gain, residual, float(share @ residual**2), power, float(share @ y_left**2), evenness)


def _unit(values: Array) -> Array:
    size = float(np.sqrt(np.mean(values**2)))
    return values / size if size > 0.0 else values


def _left(values: Array, beside: Array, weights: Array) -> Array:
    """Return what weighted least squares leave of each signal, a column of `values`."""
    root = np.sqrt(weights)[:, None]
    solution = np.linalg.lstsq(root * beside, root * values, rcond=1e-10)[0]
    return values - beside @ solution
