"""What a DVL sees of a motion through the water: over ground, with a scale error, mounted at a small yaw.

``(1 + scale) Rz(yaw)' ([u v w] + R(phi, theta, psi)' [current_north current_east 0])``.
"""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import OBSERVATION_SIGNATURE
from auvid_cli.identification.compiled_layout import (
    ROW_CURRENT_EAST,
    ROW_CURRENT_NORTH,
    ROW_DVL_SCALE,
    ROW_DVL_YAW,
    first_moving_row,
    row_of,
    value_of,
)
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import sine_cosine
from auvid_cli.vehicle.kinematics import earth_to_body, rotation_matrix
from auvid_cli.vehicle.parameters import N_MOTION

Array = NDArray[np.float64]


@compiled(OBSERVATION_SIGNATURE)
def observe(moving, parameters, sensor, constants, selection, n_lanes, seen):
    """Predict what the DVL sees of a block of states; it is the only nonlinear sensor."""
    for k in range(n_lanes):
        north = value_of(constants, ROW_CURRENT_NORTH, parameters, moving, k)
        east = value_of(constants, ROW_CURRENT_EAST, parameters, moving, k)
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        sin_psi, cos_psi = sine_cosine(moving[8 * LANES + k])
        ahead, aside = cos_psi * north + sin_psi * east, cos_psi * east - sin_psi * north
        u = moving[k] + cos_theta * ahead
        v = moving[LANES + k] + sin_phi * sin_theta * ahead + cos_phi * aside
        w = moving[2 * LANES + k] + cos_phi * sin_theta * ahead - sin_phi * aside
        sin_yaw, cos_yaw = sine_cosine(value_of(constants, ROW_DVL_YAW, parameters, moving, k))
        gain = 1.0 + value_of(constants, ROW_DVL_SCALE, parameters, moving, k)
        seen[k] = gain * (cos_yaw * u + sin_yaw * v)
        seen[LANES + k] = gain * (cos_yaw * v - sin_yaw * u)
        seen[2 * LANES + k] = gain * w


def linearised(constants: Array, mean: Array, sensor: int) -> tuple[Array, Array]:
    """Predict what it sees of one state, shape (3,), and the derivative by the state, shape (3, n)."""
    first = first_moving_row(constants)
    rows = [row_of(constants, which) for which in (ROW_DVL_SCALE, ROW_DVL_YAW, ROW_CURRENT_NORTH, ROW_CURRENT_EAST)]
    scale, yaw, north, east = (float(mean[row]) if row >= 0 else 0.0 for row in rows)
    velocity, attitude = mean[first : first + 3], mean[first + 6 : first + N_MOTION]
    axes = earth_in_body_axes(attitude)
    drift = axes[:, :2] @ [north, east]
    by_roll = np.array([0.0, drift[2], -drift[1]])
    by_pitch = (np.cos(attitude[2]) * north + np.sin(attitude[2]) * east) * axes[:, 2]
    by_yaw = axes[:, :2] @ [east, -north]
    turn = dvl_axes(scale, yaw)
    seen = turn @ (velocity + drift)
    matrix = np.zeros((3, mean.size))
    matrix[:, first : first + 3] = turn
    matrix[:, first + 6 : first + N_MOTION] = turn @ np.stack([by_roll, by_pitch, by_yaw], axis=1)
    by_mounting = np.array([seen[1], -seen[0], 0.0])
    by_scale = dvl_axes(0.0, yaw) @ (velocity + drift)
    for row, column in zip(rows, [by_scale, by_mounting, *(turn @ axes[:, :2]).T], strict=True):
        if row >= 0:
            matrix[:, row] = column
    return seen, matrix


def dvl_axes(scale: float, yaw: float) -> Array:
    """Return the matrix from the velocity over ground to what is seen of it, ``(1 + scale) Rz(yaw)'``."""
    sine, cosine = np.sin(yaw), np.cos(yaw)
    return (1.0 + scale) * np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def current_in_body_axes(attitude: Array, north: float, east: float) -> Array:
    """Turn a current to x, y, z of the vehicle, shape (..., 3), at as many attitudes."""
    rows = attitude.reshape(-1, 3)
    return earth_to_body(rows, np.broadcast_to([north, east, 0.0], rows.shape)).reshape(attitude.shape)


def earth_in_body_axes(attitude: Array) -> Array:
    """Return north, east and down along x, y, z of the vehicle: the columns of ``R(phi, theta, psi)'``."""
    return rotation_matrix(attitude).T
