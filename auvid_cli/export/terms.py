"""How large the force or moment of each coefficient is along a motion."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.vehicle.coefficients import EQUATION_ROWS, PROPULSION_SIGNALS, CoefficientSet
from auvid_cli.vehicle.parameters import ALL_INPUTS, MOTION_SYMBOLS

Array = NDArray[np.float64]

# Of factors what inputs they are, where these have other names.
CALLED_OTHERWISE = {"thrust": "surge_force", **PROPULSION_SIGNALS}


class TermSize(NamedTuple):
    """One coefficient's term of the equations of motion.

    Attributes
    ----------
    symbol : str
    row : str
        "X", "Y", "Z", "K", "M" or "N".
    unit : str
        "N" or "N*m".
    rms : float
        Root mean square of the force or moment.
    percent : float
        Of all terms of the row together, the root of the sum of their mean squares: unlike their sum, that does
        not grow small where terms balance each other.
    """

    symbol: str
    row: str
    unit: str
    rms: float
    percent: float


def term_histories(
    of_vehicle: CoefficientSet, coefficients: Mapping[str, float], motion: Array, inputs: Array
) -> Array:
    """Return the force or moment of every coefficient, Sabet et al. 2018, eq. (13).

    Parameters
    ----------
    of_vehicle : CoefficientSet
    coefficients : mapping
        All of them by symbol, SI.
    motion : ndarray, shape (n, 9)
        u, v, w, p, q, r, phi, theta, psi; m/s, rad/s, rad.
    inputs : ndarray, shape (n, 4) or (n, 6)
        As of a dataset.

    Returns
    -------
    ndarray, shape (n, len(of_vehicle))
        N or N m, in that order.
    """
    given = dict(zip((quantity.symbol for quantity in ALL_INPUTS), inputs.T, strict=False))
    signals = dict(zip(MOTION_SYMBOLS, motion.T, strict=True)) | given
    signals |= {name: given[symbol] for name, symbol in CALLED_OTHERWISE.items() if symbol in given}
    terms = np.empty((len(motion), len(of_vehicle)))
    for column, coefficient in enumerate(of_vehicle):
        factors = [
            np.abs(signals[name]) if modulus else signals[name]
            for name, modulus in zip(coefficient.signals, coefficient.moduli, strict=True)
        ]
        terms[:, column] = coefficients[coefficient.symbol] * np.prod(factors, axis=0)
    return terms


def term_sizes(of_vehicle: CoefficientSet, terms: Array) -> list[TermSize]:
    """Return the size of every term from its history; `terms` as of `term_histories`."""
    squares = np.mean(terms**2, axis=0)
    rows = np.array([coefficient.row for coefficient in of_vehicle])
    of_rows = np.sqrt(np.bincount(rows, squares, minlength=len(EQUATION_ROWS)))
    sizes = []
    for coefficient, square in zip(of_vehicle, squares, strict=True):
        rms, whole = float(np.sqrt(square)), float(of_rows[coefficient.row])
        unit = "N" if coefficient.row < 3 else "N*m"
        percent = 100.0 * rms / whole if whole else 0.0
        sizes.append(TermSize(coefficient.symbol, EQUATION_ROWS[coefficient.row], unit, rms, percent))
    return sizes


def held_inputs(time: Array, input_time: Array, values: Array) -> Array:
    """Return the inputs in force at given times; each holds from its own time to the next.

    Times are compared in whole nanoseconds, to which a filter rounds those of its events.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, none before the first of `input_time`.
    input_time : ndarray, shape (k,)
        s, increasing.
    values : ndarray, shape (k, 4)

    Returns
    -------
    ndarray, shape (n, 4)
    """
    return values[np.searchsorted(input_time.round(9), time.round(9), side="right") - 1]
