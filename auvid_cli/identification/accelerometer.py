"""What an accelerometer measures: the acceleration of where it sits, less gravity, in the axes of the vehicle.

``(1 + scale) (nu1' + omega x nu1 + omega' x l + omega x (omega x l) - R(phi, theta, psi)' g) + bias``, axis by axis,
with the lever arm l. The accelerations are those of the model, so that the forces on the hull are measured, and through
them the coefficients.
"""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.identification.compiled_coefficients import fill_in_all, fill_in_lanes, fill_in_row
from auvid_cli.identification.compiled_layout import (
    ACCELEROMETER,
    ROW,
    first_moving_row,
    is_disturbed,
    known_vector,
    row_of,
    value_of,
)
from auvid_cli.identification.disturbance import fill_in_specific_force, push
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_FACTORS,
    N_SLOPE,
    motion_derivative,
    n_terms,
    sine_cosine,
)
from auvid_cli.vehicle.kinematics import GRAVITY
from auvid_cli.vehicle.parameters import N_MOTION
from auvid_cli.vehicle.sensitivity import N_COLUMNS, N_JACOBIAN_WORK, motion_jacobian

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]


class _Workspace(NamedTuple):
    """Arrays that hold nothing from one use to the next.

    Attributes
    ----------
    slope : ndarray, shape (N_SLOPE,)
        Time derivative of the motion.
    coefficient_block : ndarray, shape (N_COEFFICIENT_BLOCK + terms * LANES,)
    block : ndarray, shape (N_BLOCK,)
        One state in the first lane.
    coefficients : ndarray, shape (N_FACTORS + terms,)
    jacobian : ndarray, shape (9, N_COLUMNS + terms)
        See `motion_jacobian`.
    for_jacobian : ndarray, shape (N_JACOBIAN_WORK,)
    force : ndarray, shape (3 * LANES,)
        Specific force, without bias.
    """

    slope: Array
    coefficient_block: Array
    block: Array
    coefficients: Array
    jacobian: Array
    for_jacobian: Array
    force: Array


# Where those of them end that are as long whatever terms a vehicle has.
_SLOPE, _BLOCK, _FOR_JACOBIAN, _FORCE = (
    N_SLOPE,
    N_SLOPE + N_BLOCK,
    N_SLOPE + N_BLOCK + N_JACOBIAN_WORK,
    N_SLOPE + N_BLOCK + N_JACOBIAN_WORK + 3 * LANES,
)


def accelerometer_work(terms: int) -> int:
    """Return the length of the scratch that is handed over."""
    return _FORCE + N_COEFFICIENT_BLOCK + terms * LANES + N_FACTORS + terms + N_MOTION * (N_COLUMNS + terms)


@compiled(types.NamedTuple((*[_vector] * 4, _matrix, *[_vector] * 2), _Workspace)(_vector, types.int64), inline=True)
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


@compiled(types.void(_vector, _vector, _vector, types.uint64, _vector), internal=True)
def _specific_force(motion, slope, constants, n_lanes, force):
    """Fill in the specific force of a block of motions, without bias."""
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


@compiled(types.void(*[_vector] * 4, _indices, types.uint64, _vector, _vector), internal=True)
def measure_forces(moving, parameters, inputs, constants, selection, n_lanes, predicted, scratch):
    """Predict what it says of a block of states under inputs; `scratch` has `accelerometer_work`."""
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


@compiled(types.void(_vector, _vector, _vector, _indices, _vector, _matrix, _vector), internal=True)
def linearise_force(mean, inputs, constants, selection, predicted, matrix, scratch):
    """Predict what it says of one state, shape (3,), and the derivative by the state, whose other columns stay."""
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
