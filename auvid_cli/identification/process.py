"""The vehicle as a filter's process: coefficients as parameters, motion as moving states."""

from collections.abc import Sequence

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.blocks import LANES
from auvid_cli.compilation import compiled
from auvid_cli.config.experiment import ProcessNoise
from auvid_cli.filters.problem import OBSERVATION_SIGNATURE, PROCESS_SIGNATURE, TRANSITION_SIGNATURE, Process
from auvid_cli.identification.biases import DVL_ERRORS, THRUST_SCALE, SensorError, constant_errors, walking_errors
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.dynamics import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_CONSTANTS,
    N_FACTORS,
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
# parameters there are, whether the depth is a state, behind the motion, and in which rows of the state the DVL's
# scale error and mounting yaw, the current and the thrust's scale error stand.
_HELD = N_CONSTANTS
_SCALE = N_CONSTANTS + N_COEFFICIENTS
_NOWHERE = -1.0
_FIRST_MOTION_ROW, _HAS_DEPTH, _DVL_SCALE, _DVL_YAW, _CURRENT_NORTH, _CURRENT_EAST, _THRUST_SCALE = range(7, 0, -1)


@compiled(types.int64(_vector), internal=True)
def _first_motion_row(constants):
    return int(constants[constants.size - _FIRST_MOTION_ROW])


@compiled(types.boolean(_vector), internal=True)
def _has_depth(constants):
    return constants[constants.size - _HAS_DEPTH] > 0.0


@compiled(types.void(_vector, types.uint64, types.float64), internal=True)
def _sink(moving, n_lanes, duration):
    """Move the depth on at the present rate: a half step before and one after the motion are the trapezoidal rule."""
    for k in range(n_lanes):
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        across = sin_phi * moving[LANES + k] + cos_phi * moving[2 * LANES + k]
        moving[N_MOTION * LANES + k] += duration * (cos_theta * across - sin_theta * moving[k])


@compiled(types.float64(_vector, types.int64, _vector, _vector, types.int64), internal=True)
def _stated(constants, which, parameters, moving, k):
    """One lane of one of the last entries of `constants`, wherever in the state it stands; 0 if nowhere."""
    row, n_parameters = int(constants[constants.size - which]), _first_motion_row(constants)
    if row < 0:
        return 0.0
    return parameters[row * LANES + k] if row < n_parameters else moving[(row - n_parameters) * LANES + k]


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
    thrust = coefficients[N_COEFFICIENTS * LANES :]
    for k in range(LANES):
        thrust[k] = 1.0
    if constants[constants.size - _THRUST_SCALE] >= 0.0:
        for k in range(n_lanes):
            thrust[k] += _stated(constants, _THRUST_SCALE, parameters, motion, k)
    if _has_depth(constants):
        _sink(motion, n_lanes, 0.5 * duration)
    runge_kutta_step(motion, coefficients, inputs, constants[:N_CONSTANTS], n_lanes, duration, work)
    if _has_depth(constants):
        _sink(motion, n_lanes, 0.5 * duration)


@compiled(OBSERVATION_SIGNATURE)
def _observe(moving, parameters, sensor, constants, selection, n_lanes, seen):
    """What a DVL with a scale error, mounted at a small yaw, sees over ground.

    ``(1 + scale) Rz(yaw)' ([u v w] + R(phi, theta, psi)' [current_north current_east 0])``.
    """
    for k in range(n_lanes):
        north = _stated(constants, _CURRENT_NORTH, parameters, moving, k)
        east = _stated(constants, _CURRENT_EAST, parameters, moving, k)
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        sin_psi, cos_psi = sine_cosine(moving[8 * LANES + k])
        ahead, aside = cos_psi * north + sin_psi * east, cos_psi * east - sin_psi * north
        u = moving[k] + cos_theta * ahead
        v = moving[LANES + k] + sin_phi * sin_theta * ahead + cos_phi * aside
        w = moving[2 * LANES + k] + cos_phi * sin_theta * ahead - sin_phi * aside
        sin_yaw, cos_yaw = sine_cosine(_stated(constants, _DVL_YAW, parameters, moving, k))
        gain = 1.0 + _stated(constants, _DVL_SCALE, parameters, moving, k)
        seen[k] = gain * (cos_yaw * u + sin_yaw * v)
        seen[LANES + k] = gain * (cos_yaw * v - sin_yaw * u)
        seen[2 * LANES + k] = gain * w


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def _all_coefficients(mean, constants, selection, coefficients):
    for m in range(N_COEFFICIENTS):
        coefficients[m] = constants[_HELD + m]
    for j in range(selection.size):
        coefficients[selection[j]] = constants[_SCALE + j] * mean[j]
    row = int(constants[constants.size - _THRUST_SCALE])
    coefficients[N_COEFFICIENTS] = 1.0 + mean[row] if row >= 0 else 1.0


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def _fill_in_row(sensitivity, constants, selection, row):
    n_coefficients, n_parameters = selection.size, _first_motion_row(constants)
    for j in range(n_coefficients):
        row[j] = sensitivity[N_MOTION + selection[j]] * constants[_SCALE + j]
    for j in range(N_MOTION):
        row[n_parameters + j] = sensitivity[j]
    thrust = int(constants[constants.size - _THRUST_SCALE])
    if thrust >= 0:
        row[thrust] = sensitivity[N_MOTION + N_COEFFICIENTS]


