"""The compiled process: motion of the augmented state, Sabet et al. 2018, eqs. (10) to (13), and free motion."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import PROCESS_SIGNATURE, TIMELINE, TRANSITION_SIGNATURE, Process
from auvid_cli.identification.compiled_layout import (
    NONE_KNOWN,
    ROW,
    KnownSensors,
    depth_is_state,
    fill_in_all,
    fill_in_lanes,
    fill_in_row,
    first_moving_row,
    is_disturbed,
    model_constants,
    row_of,
)
from auvid_cli.identification.disturbance import (
    derive_at_once,
    disturbance_work,
    disturbed_step,
    driven_by_disturbances,
    fade,
    fill_in_forces,
    push,
    reset_disturbance,
    reset_sensitivity,
    sink,
    sink_rate,
)
from auvid_cli.identification.states import StateLayout
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.vehicle.coefficients import COEFFICIENTS, N_COEFFICIENTS, CoefficientSet
from auvid_cli.vehicle.equations import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_FACTORS,
    N_WORK,
    NO_ERRORS,
    n_terms,
    runge_kutta_step,
)
from auvid_cli.vehicle.jacobian import N_COLUMNS, motion_jacobian, transition_step, transition_work
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH, N_MOTION

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
# End of the block in the scratch. The lengths of the other parts depend on the number of own terms.
_BLOCK = N_BLOCK + LANES
N_PREDICTED = len(MOTION_AND_DEPTH)


class _Workspace(NamedTuple):
    """Scratch arrays of a transition."""

    coefficients: Array  # shape (N_FACTORS + terms,); coefficients, estimated or held, actuator errors and ballast
    # Shape (9, N_COLUMNS + terms); derivative of the motion by the initial motion and by the coefficients
    sensitivity: Array
    depth_derivative: Array  # shape (N_COLUMNS + terms + 1,); derivative of the depth, then its change
    block: Array  # shape (N_BLOCK + LANES,); motion and depth in the first lane
    coefficient_block: Array  # shape (N_COEFFICIENT_BLOCK + terms * LANES,)
    step: Array  # for a Runge-Kutta step, with or without the transition matrix
    disturbance: Array  # of length `disturbance_work`


def _scratch_size(terms: int) -> int:
    # A measurement of the accelerometer needs less, see `auvid_cli.identification.sensors`.
    return _ends(terms)[3] + max(transition_work(terms), N_WORK) + disturbance_work(terms)


@compiled(types.UniTuple(types.int64, 4)(types.int64))
def _ends(terms):
    """Return the ends of coefficients, sensitivity, derivative of the depth and coefficient block in the scratch."""
    columns = N_COLUMNS + terms
    coefficients = _BLOCK + N_FACTORS + terms
    sensitivity = coefficients + N_MOTION * columns
    depth_derivative = sensitivity + columns + 1
    return coefficients, sensitivity, depth_derivative, depth_derivative + N_COEFFICIENT_BLOCK + terms * LANES


@compiled(inline=True)
def _workspace(scratch, terms):
    coefficients, sensitivity, depth_derivative, coefficient_block = _ends(terms)
    disturbance = scratch.size - disturbance_work(terms)
    return _Workspace(
        coefficients=scratch[_BLOCK:coefficients],
        sensitivity=scratch[coefficients:sensitivity].reshape(N_MOTION, N_COLUMNS + terms),
        depth_derivative=scratch[sensitivity:depth_derivative],
        block=scratch[:_BLOCK],
        coefficient_block=scratch[depth_derivative:coefficient_block],
        step=scratch[coefficient_block:disturbance],
        disturbance=scratch[disturbance:],
    )


@compiled(PROCESS_SIGNATURE)
def _advance(motion, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    # Not from `_workspace`: slices that begin at an offset slow the sigma-point filters by 2 to 4 %.
    n = N_COEFFICIENT_BLOCK + n_terms(constants) * LANES
    coefficients, work = scratch[:n], scratch[n:]
    fill_in_lanes(motion, parameters, constants, selection, n_lanes, coefficients)
    depth = row_of(constants, ROW.down) - first_moving_row(constants)
    if depth_is_state(constants):
        sink(motion, depth, n_lanes, 0.5 * duration)
    if is_disturbed(constants):
        push(motion, LANES, constants, n_lanes, 0.5 * duration, motion, LANES)
    runge_kutta_step(motion, coefficients, inputs, constants, n_lanes, duration, work)
    if is_disturbed(constants):
        fade(motion, LANES, constants, n_lanes, duration)
        push(motion, LANES, constants, n_lanes, 0.5 * duration, motion, LANES)
    if depth_is_state(constants):
        sink(motion, depth, n_lanes, 0.5 * duration)


@compiled()
def _fill_in(sensitivity, constants, selection, matrix):
    """Copy sensitivities to motion and to all factors to the moving rows of a transition matrix."""
    for i in range(N_MOTION):
        fill_in_row(sensitivity[i], constants, selection, matrix[first_moving_row(constants) + i])


@compiled(TRANSITION_SIGNATURE)
def _exact_transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """Propagate the mean, and integrate the variational equation along it for the transition matrix."""
    work, n_columns = _workspace(scratch, n_terms(constants)), N_COLUMNS + n_terms(constants)
    depth, motion = row_of(constants, ROW.down), mean[first_moving_row(constants) :][:N_MOTION]
    fill_in_all(mean, constants, selection, work.coefficients)
    reset_sensitivity(work.sensitivity, work.depth_derivative)
    if is_disturbed(constants):
        reset_disturbance(constants, work.disturbance)
    for substep in range(substep_duration.size):
        held, duration = inputs[substep_input[substep]], substep_duration[substep]
        if depth_is_state(constants):
            sink_rate(motion, work.sensitivity, 0.5 * duration, work.depth_derivative)
        step = work.coefficients, held, constants, duration, work.sensitivity
        if is_disturbed(constants):
            disturbed_step(mean, *step, work.disturbance, work.step)
        else:
            transition_step(motion, *step, work.step)
        if depth_is_state(constants):
            sink_rate(motion, work.sensitivity, 0.5 * duration, work.depth_derivative)
    _fill_in(work.sensitivity, constants, selection, matrix)
    if depth_is_state(constants):
        mean[depth] += work.depth_derivative[n_columns]
        fill_in_row(work.depth_derivative, constants, selection, matrix[depth])
    if is_disturbed(constants):
        fill_in_forces(constants, work.disturbance, matrix)


@compiled(TRANSITION_SIGNATURE)
def first_order_transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """Propagate the mean, and linearise once at the start of the interval: I + A dt, Sabet et al. 2018, Table A1."""
    work, n_columns = _workspace(scratch, n_terms(constants)), N_COLUMNS + n_terms(constants)
    moving = mean[first_moving_row(constants) :]
    depth, motion = row_of(constants, ROW.down), moving[:N_MOTION]
    sensitivity, block, elapsed = work.sensitivity, work.block, 0.0
    fill_in_all(mean, constants, selection, work.coefficients)
    for substep in range(substep_duration.size):
        elapsed += substep_duration[substep]
    if depth_is_state(constants):
        reset_sensitivity(sensitivity, work.depth_derivative)
        sink_rate(motion, sensitivity, elapsed, work.depth_derivative)
        fill_in_row(work.depth_derivative, constants, selection, matrix[depth])
    motion_jacobian(
        motion, work.coefficients, inputs[substep_input[0]], constants, sensitivity, sensitivity, N_COLUMNS, work.step
    )
    for i in range(N_MOTION):
        for j in range(n_columns):
            sensitivity[i, j] = elapsed * sensitivity[i, j] + (1.0 if i == j else 0.0)
    _fill_in(sensitivity, constants, selection, matrix)
    if is_disturbed(constants):
        derive_at_once(constants, elapsed, work.disturbance)
        fill_in_forces(constants, work.disturbance, matrix)
    for i in range(N_MOTION):
        block[i * LANES] = motion[i]
    block[N_MOTION * LANES] = 0.0
    for m in range(n_columns - N_MOTION):
        work.coefficient_block[m * LANES] = work.coefficients[m]
    for substep in range(substep_duration.size):
        held, duration = inputs[substep_input[substep]], substep_duration[substep]
        if depth_is_state(constants):
            sink(block, N_MOTION, 1, 0.5 * duration)
        if is_disturbed(constants):
            push(moving, 1, constants, 1, 0.5 * duration, block, LANES)
        runge_kutta_step(block, work.coefficient_block, held, constants, 1, duration, work.step)
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
    coefficients: CoefficientSet = COEFFICIENTS,
) -> Process:
    """Return the augmented model of Sabet et al. 2018, eq. (10), with scaled coefficients and with errors.

    Parameters
    ----------
    vehicle : ndarray
        From `vehicle_constants`.
    held : mapping
        Coefficients that are not in the state by symbol, SI.
    layout : StateLayout
    known : KnownSensors
    coefficients : CoefficientSet
        All coefficients of the vehicle.

    Returns
    -------
    Process
        With the exact transition (alternative: `first_order_transition`) and without nonlinear sensors.
    """
    values = np.array([held.get(symbol, 0.0) for symbol in coefficients.symbols])
    # The vehicle's own terms come after actuator errors and ballast.
    place = {s: m if m < N_COEFFICIENTS else m + len(NO_ERRORS) for m, s in enumerate(coefficients.symbols)}
    estimated = layout.symbols[layout.rows_of("coefficients")]
    return Process(
        advance=_advance,
        transition=_exact_transition,
        constants=model_constants(vehicle, values, layout, known),
        selection=np.array([place[symbol] for symbol in estimated], dtype=np.int64),
        noise_density=layout.noise_density,
        scratch_size=_scratch_size(len(coefficients.terms)),
        driven=driven_by_disturbances(vehicle, layout),
    )


@compiled(types.void(_vector, _vector, _vector, types.int64, TIMELINE, types.int64, types.int64, _vector))
def move_through(block, coefficients, constants, n_lanes, timeline, first, last, work):
    """Propagate motion and depth of a block of models through substeps `first` to `last` - 1, in place.

    Parameters
    ----------
    block : ndarray, shape (N_PREDICTED * LANES,)
    coefficients, constants, n_lanes, work
        See `auvid_cli.vehicle.equations.runge_kutta_step`.
    timeline : Timeline
    first, last : int
    """
    for substep in range(first, last):
        held, duration = timeline.inputs[timeline.substep_input[substep]], timeline.substep_duration[substep]
        sink(block, N_MOTION, n_lanes, 0.5 * duration)
        runge_kutta_step(block, coefficients, held, constants, n_lanes, duration, work)
        sink(block, N_MOTION, n_lanes, 0.5 * duration)


@compiled(types.void(_vector, _vector, _vector, TIMELINE, _matrix, _vector))
def move_freely(block, coefficients, constants, timeline, predicted, work):
    """Fill in motion and depth of one model at every event, without measurements.

    Parameters
    ----------
    block : ndarray, shape (N_PREDICTED * LANES,)
        Initial motion and depth, overwritten by the final ones, in the first lane.
    coefficients : ndarray, shape ((N_FACTORS + terms) * LANES,)
    constants : ndarray
        From `auvid_cli.vehicle.equations.vehicle_constants`.
    timeline : Timeline
    predicted : ndarray, shape (events, N_PREDICTED)
        Filled in.
    work : ndarray, shape (N_WORK,)
        Overwritten.
    """
    for event in range(timeline.time.size):
        first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
        move_through(block, coefficients, constants, 1, timeline, first, last, work)
        for i in range(N_PREDICTED):
            predicted[event, i] = block[i * LANES]
