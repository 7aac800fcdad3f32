"""How the vehicle of the file answers its inputs in small motions about straight and level."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.matrices import coriolis_matrix, mass_matrix, restoring_vector

Array = NDArray[np.float64]

_ACROSS = ("v", "w", "p", "q", "r")
_STATES = ("u", *_ACROSS, "phi", "theta")
# Row of the equations of motion that an input which is no fin acts in.
_ROWS = {"surge_force": 0, "roll_moment": 3}
# Of a Gaussian signal: its mean modulus over its standard deviation.
_MEAN_MODULUS = np.sqrt(2.0 / np.pi)


class SmallMotion(NamedTuple):
    """Linear equations of motion.

    Attributes
    ----------
    by_state : ndarray, shape (8, 8)
        Rates of change of u, v, w, p, q, r, roll and pitch, by each of them.
    by_input : dict of ndarray, shape (8,)
        By input: of a fin by its angle times the square of the speed, of others by their force or moment.
    """

    by_state: Array
    by_input: dict[str, Array]

    def answer(self, rate: str, states: Sequence[str], given: str, step: float, cells: int) -> Array:
        """Return how much each of some steps of a unit input, one after the other, changes a rate by the end of all.

        Parameters
        ----------
        rate : str
        states : sequence of str
            What moves with it; all others are held.
        given : str
            The input.
        step : float
            s.
        cells : int
            How many steps.

        Returns
        -------
        ndarray, shape (cells,)
            That of the first step first.
        """
        at = [_STATES.index(state) for state in states]
        size = len(at)
        # The input as a state that does not change: one exponential has the step's transition and what it adds.
        joint = np.zeros((size + 1, size + 1))
        joint[:size, :size], joint[:size, size] = self.by_state[np.ix_(at, at)], self.by_input[given][at]
        transition = expm(step * joint)
        added, answers = transition[:size, size], np.empty(cells)
        for k in reversed(range(cells)):
            answers[k] = added[[*states].index(rate)]
            added = transition[:size, :size] @ added
        return answers


def small_motion(vehicle: VehicleSettings, speed: float, spreads: Mapping[str, float]) -> SmallMotion | None:
    """Make the equations of motion of a vehicle file linear; None of a file that states no coefficients.

    Parameters
    ----------
    vehicle : VehicleSettings
    speed : float
        Along the axis, m/s.
    spreads : mapping of str to float
        Standard deviations of the other velocities, SI, as far as they are known: ``|v| v`` acts as
        ``sqrt(8/pi) sigma v`` does.
    """
    stated = vehicle.stated_coefficients()
    if any(c.symbol not in stated for c in vehicle.coefficient_set):
        return None
    parameters = vehicle.known_parameters()
    mass = mass_matrix(parameters)
    forces, fins = np.zeros((6, 8)), {fin: np.zeros(6) for fin in ("rudder", "elevator")}
    sizes = [_MEAN_MODULUS * spreads.get(symbol, 0.0) for symbol in _ACROSS]
    patterns = [*product((1.0, -1.0), repeat=len(_ACROSS))]
    for pattern in patterns:
        at = dict(zip(_ACROSS, np.multiply(pattern, sizes), strict=True)) | {"u": speed}
        for coefficient in vehicle.coefficient_set:
            share = stated[coefficient.symbol] / len(patterns)
            for k, symbol in enumerate(_STATES[:6]):
                forces[coefficient.row, k] += share * _slope(coefficient, symbol, at)
            for fin, by_fin in fins.items():
                by_fin[coefficient.row] += share * _slope(coefficient, fin, at) / speed**2
    ahead, unit = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]), np.eye(6)
    for k in range(6):
        more, less = (coriolis_matrix(mass, at) @ at for at in (ahead + unit[k], ahead - unit[k]))
        forces[:, k] -= 0.5 * (more - less)
    for k in range(2):
        more, less = (restoring_vector(parameters, sign * 1e-4 * unit[k, :3]) for sign in (1.0, -1.0))
        forces[:, 6 + k] = (more - less) / 2e-4
    by_state = np.zeros((8, 8))
    by_state[:6] = np.linalg.solve(mass, forces)
    by_state[6, 3] = by_state[7, 4] = 1.0
    by_force = dict(fins) | {given: unit[row] for given, row in _ROWS.items()}
    by_input = {given: np.append(np.linalg.solve(mass, force), [0.0, 0.0]) for given, force in by_force.items()}
    return SmallMotion(by_state, by_input)


def _slope(coefficient: Coefficient, symbol: str, at: Mapping[str, float]) -> float:
    """Differentiate a regressor by one of its signals, by the product rule; fins and thrust are at zero."""
    total, factors = 0.0, [*zip(coefficient.signals, coefficient.moduli, strict=True)]
    for k, (signal, modulus) in enumerate(factors):
        if signal == symbol:
            slope = float(np.sign(at.get(signal, 0.0))) if modulus else 1.0
            for other, is_modulus in factors[:k] + factors[k + 1 :]:
                value = at.get(other, 0.0)
                slope *= abs(value) if is_modulus else value
            total += slope
    return total