@compiled(types.void(_matrix, _vector, _indices, _matrix), internal=True)
def _fill_in(sensitivity, constants, selection, matrix):
    """Sensitivities to motion and to all factors, to the moving rows of a transition matrix."""
    for i in range(N_MOTION):
        _fill_in_row(sensitivity[i], constants, selection, matrix[_first_motion_row(constants) + i])


@compiled(types.void(_vector, _matrix, types.float64, _vector), internal=True)
def _sink_rate(motion, sensitivity, duration, sinking):
    """Add the derivative of the present vertical velocity, for so long, and in the last place the velocity itself."""
    u, v, w = motion[0], motion[1], motion[2]
    sin_phi, cos_phi = sine_cosine(motion[6])
    sin_theta, cos_theta = sine_cosine(motion[7])
    across, along = sin_phi * v + cos_phi * w, cos_phi * v - sin_phi * w
    for j in range(N_COLUMNS):
        turning = cos_theta * along * sensitivity[6, j] - (sin_theta * across + cos_theta * u) * sensitivity[7, j]
        moving = cos_theta * (sin_phi * sensitivity[1, j] + cos_phi * sensitivity[2, j])
        sinking[j] += duration * (turning + moving - sin_theta * sensitivity[0, j])
    sinking[N_COLUMNS] += duration * (cos_theta * across - sin_theta * u)


@compiled(types.void(_vector, _vector, _vector, _indices, _matrix), internal=True)
def _fill_in_depth(sinking, mean, constants, selection, matrix):
    """What was added up, to the depth and to its row of a transition matrix."""
    depth = _first_motion_row(constants) + N_MOTION
    mean[depth] += sinking[N_COLUMNS]
    _fill_in_row(sinking, constants, selection, matrix[depth])


# Where in the scratch of a transition all coefficients, the sensitivities of motion and depth, and the rest stand.
_SENSITIVITY = N_FACTORS
_SINKING = _SENSITIVITY + N_MOTION * N_COLUMNS
_REST = _SINKING + N_COLUMNS + 1
# And in the rest of a first-order one, motion and depth, the coefficients, and the work of a step.
_BLOCK = N_BLOCK + LANES
_STEP = _BLOCK + N_COEFFICIENT_BLOCK


@compiled(TRANSITION_SIGNATURE)
def _exact_transition(mean, inputs, piece_input, piece_duration, constants, selection, matrix, scratch):
    """The variational equation along the integration."""
    motion = mean[_first_motion_row(constants) :][:N_MOTION]
    coefficients, sinking, work = scratch[:N_FACTORS], scratch[_SINKING:_REST], scratch[_REST:]
    sensitivity = scratch[_SENSITIVITY:_SINKING].reshape(N_MOTION, N_COLUMNS)
    _all_coefficients(mean, constants, selection, coefficients)
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            sensitivity[i, j] = 1.0 if i == j else 0.0
    for j in range(sinking.size):
        sinking[j] = 0.0
    for piece in range(piece_duration.size):
        held, duration = inputs[piece_input[piece]], piece_duration[piece]
        if _has_depth(constants):
            _sink_rate(motion, sensitivity, 0.5 * duration, sinking)
        transition_step(motion, coefficients, held, constants[:N_CONSTANTS], duration, sensitivity, work)
        if _has_depth(constants):
            _sink_rate(motion, sensitivity, 0.5 * duration, sinking)
    _fill_in(sensitivity, constants, selection, matrix)
    if _has_depth(constants):
        _fill_in_depth(sinking, mean, constants, selection, matrix)


