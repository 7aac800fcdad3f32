"""The vehicle as a filter's process: coefficients as parameters, motion as moving states."""

from collections.abc import Sequence

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.blocks import LANES
from auvid_cli.compilation import compiled
from auvid_cli.config.experiment import ProcessNoise
from auvid_cli.filters.problem import OBSERVATION_SIGNATURE, PROCESS_SIGNATURE, TRANSITION_SIGNATURE, Process
from auvid_cli.identification.biases import DVL_ERRORS, SensorError, constant_errors, walking_errors
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.dynamics import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_CONSTANTS,
    N_WORK,
    runge_kutta_step,
    sine_cosine,
)
from auvid_cli.vehicle.parameters import N_MOTION
from auvid_cli.vehicle.sensitivity import N_COLUMNS, N_TRANSITION_WORK, motion_jacobian, transition_step

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]

# Layout of `constants`: the vehicle, the 22 held values, one scale for each estimated coefficient; last, how many
# parameters there are, and in which rows of the state the DVL's scale error and mounting yaw stand.
_HELD = N_CONSTANTS
_SCALE = N_CONSTANTS + N_COEFFICIENTS
_NOWHERE = -1.0


@compiled(PROCESS_SIGNATURE)
def _advance(motion, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    coefficients, work = scratch[:N_COEFFICIENT_BLOCK], scratch[N_COEFFICIENT_BLOCK:]
    j = 0
    for m in range(N_COEFFICIENTS):
        row = coefficients[m * LANES : (m + 1) * LANES]
        if j < selection.size and selection[j] == m:
            scale, scaled = constants[_SCALE + j], parameters[j * LANES : (j + 1) * LANES]
            for k in range(LANES):
                row[k] = scale * scaled[k]
            j += 1
        else:
            for k in range(LANES):
                row[k] = constants[_HELD + m]
    runge_kutta_step(motion, coefficients, inputs, constants[:N_CONSTANTS], n_lanes, duration, work)


@compiled(types.int64(_vector), internal=True)
def _first_motion_row(constants):
    return int(constants[constants.size - 3])


@compiled(OBSERVATION_SIGNATURE)
def _observe(moving, parameters, sensor, constants, selection, n_lanes, seen):
    """What a DVL with a scale error, mounted at a small yaw, sees: ``(1 + scale) Rz(yaw)' [u v w]``."""
    n_parameters = _first_motion_row(constants)
    scale, yaw = int(constants[constants.size - 2]), int(constants[constants.size - 1])
    scales = parameters[scale * LANES :] if scale < n_parameters else moving[(scale - n_parameters) * LANES :]
    yaws = parameters[yaw * LANES :] if yaw < n_parameters else moving[(yaw - n_parameters) * LANES :]
    for k in range(n_lanes):
        u, v, w = moving[k], moving[LANES + k], moving[2 * LANES + k]
        sin_yaw, cos_yaw = sine_cosine(yaws[k])
        gain = 1.0 + scales[k]
        seen[k] = gain * (cos_yaw * u + sin_yaw * v)
        seen[LANES + k] = gain * (cos_yaw * v - sin_yaw * u)
        seen[2 * LANES + k] = gain * w


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def _all_coefficients(mean, constants, selection, coefficients):
    for m in range(N_COEFFICIENTS):
        coefficients[m] = constants[_HELD + m]
    for j in range(selection.size):
        coefficients[selection[j]] = constants[_SCALE + j] * mean[j]


@compiled(types.void(_matrix, _vector, _indices, _matrix), internal=True)
def _fill_in(sensitivity, constants, selection, matrix):
    """Sensitivities to motion and to all 22 coefficients, to the moving rows of a transition matrix."""
    n_coefficients, n_parameters = selection.size, _first_motion_row(constants)
    for i in range(N_MOTION):
        row = matrix[n_parameters + i]
        for j in range(n_coefficients):
            row[j] = sensitivity[i, N_MOTION + selection[j]] * constants[_SCALE + j]
        for j in range(N_MOTION):
            row[n_parameters + j] = sensitivity[i, j]


# Where in the scratch of a transition all coefficients, the sensitivities and the rest of it stand.
_SENSITIVITY = N_COEFFICIENTS
_REST = N_COEFFICIENTS + N_MOTION * N_COLUMNS


@compiled(TRANSITION_SIGNATURE)
def _exact_transition(mean, inputs, piece_input, piece_duration, constants, selection, matrix, scratch):
    """The variational equation along the integration."""
    motion = mean[_first_motion_row(constants) :][:N_MOTION]
    coefficients, work = scratch[:N_COEFFICIENTS], scratch[_REST:]
    sensitivity = scratch[_SENSITIVITY:_REST].reshape(N_MOTION, N_COLUMNS)
    _all_coefficients(mean, constants, selection, coefficients)
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            sensitivity[i, j] = 1.0 if i == j else 0.0
    for piece in range(piece_duration.size):
        held = inputs[piece_input[piece]]
        transition_step(motion, coefficients, held, constants[:N_CONSTANTS], piece_duration[piece], sensitivity, work)
    _fill_in(sensitivity, constants, selection, matrix)


@compiled(TRANSITION_SIGNATURE)
def first_order_transition(mean, inputs, piece_input, piece_duration, constants, selection, matrix, scratch):
    """The paper's I + A dt, Table A1: linearised once, where the interval begins."""
    motion = mean[_first_motion_row(constants) :][:N_MOTION]
    coefficients, work = scratch[:N_COEFFICIENTS], scratch[_REST:]
    sensitivity = scratch[_SENSITIVITY:_REST].reshape(N_MOTION, N_COLUMNS)
    vehicle, elapsed = constants[:N_CONSTANTS], 0.0
    _all_coefficients(mean, constants, selection, coefficients)
    motion_jacobian(motion, coefficients, inputs[piece_input[0]], vehicle, sensitivity, work)
    for piece in range(piece_duration.size):
        elapsed += piece_duration[piece]
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            sensitivity[i, j] = elapsed * sensitivity[i, j] + (1.0 if i == j else 0.0)
    _fill_in(sensitivity, constants, selection, matrix)
    block, coefficient_block, work = work[:N_BLOCK], work[N_BLOCK:], work[N_BLOCK + N_COEFFICIENT_BLOCK :]
    for i in range(N_MOTION):
        block[i * LANES] = motion[i]
    for m in range(N_COEFFICIENTS):
        coefficient_block[m * LANES] = coefficients[m]
    for piece in range(piece_duration.size):
        held = inputs[piece_input[piece]]
        runge_kutta_step(block, coefficient_block, held, vehicle, 1, piece_duration[piece], work)
    for i in range(N_MOTION):
        motion[i] = block[i * LANES]


def vehicle_process(
    vehicle: Array,
    held: Array,
    selection: NDArray[np.int64],
    scale: Array,
    noise: ProcessNoise,
    errors: Sequence[SensorError] = (),
) -> Process:
    """The augmented model of Sabet et al. 2018, eq. (10), with coefficients in units of `scale`, and sensor errors.

    Parameters
    ----------
    vehicle : ndarray
        From `vehicle_constants`.
    held : ndarray, shape (22,)
        Values of the coefficients that are not estimated.
    selection : ndarray of int, shape (p,)
        Which of the 22 are estimated, in ascending order.
    scale : ndarray, shape (p,)
        Coefficients span 1e-3 to 1e3: a parameter is a coefficient divided by its scale.
    noise : ProcessNoise
    errors : sequence of SensorError
        The state is: coefficients, constant errors, motion, walking errors.

    Notes
    -----
    Its transition is exact; `first_order_transition` may take its place.
    """
    constant, walking = constant_errors(errors), walking_errors(errors)
    n_parameters = selection.size + len(constant)
    order = [*constant, *([None] * N_MOTION), *walking]
    place = {error.symbol: float(selection.size + row) for row, error in enumerate(order) if error is not None}
    dvl = [place.get(symbol, _NOWHERE) for symbol in DVL_ERRORS]
    constants = np.concatenate([vehicle, held, scale, [n_parameters], dvl])

    def linearise(mean: Array, sensor: int) -> tuple[Array, Array]:
        u, v, w = mean[n_parameters : n_parameters + 3]
        rows = [int(row) for row in dvl]
        gain, (sine, cosine) = 1.0 + mean[rows[0]], (np.sin(mean[rows[1]]), np.cos(mean[rows[1]]))
        turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        straight = turn @ [u, v, w]
        matrix = np.zeros((3, mean.size))
        matrix[:, n_parameters : n_parameters + 3] = gain * turn
        matrix[:, rows[0]] = straight
        matrix[:, rows[1]] = gain * np.array([straight[1], -straight[0], 0.0])
        return gain * straight, matrix

    return Process(
        advance=_advance,
        transition=_exact_transition,
        constants=constants,
        selection=selection,
        noise_density=np.concatenate(
            [np.repeat([noise.velocity, noise.rate, noise.attitude], 3), [error.walk for error in walking]]
        ),
        # The larger need of the two: a transition's, which has room for the block and work of `advance` as well.
        scratch_size=_REST + max(N_TRANSITION_WORK, N_BLOCK + N_COEFFICIENT_BLOCK + N_WORK),
        observe=_observe,
        linearise=linearise,
    )
