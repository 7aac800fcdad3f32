"""What a DVL measures of a motion through the water: over ground, off the origin, with a scale error, turned a little.

``(1 + scale) Rz(yaw)' ([u v w] + R(phi, theta, psi)' [current_north current_east 0] + [p q r] x arm)``.
"""

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.config.extra_states import CURRENT, DVL_ARM, DVL_SCALE, DVL_YAW
from auvid_cli.identification.compiled_layout import ROW, first_moving_row, row_of, value_of
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import sine_cosine
from auvid_cli.vehicle.kinematics import current_in_body_axes, dvl_axes

Array = NDArray[np.float64]

VELOCITY_ERRORS = tuple(quantity.symbol for quantity in (DVL_SCALE, DVL_YAW, *CURRENT, *DVL_ARM))
"""Symbols of what lies between the velocity through the water and its measurement, but for what adds to that."""

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_three = types.UniTuple(types.float64, 3)


@compiled(types.void(_vector, _vector, _vector, types.uint64, _vector), internal=True)
def measure_velocities(moving, parameters, constants, n_lanes, predicted):
    """Predict what it measures of a block of states."""
    for k in range(n_lanes):
        north = value_of(constants, ROW.current_north, parameters, moving, k)
        east = value_of(constants, ROW.current_east, parameters, moving, k)
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        sin_psi, cos_psi = sine_cosine(moving[8 * LANES + k])
        ahead, aside = cos_psi * north + sin_psi * east, cos_psi * east - sin_psi * north
        p, q, r = moving[3 * LANES + k], moving[4 * LANES + k], moving[5 * LANES + k]
        x = value_of(constants, ROW.dvl_x, parameters, moving, k)
        y = value_of(constants, ROW.dvl_y, parameters, moving, k)
        z = value_of(constants, ROW.dvl_z, parameters, moving, k)
        u = moving[k] + cos_theta * ahead + q * z - r * y
        v = moving[LANES + k] + sin_phi * sin_theta * ahead + cos_phi * aside + r * x - p * z
        w = moving[2 * LANES + k] + cos_phi * sin_theta * ahead - sin_phi * aside + p * y - q * x
        sin_yaw, cos_yaw = sine_cosine(value_of(constants, ROW.dvl_yaw, parameters, moving, k))
        gain = 1.0 + value_of(constants, ROW.dvl_scale, parameters, moving, k)
        predicted[k] = gain * (cos_yaw * u + sin_yaw * v)
        predicted[LANES + k] = gain * (cos_yaw * v - sin_yaw * u)
        predicted[2 * LANES + k] = gain * w


@compiled(types.float64(_vector, _vector, types.int64), internal=True)
def _value(constants, mean, which):
    row = row_of(constants, which)
    return mean[row] if row >= 0 else 0.0


@compiled(types.void(_matrix, types.int64, types.float64, types.float64, _three), internal=True)
def _put(matrix, column, gain, yaw, vector):
    """Turn a vector of the vehicle's axes to those of the DVL, times its gain; as a column, if there is one."""
    if column >= 0:
        sine, cosine = sine_cosine(yaw)
        matrix[0, column] = gain * (cosine * vector[0] + sine * vector[1])
        matrix[1, column] = gain * (cosine * vector[1] - sine * vector[0])
        matrix[2, column] = gain * vector[2]


