"""Parts of an exported model: terms, actuation and fin surfaces."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.data.acting_inputs import as_acting
from auvid_cli.data.dataset import InputRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, PROPULSION_SIGNALS, CoefficientSet
from auvid_cli.vehicle.parameters import ALL_INPUTS, INPUT_SYMBOLS, MOTION_SYMBOLS

Array = NDArray[np.float64]
# Of factors what inputs they are, where these have other names.
CALLED_OTHERWISE = {"thrust": "surge_force", **PROPULSION_SIGNALS}
_FORCE = INPUT_SYMBOLS.index("surge_force")


class FinSurface(NamedTuple):
    """A pair of fins as one surface.

    Attributes
    ----------
    name : str
        "rudder" or "elevator".
    symbols : tuple of str
        Of its force's and its moment's coefficient.
    force : float
        Coefficient of the force to starboard or down, kg/(m rad).
    place : float
        Where force and moment meet, forward of the origin, m.
    """

    name: str
    symbols: tuple[str, str]
    force: float
    place: float


def fin_surfaces(coefficients: Mapping[str, float]) -> list[FinSurface]:
    """Return those that there are; one with a moment and no force acts nowhere, and is left out."""
    pairs = (("rudder", ("Y_uudr", "N_uudr"), 1.0), ("elevator", ("Z_uude", "M_uude"), -1.0))
    return [
        FinSurface(name, (force, moment), coefficients[force], sign * coefficients[moment] / coefficients[force])
        for name, (force, moment), sign in pairs
        if coefficients[force]
    ]


def surface_changes(coefficients: Mapping[str, float], motion: Array, inputs: Array) -> dict[str, float]:
    """Return how much changes if the fins are such surfaces.

    Parameters
    ----------
    coefficients : mapping
        All by symbol, SI.
    motion : ndarray, shape (n, 9)
    inputs : ndarray, shape (n, 4)

    Returns
    -------
    dict of float
        Root mean square by row of the equations of motion, N or N m.
    """
    signals = dict(zip(MOTION_SYMBOLS, motion.T, strict=True)) | dict(zip(INPUT_SYMBOLS, inputs.T, strict=False))
    changes = dict.fromkeys("XYZMN", np.zeros(len(motion)))
    for surface in fin_surfaces(coefficients):
        is_rudder = surface.name == "rudder"
        drift, turning = (signals["v"], signals["r"]) if is_rudder else (signals["w"], -signals["q"])
        across = drift + surface.place * turning
        speed, strength = np.hypot(signals["u"], across), surface.force * signals[surface.name]
        sideways = strength * signals["u"] * (speed - signals["u"])
        changes["X"] = changes["X"] - strength * across * speed
        changes["Y" if is_rudder else "Z"] = sideways
        changes["N" if is_rudder else "M"] = surface.place * sideways
    return {row: float(np.sqrt(np.mean(change**2))) for row, change in changes.items()}


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


class Actuation(NamedTuple):
    """Effect of the actuators between the inputs and the forces.

    Attributes
    ----------
    thrust : float
        How many times the stated surge force acts.
    thrust_rms : float
        Root mean square of the surge force that this adds or takes, N.
    actuators : ActuatorSettings
        How fins and propeller follow their commands.
    changes : dict of float
        Root mean square of what that changes in the force or moment of each coefficient of an input, and in
        `surge_force`, N or N m.
    """

    thrust: float
    thrust_rms: float
    actuators: ActuatorSettings
    changes: dict[str, float]


def acting_inputs(estimate: Estimate, inputs: InputRecord) -> Array:
    """Return inputs at the times of an estimate as its filter saw them act, but for trims and the thrust's gain."""
    acting = as_acting(inputs, estimate.experiment)
    return held_inputs(estimate.time, acting.time, acting.values)


def actuation(estimate: Estimate, inputs: InputRecord, coefficients: Mapping[str, float], motion: Array) -> Actuation:
    """Return gain and actuators of an estimate, sized along its motion.

    Parameters
    ----------
    estimate : Estimate
    inputs : InputRecord
        As stated.
    coefficients : mapping
        All by symbol, SI.
    motion : ndarray, shape (n, 9)
        At the times of the estimate.
    """
    commanded = held_inputs(estimate.time, inputs.time, inputs.values)
    of_vehicle, acting = estimate.coefficient_set, acting_inputs(estimate, inputs)
    by_command, by_actuator = (term_histories(of_vehicle, coefficients, motion, each) for each in (commanded, acting))
    changes = np.sqrt(np.mean((by_actuator - by_command) ** 2, axis=0))
    thrust, force = estimate.final_actuators().thrust, acting[:, _FORCE]
    of_inputs = {c.symbol: float(rms) for c, rms in zip(of_vehicle, changes, strict=True) if c.is_of_inputs}
    return Actuation(
        thrust=thrust,
        thrust_rms=float(abs(thrust - 1.0) * np.sqrt(np.mean(force**2))),
        actuators=estimate.experiment.vehicle.actuators,
        changes=of_inputs | {"surge_force": float(np.sqrt(np.mean((force - commanded[:, _FORCE]) ** 2)))},
    )
