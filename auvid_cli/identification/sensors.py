"""Nonlinear sensors of the augmented state with their derivatives: accelerometer, DVL with errors, magnetometer.

An accelerometer at l measures ``nu1_dot + omega x nu1 + omega_dot x l + omega x (omega x l) - R' g``,
a DVL at l ``(1 + scale) Rz(yaw)' (nu1 + R' current + omega x l)``, a magnetometer ``R' m``; each plus its biases. R is
the rotation matrix from body to earth axes, Fossen 2011, ch. 2.
"""

from collections.abc import Iterable
from typing import NamedTuple

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import LINEARISATION_SIGNATURE, OBSERVATION_SIGNATURE
from auvid_cli.identification.compiled_layout import (
    ACCELEROMETER,
    MAGNETOMETER,
    ROW,
    fill_in_all,
    fill_in_lanes,
    fill_in_row,
    first_moving_row,
    is_disturbed,
    known_sensor,
    known_vector,
    row_of,
    value_of,
)
from auvid_cli.identification.disturbance import fill_in_specific_force, push
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.vehicle.equations import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_FACTORS,
    N_SLOPE,
    motion_derivative,
    n_terms,
    sine_cosine,
)
from auvid_cli.vehicle.jacobian import N_COLUMNS, N_JACOBIAN_WORK, motion_jacobian
from auvid_cli.vehicle.parameters import N_MOTION
from auvid_cli.vehicle.rigid_body import GRAVITY

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
# Ends of the parts of the scratch whose lengths do not depend on the vehicle's own terms.
_SLOPE = N_SLOPE
_BLOCK = _SLOPE + N_BLOCK
_FOR_JACOBIAN = _BLOCK + N_JACOBIAN_WORK
_FORCE = _FOR_JACOBIAN + 3 * LANES
# Sensors that `observe` and `linearise` predict.
_PREDICTED = "accelerometer", "dvl", "magnetic_field"


def refuse_unknown(names: Iterable[str]) -> None:
    """Raise a TypeError if a nonlinear sensor has no compiled prediction."""
    if unknown := sorted({*names} - {*_PREDICTED}):
        raise TypeError(f"no compiled code predicts {', '.join(unknown)}")


class _Workspace(NamedTuple):
    """Scratch arrays of `measure_forces` and `linearise_force`."""

    slope: Array  # shape (N_SLOPE,); time derivative of the motion
    coefficient_block: Array  # shape (N_COEFFICIENT_BLOCK + terms * LANES,)
    block: Array  # shape (N_BLOCK,); one state in the first lane
    coefficients: Array  # shape (N_FACTORS + terms,)
    jacobian: Array  # shape (9, N_COLUMNS + terms); see `motion_jacobian`
    for_jacobian: Array  # shape (N_JACOBIAN_WORK,)
    force: Array  # shape (3 * LANES,); specific force, without bias


@compiled(inline=True)
def _workspace(scratch, terms):
    lanes = _FORCE + N_COEFFICIENT_BLOCK + terms * LANES
    single = lanes + N_FACTORS + terms
    return _Workspace(
        slope=scratch[:_SLOPE],
        coefficient_block=scratch[_FORCE:lanes],
        block=scratch[_SLOPE:_BLOCK],
        coefficients=scratch[lanes:single],
        jacobian=scratch[single : single + N_MOTION * (N_COLUMNS + terms)].reshape(N_MOTION, N_COLUMNS + terms),
        for_jacobian=scratch[_BLOCK:_FOR_JACOBIAN],
        force=scratch[_FOR_JACOBIAN:_FORCE],
    )