@compiled(TRANSITION_SIGNATURE)
def first_order_transition(mean, inputs, piece_input, piece_duration, constants, selection, matrix, scratch):
    """The paper's I + A dt, Table A1: linearised once, where the interval begins."""
    motion = mean[_first_motion_row(constants) :][:N_MOTION]
    coefficients, sinking, work = scratch[:N_FACTORS], scratch[_SINKING:_REST], scratch[_REST:]
    sensitivity = scratch[_SENSITIVITY:_SINKING].reshape(N_MOTION, N_COLUMNS)
    vehicle, elapsed = constants[:N_CONSTANTS], 0.0
    _all_coefficients(mean, constants, selection, coefficients)
    for piece in range(piece_duration.size):
        elapsed += piece_duration[piece]
    if _has_depth(constants):
        for i in range(N_MOTION):
            for j in range(N_COLUMNS):
                sensitivity[i, j] = 1.0 if i == j else 0.0
        for j in range(sinking.size):
            sinking[j] = 0.0
        _sink_rate(motion, sensitivity, elapsed, sinking)
        sinking[N_COLUMNS] = 0.0
        _fill_in_depth(sinking, mean, constants, selection, matrix)
    motion_jacobian(motion, coefficients, inputs[piece_input[0]], vehicle, sensitivity, work)
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            sensitivity[i, j] = elapsed * sensitivity[i, j] + (1.0 if i == j else 0.0)
    _fill_in(sensitivity, constants, selection, matrix)
    block, coefficient_block, work = work[:_BLOCK], work[_BLOCK:_STEP], work[_STEP:]
    for i in range(N_MOTION):
        block[i * LANES] = motion[i]
    block[N_MOTION * LANES] = 0.0
    for m in range(N_FACTORS):
        coefficient_block[m * LANES] = coefficients[m]
    for piece in range(piece_duration.size):
        held, duration = inputs[piece_input[piece]], piece_duration[piece]
        _sink(block, 1, 0.5 * duration)
        runge_kutta_step(block, coefficient_block, held, vehicle, 1, duration, work)
        _sink(block, 1, 0.5 * duration)
    for i in range(N_MOTION):
        motion[i] = block[i * LANES]
    if _has_depth(constants):
        mean[_first_motion_row(constants) + N_MOTION] += block[N_MOTION * LANES]


def vehicle_process(
    vehicle: Array,
    held: Array,
    selection: NDArray[np.int64],
    scale: Array,
    noise: ProcessNoise,
    errors: Sequence[SensorError] = (),
    has_depth: bool = False,
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
        The state is: coefficients, constant errors, motion, depth, walking errors.
    has_depth : bool
        Whether the depth is a state.

    Notes
    -----
    Its transition is exact; `first_order_transition` may take its place.
    """
    constant, walking = constant_errors(errors), walking_errors(errors)
    n_parameters = selection.size + len(constant)
    order = [*constant, *([None] * (N_MOTION + has_depth)), *walking]
    place = {error.symbol: float(selection.size + row) for row, error in enumerate(order) if error is not None}
    dvl = [place.get(symbol, _NOWHERE) for symbol in DVL_ERRORS]
    thrust = place.get(THRUST_SCALE, _NOWHERE)
    constants = np.concatenate([vehicle, held, scale, [n_parameters, has_depth, *dvl, thrust]])

    def linearise(mean: Array, sensor: int) -> tuple[Array, Array]:
        motion = mean[n_parameters : n_parameters + N_MOTION]
        scale, yaw, north, east = (mean[int(row)] if row >= 0.0 else 0.0 for row in dvl)
        gain, sine, cosine = 1.0 + scale, np.sin(yaw), np.cos(yaw)
        turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        drift, by_attitude, by_current = current_in_body_axes(motion[6:], np.array([north, east]))
        straight = turn @ (motion[:3] + drift)
        matrix = np.zeros((3, mean.size))
        matrix[:, n_parameters : n_parameters + 3] = gain * turn
        matrix[:, n_parameters + 6 : n_parameters + 9] = gain * turn @ by_attitude
        turned = gain * np.array([straight[1], -straight[0], 0.0])
        for row, column in zip(dvl, [straight, turned, *(gain * turn @ by_current).T], strict=True):
            if row >= 0.0:
                matrix[:, int(row)] = column
        return gain * straight, matrix

    return Process(
        advance=_advance,
        transition=_exact_transition,
        constants=constants,
        selection=selection,
        noise_density=np.concatenate(
            [
                np.repeat([noise.velocity, noise.rate, noise.attitude], 3),
                [noise.depth] * has_depth,
                [error.walk for error in walking],
            ]
        ),
        # The larger need of the two: a transition's, which has room for the block and work of `advance` as well.
        scratch_size=_REST + max(N_TRANSITION_WORK, _STEP + N_WORK),
        observe=_observe,
        linearise=linearise,
    )


def current_in_body_axes(attitude: Array, current: Array) -> tuple[Array, Array, Array]:
    """A current along x, y, z, shape (3,), and its derivatives by attitude and by itself, (3, 3) and (3, 2)."""
    (sin_phi, sin_theta, sin_psi), (cos_phi, cos_theta, cos_psi) = np.sin(attitude), np.cos(attitude)
    heading = np.array([[cos_psi, sin_psi], [-sin_psi, cos_psi]])
    ahead, aside = heading @ current
    tilt = np.array([[cos_theta, 0.0], [sin_phi * sin_theta, cos_phi], [cos_phi * sin_theta, -sin_phi]])
    drift = tilt @ [ahead, aside]
    by_roll = np.array([0.0, drift[2], -drift[1]])
    by_pitch = ahead * np.array([-sin_theta, sin_phi * cos_theta, cos_phi * cos_theta])
    by_yaw = tilt @ [aside, -ahead]
    return drift, np.stack([by_roll, by_pitch, by_yaw], axis=1), tilt @ heading
