"""The vehicle as a filter's process: coefficients as parameters, motion as moving states."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import PROCESS_SIGNATURE, TRANSITION_SIGNATURE, Process
from auvid_cli.identification.compiled_layout import (
    HELD,
    ROW_DEPTH,
    ROW_THRUST,
    SCALE,
    depth_is_state,
    first_moving_row,
    model_constants,
    row_of,
    value_of,
)
from auvid_cli.identification.observation import linearised, observe
from auvid_cli.identification.state_layout import StateLayout
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS
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


@compiled(types.void(_vector, types.int64, types.uint64, types.float64), internal=True)
def _sink(moving, place, n_lanes, duration):
    """Move the depth on at the present rate: a half step before and one after the motion are the trapezoidal rule.

    The depth is the moving state at `place`.
    """
    for k in range(n_lanes):
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        across = sin_phi * moving[LANES + k] + cos_phi * moving[2 * LANES + k]
        moving[place * LANES + k] += duration * (cos_theta * across - sin_theta * moving[k])


@compiled(PROCESS_SIGNATURE)
def _advance(motion, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    coefficients, work = scratch[:N_COEFFICIENT_BLOCK], scratch[N_COEFFICIENT_BLOCK:]
    j = 0
    for m in range(N_COEFFICIENTS):
        row = coefficients[m * LANES : (m + 1) * LANES]
        if j < selection.size and selection[j] == m:
            scale, scaled = constants[SCALE + j], parameters[j * LANES : (j + 1) * LANES]
            for k in range(LANES):
                row[k] = scale * scaled[k]
            j += 1
        else:
            for k in range(LANES):
                row[k] = constants[HELD + m]
    thrust = coefficients[N_COEFFICIENTS * LANES :]
    for k in range(LANES):
        thrust[k] = 1.0
    if row_of(constants, ROW_THRUST) >= 0:
        for k in range(n_lanes):
            thrust[k] += value_of(constants, ROW_THRUST, parameters, motion, k)
    depth = row_of(constants, ROW_DEPTH) - first_moving_row(constants)
    if depth_is_state(constants):
        _sink(motion, depth, n_lanes, 0.5 * duration)
    runge_kutta_step(motion, coefficients, inputs, constants[:N_CONSTANTS], n_lanes, duration, work)
    if depth_is_state(constants):
        _sink(motion, depth, n_lanes, 0.5 * duration)


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def _all_coefficients(mean, constants, selection, coefficients):
    for m in range(N_COEFFICIENTS):
        coefficients[m] = constants[HELD + m]
    for j in range(selection.size):
        coefficients[selection[j]] = constants[SCALE + j] * mean[j]
    row = row_of(constants, ROW_THRUST)
    coefficients[N_COEFFICIENTS] = 1.0 + mean[row] if row >= 0 else 1.0


@compiled(types.void(_vector, _vector, _indices, _vector), internal=True)
def _fill_in_row(sensitivity, constants, selection, row):
    n_coefficients, n_parameters = selection.size, first_moving_row(constants)
    for j in range(n_coefficients):
        row[j] = sensitivity[N_MOTION + selection[j]] * constants[SCALE + j]
    for j in range(N_MOTION):
        row[n_parameters + j] = sensitivity[j]
    thrust = row_of(constants, ROW_THRUST)
    if thrust >= 0:
        row[thrust] = sensitivity[N_MOTION + N_COEFFICIENTS]


@compiled(types.void(_matrix, _vector, _indices, _matrix), internal=True)
def _fill_in(sensitivity, constants, selection, matrix):
    """Sensitivities to motion and to all factors, to the moving rows of a transition matrix."""
    for i in range(N_MOTION):
        _fill_in_row(sensitivity[i], constants, selection, matrix[first_moving_row(constants) + i])


@compiled(types.void(_matrix, _vector), internal=True)
def _before_moving(sensitivity, sinking):
    """The motion depends on itself alone, and the depth has not changed."""
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            sensitivity[i, j] = 1.0 if i == j else 0.0
    for j in range(sinking.size):
        sinking[j] = 0.0


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


# Where in the scratch of a transition all coefficients, the sensitivities of motion and depth, and the rest stand.
_SENSITIVITY = N_FACTORS
_SINKING = _SENSITIVITY + N_MOTION * N_COLUMNS
_REST = _SINKING + N_COLUMNS + 1
# And in the rest of a first-order one, motion and depth, the coefficients, and the work of a step.
_BLOCK = N_BLOCK + LANES
_STEP = _BLOCK + N_COEFFICIENT_BLOCK


@compiled(TRANSITION_SIGNATURE)
def _exact_transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """The variational equation along the integration."""
    first = first_moving_row(constants)
    depth, motion = row_of(constants, ROW_DEPTH), mean[first:][:N_MOTION]
    coefficients, sinking, work = scratch[:N_FACTORS], scratch[_SINKING:_REST], scratch[_REST:]
    sensitivity = scratch[_SENSITIVITY:_SINKING].reshape(N_MOTION, N_COLUMNS)
    _all_coefficients(mean, constants, selection, coefficients)
    _before_moving(sensitivity, sinking)
    for substep in range(substep_duration.size):
        held, duration = inputs[substep_input[substep]], substep_duration[substep]
        if depth_is_state(constants):
            _sink_rate(motion, sensitivity, 0.5 * duration, sinking)
        transition_step(motion, coefficients, held, constants[:N_CONSTANTS], duration, sensitivity, work)
        if depth_is_state(constants):
            _sink_rate(motion, sensitivity, 0.5 * duration, sinking)
    _fill_in(sensitivity, constants, selection, matrix)
    if depth_is_state(constants):
        mean[depth] += sinking[N_COLUMNS]
        _fill_in_row(sinking, constants, selection, matrix[depth])


@compiled(TRANSITION_SIGNATURE)
def first_order_transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """The paper's I + A dt, Table A1: linearised once, where the interval begins."""
    first = first_moving_row(constants)
    depth, motion = row_of(constants, ROW_DEPTH), mean[first:][:N_MOTION]
    coefficients, sinking, work = scratch[:N_FACTORS], scratch[_SINKING:_REST], scratch[_REST:]
    sensitivity = scratch[_SENSITIVITY:_SINKING].reshape(N_MOTION, N_COLUMNS)
    vehicle, elapsed = constants[:N_CONSTANTS], 0.0
    _all_coefficients(mean, constants, selection, coefficients)
    for substep in range(substep_duration.size):
        elapsed += substep_duration[substep]
    if depth_is_state(constants):
        _before_moving(sensitivity, sinking)
        _sink_rate(motion, sensitivity, elapsed, sinking)
        _fill_in_row(sinking, constants, selection, matrix[depth])
    motion_jacobian(motion, coefficients, inputs[substep_input[0]], vehicle, sensitivity, work)
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
    for substep in range(substep_duration.size):
        held, duration = inputs[substep_input[substep]], substep_duration[substep]
        if depth_is_state(constants):
            _sink(block, N_MOTION, 1, 0.5 * duration)
        runge_kutta_step(block, coefficient_block, held, vehicle, 1, duration, work)
        if depth_is_state(constants):
            _sink(block, N_MOTION, 1, 0.5 * duration)
    for i in range(N_MOTION):
        motion[i] = block[i * LANES]
    if depth_is_state(constants):
        mean[depth] += block[N_MOTION * LANES]


def vehicle_process(vehicle: Array, held: Mapping[str, float], layout: StateLayout) -> Process:
    """The augmented model of Sabet et al. 2018, eq. (10), with coefficients in units of their scales, and errors.

    Parameters
    ----------
    vehicle : ndarray
        From `vehicle_constants`.
    held : mapping
        Values, SI, of the coefficients that are not states.
    layout : StateLayout

    Notes
    -----
    Its transition is exact; `first_order_transition` may take its place.
    """
    constants = model_constants(vehicle, np.array([held.get(symbol, 0.0) for symbol in SYMBOLS]), layout)
    estimated = layout.symbols[layout.rows_of("coefficients")]
    return Process(
        advance=_advance,
        transition=_exact_transition,
        constants=constants,
        selection=np.array([SYMBOLS.index(symbol) for symbol in estimated], dtype=np.int64),
        noise_density=layout.noise_density,
        # The larger need of the two: a transition's, which has room for the block and work of `advance` as well.
        scratch_size=_REST + max(N_TRANSITION_WORK, _STEP + N_WORK),
        observe=observe,
        linearise=partial(linearised, constants),
    )
