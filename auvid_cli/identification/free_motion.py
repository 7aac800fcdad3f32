"""The motion of the model left to itself."""

from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import runge_kutta_step
from auvid_cli.vehicle.parameters import N_MOTION

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.void(_vector, _vector, _vector, TIMELINE, _matrix, _vector))
def move_freely(block, coefficients, constants, timeline, predicted, work):
    """Fill in the motion at every event.

    Parameters
    ----------
    block : ndarray, shape (9 * LANES,)
        Motion where it starts and, afterwards, where it ends, in every lane.
    coefficients : ndarray, shape (N_FACTORS * LANES,)
    constants : ndarray
        From `auvid_cli.vehicle.dynamics.vehicle_constants`.
    timeline : Timeline
    predicted : ndarray, shape (events, 9)
        Filled in.
    work : ndarray, shape (N_WORK,)
        Overwritten.
    """
    for event in range(timeline.time.size):
        for substep in range(timeline.substep_offset[event], timeline.substep_offset[event + 1]):
            held = timeline.inputs[timeline.substep_input[substep]]
            runge_kutta_step(block, coefficients, held, constants, 1, timeline.substep_duration[substep], work)
        for i in range(N_MOTION):
            predicted[event, i] = block[i * LANES]
