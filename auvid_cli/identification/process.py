"""The vehicle as a filter's process: coefficients as parameters, motion as moving states."""

import sys
from collections.abc import Mapping
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.config.augmented_states import ERROR_BLOCKS
from auvid_cli.config.moving_states import FURTHER_STATES
from auvid_cli.filters.problem import PROCESS_SIGNATURE, TRANSITION_SIGNATURE, Process
from auvid_cli.identification import accelerometer, compiled_coefficients, dvl, magnetic_field
from auvid_cli.identification.accelerometer import N_ACCELEROMETER_WORK
from auvid_cli.identification.compiled_coefficients import fill_in_all, fill_in_lanes, fill_in_row
from auvid_cli.identification.compiled_layout import (
    NONE_KNOWN,
    ROW,
    KnownSensors,
    check_named,
    depth_is_state,
    first_moving_row,
    is_disturbed,
    model_constants,
    row_of,
)
from auvid_cli.identification.disturbance import (
    N_DISTURBANCE_WORK,
    begin_step,
    derive_at_once,
    end_step,
    fade,
    fill_in_forces,
    push,
    undisturbed,
)
from auvid_cli.identification.observation import linearise, observe
from auvid_cli.identification.sinking import before_moving, sink, sink_rate
from auvid_cli.identification.state_layout import StateLayout
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.dynamics import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_CONSTANTS,
    N_FACTORS,
    N_WORK,
    runge_kutta_step,
)
from auvid_cli.vehicle.parameters import N_MOTION
from auvid_cli.vehicle.sensitivity import N_COLUMNS, N_TRANSITION_WORK, motion_jacobian, transition_step

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]


class _Workspace(NamedTuple):
    """Arrays that hold nothing from one use to the next.

    Attributes
    ----------
    coefficients : ndarray, shape (N_FACTORS,)
        All of them, estimated or held, and the thrust's factor.
    sensitivity : ndarray, shape (9, 9 + N_FACTORS)
        Derivative of the motion by where it started and by the coefficients.
    sinking : ndarray, shape (9 + N_FACTORS + 1,)
        The same of the depth, then how much it has grown.
    block : ndarray, shape (N_BLOCK + LANES,)
        Motion and depth in the first lane of a block.
    coefficient_block : ndarray, shape (N_COEFFICIENT_BLOCK,)
    step : ndarray
        For a Runge-Kutta step, with or without the transition matrix.
    """

    coefficients: Array
    sensitivity: Array
    sinking: Array
    block: Array
    coefficient_block: Array
    step: Array


# Where each of them ends in the scratch that a filter hands over.
_COEFFICIENTS, _SENSITIVITY, _SINKING, _BLOCK, _COEFFICIENT_BLOCK, _N_SCRATCH = accumulate(
    (
        *(N_FACTORS, N_MOTION * N_COLUMNS, N_COLUMNS + 1, N_BLOCK + LANES, N_COEFFICIENT_BLOCK),
        max(N_TRANSITION_WORK, N_WORK, N_ACCELEROMETER_WORK),
    )
)


@compiled(types.NamedTuple((_vector, _matrix, *[_vector] * 4), _Workspace)(_vector), inline=True)
def _workspace(scratch):
    return _Workspace(
        coefficients=scratch[:_COEFFICIENTS],
        sensitivity=scratch[_COEFFICIENTS:_SENSITIVITY].reshape(N_MOTION, N_COLUMNS),
        sinking=scratch[_SENSITIVITY:_SINKING],
        block=scratch[_SINKING:_BLOCK],
        coefficient_block=scratch[_BLOCK:_COEFFICIENT_BLOCK],
        step=scratch[_COEFFICIENT_BLOCK:_N_SCRATCH],
    )