@compiled(types.void(_vector, _vector, _vector, _matrix), internal=True)
def linearise_velocity(mean, constants, predicted, matrix):
    """Predict what it measures of one state, shape (3,), and the derivative by the state, whose other columns stay."""
    first, scale_row, yaw_row = (
        first_moving_row(constants),
        row_of(constants, ROW.dvl_scale),
        row_of(constants, ROW.dvl_yaw),
    )
    gain, yaw = 1.0 + _value(constants, mean, ROW.dvl_scale), _value(constants, mean, ROW.dvl_yaw)
    north, east = _value(constants, mean, ROW.current_north), _value(constants, mean, ROW.current_east)
    sin_phi, cos_phi = sine_cosine(mean[first + 6])
    sin_theta, cos_theta = sine_cosine(mean[first + 7])
    sin_psi, cos_psi = sine_cosine(mean[first + 8])
    ahead, aside = cos_psi * north + sin_psi * east, cos_psi * east - sin_psi * north
    drift_v = sin_phi * sin_theta * ahead + cos_phi * aside
    drift_w = cos_phi * sin_theta * ahead - sin_phi * aside
    p, q, r = mean[first + 3], mean[first + 4], mean[first + 5]
    x, y, z = (
        _value(constants, mean, ROW.dvl_x),
        _value(constants, mean, ROW.dvl_y),
        _value(constants, mean, ROW.dvl_z),
    )
    u = mean[first] + cos_theta * ahead + q * z - r * y
    v = mean[first + 1] + drift_v + r * x - p * z
    w = mean[first + 2] + drift_w + p * y - q * x

    # By the rates it moves at right angles to its arm, by the arm at right angles to the rates.
    for column, by in (
        (first + 3, (0.0, -z, y)),
        (first + 4, (z, 0.0, -x)),
        (first + 5, (-y, x, 0.0)),
        (row_of(constants, ROW.dvl_x), (0.0, r, -q)),
        (row_of(constants, ROW.dvl_y), (-r, 0.0, p)),
        (row_of(constants, ROW.dvl_z), (q, -p, 0.0)),
    ):
        _put(matrix, column, gain, yaw, by)
    # Along a horizontal direction with so much ahead and aside of the heading, in the vehicle's axes.
    for column, f, s in (
        (row_of(constants, ROW.current_north), cos_psi, -sin_psi),
        (row_of(constants, ROW.current_east), sin_psi, cos_psi),
        (first + 8, aside, -ahead),
    ):
        along = cos_theta * f, sin_phi * sin_theta * f + cos_phi * s, cos_phi * sin_theta * f - sin_phi * s
        _put(matrix, column, gain, yaw, along)
    down = -sin_theta * ahead, sin_phi * cos_theta * ahead, cos_phi * cos_theta * ahead
    _put(matrix, first + 7, gain, yaw, down)
    _put(matrix, first + 6, gain, yaw, (0.0, drift_w, -drift_v))
    for axis in range(3):
        unit = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
        _put(matrix, first + axis, gain, yaw, unit)
    # A quarter of a turn further is the derivative by the mounting.
    _put(matrix, yaw_row, gain, yaw, (v, -u, 0.0))
    _put(matrix, scale_row, 1.0, yaw, (u, v, w))
    sine, cosine = sine_cosine(yaw)
    predicted[0], predicted[1], predicted[2] = gain * (cosine * u + sine * v), gain * (cosine * v - sine * u), gain * w


def measured_velocity(motion: Array, errors: Array) -> Array:
    """Return what it measures of motions, shape (..., 9): velocities, shape (..., 3), m/s.

    Parameters
    ----------
    motion : ndarray, shape (..., 9)
        Its velocity is that through the water.
    errors : ndarray, shape (7,)
        In the order of `VELOCITY_ERRORS`.
    """
    return (motion[..., :3] + _beyond(motion, errors)) @ dvl_axes(*errors[:2]).T


def velocity_behind(motion: Array, errors: Array) -> Array:
    """Return the velocity through the water, where that of a motion is as measured; inverts `measured_velocity`."""
    return motion[..., :3] @ np.linalg.inv(dvl_axes(*errors[:2])).T - _beyond(motion, errors)


def _beyond(motion: Array, errors: Array) -> Array:
    """Return the velocity of the DVL over ground less that of the origin through the water."""
    _, _, north, east, *arm = errors
    return current_in_body_axes(motion[..., 6:9], north, east) + np.cross(motion[..., 3:6], arm)
