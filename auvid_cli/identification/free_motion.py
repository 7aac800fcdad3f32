"""The motion of the model left to itself, and the depth that it comes to."""

from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.identification.sinking import sink
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import runge_kutta_step
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH, N_MOTION

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
N_PREDICTED = len(MOTION_AND_DEPTH)


@compiled(types.void(_vector, _vector, _vector, types.uint64, TIMELINE, types.int64, types.int64, _vector))
def move_through(block, coefficients, constants, n_lanes, timeline, first, last, work):
    """Move models side by side through some substeps, in place.

    Parameters
    ----------
    block : ndarray, shape (N_PREDICTED * LANES,)
        Motion, and the depth below it.
    coefficients, constants, n_lanes, work
        As for `auvid_cli.vehicle.dynamics.runge_kutta_step`.
    timeline : Timeline
    first, last : int
        Substeps, without the last.
    """
    for substep in range(first, last):
        held, duration = timeline.inputs[timeline.substep_input[substep]], timeline.substep_duration[substep]
        sink(block, N_MOTION, n_lanes, 0.5 * duration)
        runge_kutta_step(block, coefficients, held, constants, n_lanes, duration, work)
        sink(block, N_MOTION, n_lanes, 0.5 * duration)


@compiled(types.void(_vector, _vector, _vector, TIMELINE, _matrix, _vector))
def move_freely(block, coefficients, constants, timeline, predicted, work):
    """Fill in motion and depth at every event.

    Parameters
    ----------
    block : ndarray, shape (N_PREDICTED * LANES,)
        Motion and depth where they start and, afterwards, where they end, in every lane.
    coefficients : ndarray, shape ((N_FACTORS + terms) * LANES,)
    constants : ndarray
        From `auvid_cli.vehicle.dynamics.vehicle_constants`.
    timeline : Timeline
    predicted : ndarray, shape (events, N_PREDICTED)
        Filled in.
    work : ndarray, shape (N_WORK,)
        Overwritten.
    """
    for event in range(timeline.time.size):
        first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
        move_through(block, coefficients, constants, 1, timeline, first, last, work)
        for i in range(N_PREDICTED):
            predicted[event, i] = block[i * LANES]
