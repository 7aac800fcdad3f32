"""What a magnetometer of three axes measures: field of the earth and of the vehicle, ``R(eta)' m + hard iron``."""

from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.identification.compiled_layout import MAGNETOMETER, ROW, first_moving_row, known_vector, row_of, value_of
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import sine_cosine

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.void(_vector, _vector, _vector, types.uint64, _vector), internal=True)
def measure_field(moving, parameters, constants, n_lanes, predicted):
    """Predict what it measures of a block of states."""
    north, east, down = known_vector(constants, MAGNETOMETER)
    biases = ROW.bias_mx, ROW.bias_my, ROW.bias_mz
    for k in range(n_lanes):
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        sin_psi, cos_psi = sine_cosine(moving[8 * LANES + k])
        ahead, aside = cos_psi * north + sin_psi * east, cos_psi * east - sin_psi * north
        steep = sin_theta * ahead + cos_theta * down
        predicted[k] = cos_theta * ahead - sin_theta * down
        predicted[LANES + k] = sin_phi * steep + cos_phi * aside
        predicted[2 * LANES + k] = cos_phi * steep - sin_phi * aside
        for axis in range(3):
            predicted[axis * LANES + k] += value_of(constants, biases[axis], parameters, moving, k)


@compiled(types.void(_vector, _vector, _vector, _matrix), internal=True)
def linearise_field(mean, constants, predicted, matrix):
    """Predict what it measures of one state, shape (3,), and the derivative by the state, whose other columns stay."""
    first = first_moving_row(constants)
    north, east, down = known_vector(constants, MAGNETOMETER)
    biases = ROW.bias_mx, ROW.bias_my, ROW.bias_mz
    sin_phi, cos_phi = sine_cosine(mean[first + 6])
    sin_theta, cos_theta = sine_cosine(mean[first + 7])
    sin_psi, cos_psi = sine_cosine(mean[first + 8])
    ahead, aside = cos_psi * north + sin_psi * east, cos_psi * east - sin_psi * north
    steep, level = sin_theta * ahead + cos_theta * down, cos_theta * ahead - sin_theta * down
    y, z = sin_phi * steep + cos_phi * aside, cos_phi * steep - sin_phi * aside
    predicted[0], predicted[1], predicted[2] = level, y, z
    by_roll, by_pitch = (0.0, z, -y), (-steep, sin_phi * level, cos_phi * level)
    # By the heading what is ahead grows by what is aside, and that falls by what is ahead.
    rising = sin_theta * aside
    by_yaw = cos_theta * aside, sin_phi * rising - cos_phi * ahead, cos_phi * rising + sin_phi * ahead
    for axis in range(3):
        matrix[axis, first + 6] = by_roll[axis]
        matrix[axis, first + 7] = by_pitch[axis]
        matrix[axis, first + 8] = by_yaw[axis]
        bias = row_of(constants, biases[axis])
        if bias >= 0:
            matrix[axis, bias] = 1.0
            predicted[axis] += mean[bias]
