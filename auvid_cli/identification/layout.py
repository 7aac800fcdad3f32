"""Where things stand in the state and among the constants that the compiled vehicle model is handed."""

from collections.abc import Sequence

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.blocks import LANES
from auvid_cli.compilation import compiled
from auvid_cli.identification.biases import DVL_ERRORS, THRUST_SCALE, SensorError, constant_errors, walking_errors
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.dynamics import N_CONSTANTS
from auvid_cli.vehicle.parameters import N_MOTION

Array = NDArray[np.float64]

_vector = types.float64[::1]

# The constants: the vehicle, the 22 held values, one scale for each estimated coefficient; last, how many
# parameters there are, whether the depth is a state, behind the motion, and in which rows of the state the DVL's
# scale error and mounting yaw, the current and the thrust's scale error stand.
HELD = N_CONSTANTS
SCALE = N_CONSTANTS + N_COEFFICIENTS
_NOWHERE = -1.0
_FIRST_MOTION_ROW, _HAS_DEPTH, DVL_SCALE, DVL_YAW, CURRENT_NORTH, CURRENT_EAST, THRUST = range(7, 0, -1)


def all_constants(vehicle: Array, held: Array, scale: Array, errors: Sequence[SensorError], has_depth: bool) -> Array:
    """Constants of an augmented model; see `auvid_cli.identification.process.vehicle_process`."""
    n_parameters = scale.size + len(constant_errors(errors))
    order = [*constant_errors(errors), *([None] * (N_MOTION + has_depth)), *walking_errors(errors)]
    place = {error.symbol: float(scale.size + row) for row, error in enumerate(order) if error is not None}
    rows = [place.get(symbol, _NOWHERE) for symbol in (*DVL_ERRORS, THRUST_SCALE)]
    return np.concatenate([vehicle, held, scale, [n_parameters, has_depth, *rows]])


@compiled(types.int64(_vector))
def first_motion_row(constants):
    """How many parameters stand before the motion."""
    return int(constants[constants.size - _FIRST_MOTION_ROW])


@compiled(types.boolean(_vector), internal=True)
def depth_is_state(constants):
    """Whether it is, behind the motion."""
    return constants[constants.size - _HAS_DEPTH] > 0.0


@compiled(types.int64(_vector, types.int64))
def row_of(constants, which):
    """Row of the state in which one of the errors stands; negative if nowhere."""
    return int(constants[constants.size - which])


@compiled(types.float64(_vector, types.int64, _vector, _vector, types.int64), internal=True)
def stated(constants, which, parameters, moving, k):
    """One lane of one of the errors, wherever in the state it stands; 0 if nowhere."""
    row, n_parameters = row_of(constants, which), first_motion_row(constants)
    if row < 0:
        return 0.0
    return parameters[row * LANES + k] if row < n_parameters else moving[(row - n_parameters) * LANES + k]
