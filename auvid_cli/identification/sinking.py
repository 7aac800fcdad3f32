"""How the depth follows the motion, and what it owes to it."""

from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import sine_cosine
from auvid_cli.vehicle.parameters import N_MOTION

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.void(_vector, types.int64, types.uint64, types.float64), internal=True)
def sink(moving, place, n_lanes, duration):
    """Move the depth on at the present rate: a half step before and one after the motion are the trapezoidal rule.

    The depth is the moving state at `place`.
    """
    for k in range(n_lanes):
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        across = sin_phi * moving[LANES + k] + cos_phi * moving[2 * LANES + k]
        moving[place * LANES + k] += duration * (cos_theta * across - sin_theta * moving[k])


@compiled(types.void(_matrix, _vector), internal=True)
def before_moving(sensitivity, sinking):
    """Begin: the motion depends on itself alone, and the depth has not changed."""
    for i in range(N_MOTION):
        for j in range(sensitivity.shape[1]):
            sensitivity[i, j] = 1.0 if i == j else 0.0
    for j in range(sinking.size):
        sinking[j] = 0.0


@compiled(types.void(_vector, _matrix, types.float64, _vector), internal=True)
def sink_rate(motion, sensitivity, duration, sinking):
    """Add the derivative of the present vertical velocity, for so long, and in the last place the velocity itself."""
    u, v, w = motion[0], motion[1], motion[2]
    sin_phi, cos_phi = sine_cosine(motion[6])
    sin_theta, cos_theta = sine_cosine(motion[7])
    across, along = sin_phi * v + cos_phi * w, cos_phi * v - sin_phi * w
    n_columns = sensitivity.shape[1]
    for j in range(n_columns):
        turning = cos_theta * along * sensitivity[6, j] - (sin_theta * across + cos_theta * u) * sensitivity[7, j]
        moving = cos_theta * (sin_phi * sensitivity[1, j] + cos_phi * sensitivity[2, j])
        sinking[j] += duration * (turning + moving - sin_theta * sensitivity[0, j])
    sinking[n_columns] += duration * (cos_theta * across - sin_theta * u)