@compiled(PROCESS_SIGNATURE)
def _advance(motion, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    # Not from `_workspace`: with slices that begin at an offset a step of the sigma-point filters is 2 to 4 % longer.
    coefficients, work = scratch[:N_COEFFICIENT_BLOCK], scratch[N_COEFFICIENT_BLOCK:]
    fill_in_lanes(motion, parameters, constants, selection, n_lanes, coefficients)
    depth = row_of(constants, ROW.down) - first_moving_row(constants)
    if depth_is_state(constants):
        sink(motion, depth, n_lanes, 0.5 * duration)
    if is_disturbed(constants):
        push(motion, LANES, constants, n_lanes, 0.5 * duration, motion, LANES)
    runge_kutta_step(motion, coefficients, inputs, constants[:N_CONSTANTS], n_lanes, duration, work)
    if is_disturbed(constants):
        fade(motion, LANES, constants, n_lanes, duration)
        push(motion, LANES, constants, n_lanes, 0.5 * duration, motion, LANES)
    if depth_is_state(constants):
        sink(motion, depth, n_lanes, 0.5 * duration)


@compiled(types.void(_matrix, _vector, _indices, _matrix), internal=True)
def _fill_in(sensitivity, constants, selection, matrix):
    """Copy sensitivities to motion and to all factors to the moving rows of a transition matrix."""
    for i in range(N_MOTION):
        fill_in_row(sensitivity[i], constants, selection, matrix[first_moving_row(constants) + i])


@compiled(TRANSITION_SIGNATURE)
def _exact_transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """Integrate the variational equation along the motion."""
    work, vehicle = _workspace(scratch), constants[:N_CONSTANTS]
    depth, motion = row_of(constants, ROW.down), mean[first_moving_row(constants) :][:N_MOTION]
    fill_in_all(mean, constants, selection, work.coefficients)
    before_moving(work.sensitivity, work.sinking)
    if is_disturbed(constants):
        undisturbed(scratch[_N_SCRATCH:])
    for substep in range(substep_duration.size):
        held, duration = inputs[substep_input[substep]], substep_duration[substep]
        if depth_is_state(constants):
            sink_rate(motion, work.sensitivity, 0.5 * duration, work.sinking)
        if is_disturbed(constants):
            begin_step(mean, work.coefficients, held, constants, duration, scratch[_N_SCRATCH:], work.step)
        transition_step(motion, work.coefficients, held, vehicle, duration, work.sensitivity, work.step)
        if is_disturbed(constants):
            end_step(mean, constants, duration, scratch[_N_SCRATCH:])
        if depth_is_state(constants):
            sink_rate(motion, work.sensitivity, 0.5 * duration, work.sinking)
    _fill_in(work.sensitivity, constants, selection, matrix)
    if depth_is_state(constants):
        mean[depth] += work.sinking[N_COLUMNS]
        fill_in_row(work.sinking, constants, selection, matrix[depth])
    if is_disturbed(constants):
        fill_in_forces(constants, scratch[_N_SCRATCH:], matrix)


@compiled(TRANSITION_SIGNATURE)
def first_order_transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """Linearise once, where the interval begins: the paper's I + A dt, Table A1."""
    work, vehicle = _workspace(scratch), constants[:N_CONSTANTS]
    moving = mean[first_moving_row(constants) :]
    depth, motion = row_of(constants, ROW.down), moving[:N_MOTION]
    sensitivity, block, elapsed = work.sensitivity, work.block, 0.0
    fill_in_all(mean, constants, selection, work.coefficients)
    for substep in range(substep_duration.size):
        elapsed += substep_duration[substep]
    if depth_is_state(constants):
        before_moving(sensitivity, work.sinking)
        sink_rate(motion, sensitivity, elapsed, work.sinking)
        fill_in_row(work.sinking, constants, selection, matrix[depth])
    motion_jacobian(motion, work.coefficients, inputs[substep_input[0]], vehicle, sensitivity, work.step)
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            sensitivity[i, j] = elapsed * sensitivity[i, j] + (1.0 if i == j else 0.0)
    _fill_in(sensitivity, constants, selection, matrix)
    if is_disturbed(constants):
        derive_at_once(constants, elapsed, scratch[_N_SCRATCH:])
        fill_in_forces(constants, scratch[_N_SCRATCH:], matrix)
    for i in range(N_MOTION):
        block[i * LANES] = motion[i]
    block[N_MOTION * LANES] = 0.0
    for m in range(N_FACTORS):
        work.coefficient_block[m * LANES] = work.coefficients[m]
    for substep in range(substep_duration.size):
        held, duration = inputs[substep_input[substep]], substep_duration[substep]
        if depth_is_state(constants):
            sink(block, N_MOTION, 1, 0.5 * duration)
        if is_disturbed(constants):
            push(moving, 1, constants, 1, 0.5 * duration, block, LANES)
        runge_kutta_step(block, work.coefficient_block, held, vehicle, 1, duration, work.step)
        if is_disturbed(constants):
            fade(moving, 1, constants, 1, duration)
            push(moving, 1, constants, 1, 0.5 * duration, block, LANES)
        if depth_is_state(constants):
            sink(block, N_MOTION, 1, 0.5 * duration)
    for i in range(N_MOTION):
        motion[i] = block[i * LANES]
    if depth_is_state(constants):
        mean[depth] += block[N_MOTION * LANES]


def vehicle_process(
    vehicle: Array,
    held: Mapping[str, float],
    layout: StateLayout,
    known: KnownSensors = NONE_KNOWN,
) -> Process:
    """Make the augmented model of Sabet et al. 2018, eq. (10), with coefficients in units of their scales, and errors.

    Parameters
    ----------
    vehicle : ndarray
        From `vehicle_constants`.
    held : mapping
        Values, SI, of the coefficients that are not states.
    layout : StateLayout
    known : KnownSensors
        By default none.

    Notes
    -----
    Its transition is exact; `first_order_transition` may take its place.
    """
    of_symbols = np.array([held.get(symbol, 0.0) for symbol in SYMBOLS])
    estimated = layout.symbols[layout.rows_of("coefficients")]
    return Process(
        advance=_advance,
        transition=_exact_transition,
        constants=model_constants(vehicle, of_symbols, layout, known),
        selection=np.array([SYMBOLS.index(symbol) for symbol in estimated], dtype=np.int64),
        noise_density=layout.noise_density,
        scratch_size=_N_SCRATCH + N_DISTURBANCE_WORK,
        observe=observe,
        linearise=linearise,
    )


# Of errors what comes of them and the derivative; of moving states how they advance, and both transitions.
check_named(
    [quantity.symbol for block in ERROR_BLOCKS if block.is_named for quantity in block.quantities],
    (accelerometer, compiled_coefficients, dvl, magnetic_field),
    by=2,
)
check_named([state.quantity.symbol for state in FURTHER_STATES], (sys.modules[__name__],), by=3)