@compiled()
def _specific_force(motion, slope, constants, n_lanes, force):
    """Fill in the specific force, m/s^2, of a block of motions, without bias."""
    x, y, z = known_vector(constants, ACCELEROMETER)
    for k in range(n_lanes):
        u, v, w = motion[k], motion[LANES + k], motion[2 * LANES + k]
        p, q, r = motion[3 * LANES + k], motion[4 * LANES + k], motion[5 * LANES + k]
        p_dot, q_dot, r_dot = slope[3 * LANES + k], slope[4 * LANES + k], slope[5 * LANES + k]
        sin_phi, cos_phi = sine_cosine(motion[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(motion[7 * LANES + k])
        along, square = p * x + q * y + r * z, p * p + q * q + r * r
        at_x = slope[k] + q * w - r * v + q_dot * z - r_dot * y + p * along - x * square
        at_y = slope[LANES + k] + r * u - p * w + r_dot * x - p_dot * z + q * along - y * square
        at_z = slope[2 * LANES + k] + p * v - q * u + p_dot * y - q_dot * x + r * along - z * square
        force[k] = at_x + GRAVITY * sin_theta
        force[LANES + k] = at_y - GRAVITY * cos_theta * sin_phi
        force[2 * LANES + k] = at_z - GRAVITY * cos_theta * cos_phi


@compiled()
def measure_forces(moving, parameters, inputs, constants, selection, n_lanes, predicted, scratch):
    """Predict the specific force, m/s^2, of a block of states under inputs."""
    work = _workspace(scratch, n_terms(constants))
    fill_in_lanes(moving, parameters, constants, selection, n_lanes, work.coefficient_block)
    motion_derivative(moving, work.coefficient_block, inputs, constants, n_lanes, work.slope)
    if is_disturbed(constants):
        push(moving, LANES, constants, n_lanes, 1.0, work.slope, LANES)
    _specific_force(moving, work.slope, constants, n_lanes, predicted)
    scales, biases = (ROW.scale_fx, ROW.scale_fy, ROW.scale_fz), (ROW.bias_fx, ROW.bias_fy, ROW.bias_fz)
    for axis in range(3):
        for k in range(n_lanes):
            gain = 1.0 + value_of(constants, scales[axis], parameters, moving, k)
            bias = value_of(constants, biases[axis], parameters, moving, k)
            predicted[axis * LANES + k] = gain * predicted[axis * LANES + k] + bias


@compiled()
def linearise_force(mean, inputs, constants, selection, predicted, matrix, scratch):
    """Predict the specific force of one state, shape (3,), m/s^2, and fill in its derivative by the state."""
    work, first = _workspace(scratch, n_terms(constants)), first_moving_row(constants)
    n_columns = N_COLUMNS + n_terms(constants)
    motion, jacobian = mean[first : first + N_MOTION], work.jacobian
    fill_in_all(mean, constants, selection, work.coefficients)
    for m in range(n_columns - N_MOTION):
        work.coefficient_block[m * LANES] = work.coefficients[m]
    for i in range(N_MOTION):
        work.block[i * LANES] = motion[i]
    motion_derivative(work.block, work.coefficient_block, inputs, constants, 1, work.slope)
    if is_disturbed(constants):
        push(mean[first:], 1, constants, 1, 1.0, work.slope, LANES)
    _specific_force(work.block, work.slope, constants, 1, work.force)
    motion_jacobian(motion, work.coefficients, inputs, constants, jacobian, jacobian, N_COLUMNS, work.for_jacobian)

    scales, biases = (ROW.scale_fx, ROW.scale_fy, ROW.scale_fz), (ROW.bias_fx, ROW.bias_fy, ROW.bias_fz)
    arm = known_vector(constants, ACCELEROMETER)
    sin_phi, cos_phi = sine_cosine(motion[6])
    sin_theta, cos_theta = sine_cosine(motion[7])
    up = (sin_theta, -cos_theta * sin_phi, -cos_theta * cos_phi)
    by_roll = (0.0, up[2], -up[1])
    by_pitch = (cos_theta, sin_theta * sin_phi, sin_theta * cos_phi)
    along = motion[3] * arm[0] + motion[4] * arm[1] + motion[5] * arm[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        row = jacobian[i]
        for column in range(n_columns):
            row[column] += jacobian[3 + j, column] * arm[k] - jacobian[3 + k, column] * arm[j]
        # The products omega x nu1 and omega (omega . l) - l omega^2.
        row[k] += motion[3 + j]
        row[j] -= motion[3 + k]
        row[3 + j] += motion[k]
        row[3 + k] -= motion[j]
        row[3 + i] += along
        for axis in range(3):
            row[3 + axis] += motion[3 + i] * arm[axis] - 2.0 * arm[i] * motion[3 + axis]
        row[6] += GRAVITY * by_roll[i]
        row[7] += GRAVITY * by_pitch[i]
        scale, bias = row_of(constants, scales[i]), row_of(constants, biases[i])
        gain = 1.0 + mean[scale] if scale >= 0 else 1.0
        for column in range(n_columns):
            row[column] *= gain
        fill_in_row(row, constants, selection, matrix[i])
        if is_disturbed(constants):
            fill_in_specific_force(constants, arm, i, gain, matrix[i])
        predicted[i] = gain * work.force[i * LANES]
        if scale >= 0:
            matrix[i, scale] = work.force[i * LANES]
        if bias >= 0:
            matrix[i, bias] = 1.0
            predicted[i] += mean[bias]


@compiled()
def measure_velocities(moving, parameters, constants, n_lanes, predicted):
    """Predict the velocity that a DVL measures, m/s, for a block of states."""
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


@compiled()
def _value(constants, mean, which):
    row = row_of(constants, which)
    return mean[row] if row >= 0 else 0.0


@compiled()
def _put(matrix, column, gain, yaw, vector):
    """Fill in a column of the derivative: a vector in body axes, rotated to the axes of the DVL, times its gain."""
    if column >= 0:
        sine, cosine = sine_cosine(yaw)
        matrix[0, column] = gain * (cosine * vector[0] + sine * vector[1])
        matrix[1, column] = gain * (cosine * vector[1] - sine * vector[0])
        matrix[2, column] = gain * vector[2]


@compiled()
def linearise_velocity(mean, constants, predicted, matrix):
    """Predict the velocity that a DVL measures of one state, shape (3,), m/s, and fill in its derivative."""
    first = first_moving_row(constants)
    scale_row, yaw_row = row_of(constants, ROW.dvl_scale), row_of(constants, ROW.dvl_yaw)
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

    # Derivatives of omega x l by the rates and by the arm.
    for column, by in (
        (first + 3, (0.0, -z, y)),
        (first + 4, (z, 0.0, -x)),
        (first + 5, (-y, x, 0.0)),
        (row_of(constants, ROW.dvl_x), (0.0, r, -q)),
        (row_of(constants, ROW.dvl_y), (-r, 0.0, p)),
        (row_of(constants, ROW.dvl_z), (q, -p, 0.0)),
    ):
        _put(matrix, column, gain, yaw, by)
    # Derivatives by the current and by the heading: a horizontal vector (f, s) along and across the heading.
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
    # The derivative by the mounting angle is the velocity rotated by a quarter turn.
    _put(matrix, yaw_row, gain, yaw, (v, -u, 0.0))
    _put(matrix, scale_row, 1.0, yaw, (u, v, w))
    sine, cosine = sine_cosine(yaw)
    predicted[0], predicted[1], predicted[2] = gain * (cosine * u + sine * v), gain * (cosine * v - sine * u), gain * w


@compiled()
def measure_field(moving, parameters, constants, n_lanes, predicted):
    """Predict the magnetic field in body axes, T, for a block of states."""
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


@compiled()
def linearise_field(mean, constants, predicted, matrix):
    """Predict the magnetic field of one state, shape (3,), T, and fill in its derivative."""
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
    # By yaw: d(ahead) = aside, d(aside) = -ahead.
    steep_by_yaw = sin_theta * aside
    by_yaw = cos_theta * aside, sin_phi * steep_by_yaw - cos_phi * ahead, cos_phi * steep_by_yaw + sin_phi * ahead
    for axis in range(3):
        matrix[axis, first + 6] = by_roll[axis]
        matrix[axis, first + 7] = by_pitch[axis]
        matrix[axis, first + 8] = by_yaw[axis]
        bias = row_of(constants, biases[axis])
        if bias >= 0:
            matrix[axis, bias] = 1.0
            predicted[axis] += mean[bias]


@compiled(OBSERVATION_SIGNATURE)
def observe(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch):
    """Predict the measurement of a nonlinear sensor for a block of states."""
    if sensor == known_sensor(constants, ACCELEROMETER):
        measure_forces(moving, parameters, inputs, constants, selection, n_lanes, predicted, scratch)
    elif sensor == known_sensor(constants, MAGNETOMETER):
        measure_field(moving, parameters, constants, n_lanes, predicted)
    else:
        measure_velocities(moving, parameters, constants, n_lanes, predicted)


@compiled(LINEARISATION_SIGNATURE)
def linearise(mean, sensor, inputs, constants, selection, predicted, matrix, scratch):
    """Predict the measurement of a nonlinear sensor for one state, and its derivative by the state."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0
    if sensor == known_sensor(constants, ACCELEROMETER):
        linearise_force(mean, inputs, constants, selection, predicted, matrix, scratch)
    elif sensor == known_sensor(constants, MAGNETOMETER):
        linearise_field(mean, constants, predicted, matrix)
    else:
        linearise_velocity(mean, constants, predicted, matrix)
