"""auvid's compiled equations of motion for one state at a time, as a filter of a general library asks for them."""

from collections.abc import Callable

import numpy as np
from numba import njit

from auvid_cli.filters.problem import Process
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.equations import N_BLOCK, N_CONSTANTS, N_SLOPE, NO_ERRORS, motion_derivative
from auvid_cli.vehicle.parameters import N_MOTION
from benchmarks.peers.problem import N_COEFFICIENTS, Array, units_of


@njit
def _advance(state, duration, held, vehicle, scale, coefficients, stage, slope):
    # One lane of auvid's blocks of 64: a Runge-Kutta step of the whole block would move 63 more.
    for i in range(N_COEFFICIENTS):
        coefficients[i * LANES] = scale[i] * state[i]
    result = state.copy()
    for i in range(N_MOTION):
        stage[i * LANES] = state[N_COEFFICIENTS + i]
    for k in range(4):
        motion_derivative(stage, coefficients, held, vehicle, 1, slope)
        share = duration / 6.0 if k in (0, 3) else duration / 3.0
        ahead = 0.5 * duration if k < 2 else duration
        for i in range(N_MOTION):
            result[N_COEFFICIENTS + i] += share * slope[i * LANES]
            stage[i * LANES] = state[N_COEFFICIENTS + i] + ahead * slope[i * LANES]
    return result


def compiled_point(process: Process) -> Callable[[Array, float, Array], Array]:
    """Compile ``advance(state, duration, held)``, which returns a new state, one Runge-Kutta step later."""
    vehicle, scale = process.constants[:N_CONSTANTS], units_of(process)
    # The errors of actuators and ballast stand behind the coefficients, and stay as they are.
    lanes = np.repeat(np.array([*np.zeros(N_COEFFICIENTS), *NO_ERRORS]), LANES)
    scratch = lanes, np.zeros(N_BLOCK), np.zeros(N_SLOPE)

    def advance(state: Array, duration: float, held: Array) -> Array:
        return _advance(state, duration, held, vehicle, scale, *scratch)

    return advance
