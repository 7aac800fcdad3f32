"""Depth, and disturbing forces and moments as states: their steps and derivatives for one state or a block of them.

A disturbance is a first-order Gauss-Markov process, ``tau_d_dot = -tau_d / T + noise``, that adds ``M^-1 tau_d`` to the
acceleration. Strang splitting in each substep: half a push, motion and decay, half a push. The depth follows
``down_dot = -u sin(theta) + (v sin(phi) + w cos(phi)) cos(theta)``, Sabet et al. 2018, eq. (2); trapezoidal rule.
"""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.identification.compiled_layout import ROW, depth_is_state, fading_rate, first_moving_row, row_of
from auvid_cli.identification.states import StateLayout
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.vehicle.equations import n_terms, named_constants, sine_cosine
from auvid_cli.vehicle.jacobian import N_COLUMNS, transition_step
from auvid_cli.vehicle.parameters import DISTURBANCE, N_MOTION

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_N_AXES = len(DISTURBANCE)
_ROWS = tuple(getattr(ROW, quantity.symbol) for quantity in DISTURBANCE)
# Ends of the vectors in the scratch.
_REMAINING = _N_AXES
_BY_FORCE = _REMAINING + N_MOTION * _N_AXES
_SINKING = _BY_FORCE + _N_AXES + 1


@compiled()
def sink(moving, place, n_lanes, duration):
    """Advance the depth, the moving state `place`, with the present vertical velocity."""
    for k in range(n_lanes):
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        across = sin_phi * moving[LANES + k] + cos_phi * moving[2 * LANES + k]
        moving[place * LANES + k] += duration * (cos_theta * across - sin_theta * moving[k])


@compiled()
def reset_sensitivity(sensitivity, depth_derivative):
    """Set the sensitivity of the motion to the unit matrix, and that of the depth to zero."""
    for i in range(N_MOTION):
        for j in range(sensitivity.shape[1]):
            sensitivity[i, j] = 1.0 if i == j else 0.0
    for j in range(depth_derivative.size):
        depth_derivative[j] = 0.0


@compiled()
def sink_rate(motion, sensitivity, duration, depth_derivative):
    """Add the derivative of the vertical velocity times the duration, and in the last element the change of depth."""
    u, v, w = motion[0], motion[1], motion[2]
    sin_phi, cos_phi = sine_cosine(motion[6])
    sin_theta, cos_theta = sine_cosine(motion[7])
    across, along = sin_phi * v + cos_phi * w, cos_phi * v - sin_phi * w
    n_columns = sensitivity.shape[1]
    for j in range(n_columns):
        turning = cos_theta * along * sensitivity[6, j] - (sin_theta * across + cos_theta * u) * sensitivity[7, j]
        moving = cos_theta * (sin_phi * sensitivity[1, j] + cos_phi * sensitivity[2, j])
        depth_derivative[j] += duration * (turning + moving - sin_theta * sensitivity[0, j])
    depth_derivative[n_columns] += duration * (cos_theta * across - sin_theta * u)


class _Workspace(NamedTuple):
    """Derivatives by the initial disturbances, accumulated over the substeps of one state."""

    by_force: Array  # shape (9, 6); derivative of the motion by the initial force or moment of each axis
    depth_derivative: Array  # shape (7,); derivative of the depth by these, then the change of depth
    remaining: Array  # shape (6,); share of each initial force or moment that has not decayed
    # Shape (9, N_COLUMNS + terms); derivative of the motion after one substep by that before it, and by the factors
    step: Array
    copy: Array  # as `step`; scratch


@compiled(types.int64(types.int64))
def disturbance_work(terms):
    """Return the length of the scratch for disturbances."""
    return _SINKING + 2 * N_MOTION * (N_COLUMNS + terms)


@compiled(inline=True)
def _workspace(scratch, terms):
    columns = N_COLUMNS + terms
    step = _SINKING + N_MOTION * columns
    return _Workspace(
        by_force=scratch[_REMAINING:_BY_FORCE].reshape(N_MOTION, _N_AXES),
        depth_derivative=scratch[_BY_FORCE:_SINKING],
        remaining=scratch[:_REMAINING],
        step=scratch[_SINKING:step].reshape(N_MOTION, columns),
        copy=scratch[step : step + N_MOTION * columns].reshape(N_MOTION, columns),
    )


def driven_by_disturbances(vehicle: Array, layout: StateLayout) -> Array:
    """Return `auvid_cli.filters.problem.Process.driven`: accelerations by forces and moments; empty without any."""
    rows = [layout.row(quantity.symbol) for quantity in DISTURBANCE]
    n_moving, first = layout.noise_density.size, layout.n_parameters
    if all(row is None for row in rows):
        return np.zeros((0, 0))
    driven, motion = np.zeros((n_moving, n_moving)), layout.rows_of("motion").start - first
    # Not compiled, because the compiled function returns views that do not keep `vehicle` in memory.
    inverse = named_constants.py_func(vehicle).inverse.reshape(6, 6)
    for axis, row in enumerate(rows):
        if row is not None:
            driven[motion : motion + 6, row - first] = inverse[:, axis]
    return driven


@compiled()
def push(moving, row_length, constants, n_lanes, duration, velocity, velocity_row_length):
    """Add the effect of disturbances during a duration, s, to the first six rows of `velocity`, which may be `moving`.

    With the duration 1 the accelerations are added to a derivative.
    """
    inverse, first = named_constants(constants).inverse, first_moving_row(constants)
    for axis in range(_N_AXES):
        row = row_of(constants, _ROWS[axis])
        if row >= 0:
            force = moving[(row - first) * row_length :]
            for i in range(6):
                share = duration * inverse[6 * i + axis]
                for k in range(n_lanes):
                    velocity[i * velocity_row_length + k] += share * force[k]


@compiled()
def fade(moving, row_length, constants, n_lanes, duration):
    """Let disturbances decay during a duration, s; parameters are those of `push`."""
    for axis in range(_N_AXES):
        row = row_of(constants, _ROWS[axis])
        if row >= 0:
            force = moving[(row - first_moving_row(constants)) * row_length :]
            remaining = np.exp(-duration * fading_rate(constants, axis))
            for k in range(n_lanes):
                force[k] *= remaining


@compiled()
def _push_derivative(constants, duration, remaining, by_force):
    """Differentiate `push` by the initial disturbances."""
    inverse = named_constants(constants).inverse
    for i in range(6):
        for axis in range(_N_AXES):
            by_force[i, axis] += duration * inverse[6 * i + axis] * remaining[axis]


@compiled()
def _fade_derivative(constants, duration, remaining):
    for axis in range(_N_AXES):
        remaining[axis] *= np.exp(-duration * fading_rate(constants, axis))


@compiled()
def reset_disturbance(constants, scratch):
    """Reset the derivatives at the start of an interval."""
    work = _workspace(scratch, n_terms(constants))
    for i in range(N_MOTION):
        for axis in range(_N_AXES):
            work.by_force[i, axis] = 0.0
    for j in range(work.depth_derivative.size):
        work.depth_derivative[j] = 0.0
    for axis in range(_N_AXES):
        work.remaining[axis] = 1.0


@compiled(reassociate=True, inline=True)
def _multiply(step, product, copy):
    """Replace `product`, shape (9, n), by ``step[:, :9] @ product``; `copy` is scratch of its shape."""
    for i in range(N_MOTION):
        for j in range(product.shape[1]):
            copy[i, j], product[i, j] = product[i, j], 0.0
    for i in range(N_MOTION):
        for k in range(N_MOTION):
            factor = step[i, k]
            for j in range(product.shape[1]):
                product[i, j] += factor * copy[k, j]


@compiled()
def disturbed_step(mean, coefficients, inputs, constants, duration, sensitivity, scratch, for_step):
    """Advance one disturbed state by a substep, with all its derivatives.

    The derivative of one substep multiplies those by the disturbances and those of earlier substeps.

    Parameters
    ----------
    mean : ndarray, shape (n,)
        Augmented state.
    coefficients, inputs, constants, duration
        See `auvid_cli.vehicle.jacobian.transition_step`.
    sensitivity : ndarray, shape (9, N_COLUMNS + terms)
        Derivative of the motion by the initial motion and by the factors.
    scratch : ndarray
        Of length `disturbance_work`, from the previous substep or `reset_disturbance`.
    for_step : ndarray
        Of length `transition_work`; overwritten.
    """
    work, moving = _workspace(scratch, n_terms(constants)), mean[first_moving_row(constants) :]
    motion, step = moving[:N_MOTION], work.step
    if depth_is_state(constants):
        sink_rate(motion, work.by_force, 0.5 * duration, work.depth_derivative)
    push(moving, 1, constants, 1, 0.5 * duration, moving, 1)
    _push_derivative(constants, 0.5 * duration, work.remaining, work.by_force)
    for i in range(N_MOTION):
        for j in range(step.shape[1]):
            step[i, j] = 1.0 if i == j else 0.0
    transition_step(motion, coefficients, inputs, constants, duration, step, for_step)
    _multiply(step, work.by_force, work.copy)
    _multiply(step, sensitivity, work.copy)
    for i in range(N_MOTION):
        for j in range(N_MOTION, step.shape[1]):
            sensitivity[i, j] += step[i, j]
    fade(moving, 1, constants, 1, duration)
    _fade_derivative(constants, duration, work.remaining)
    push(moving, 1, constants, 1, 0.5 * duration, moving, 1)
    _push_derivative(constants, 0.5 * duration, work.remaining, work.by_force)
    if depth_is_state(constants):
        sink_rate(motion, work.by_force, 0.5 * duration, work.depth_derivative)


@compiled()
def derive_at_once(constants, duration, scratch):
    """Set the derivatives by the disturbances to first order in the interval."""
    work = _workspace(scratch, n_terms(constants))
    reset_disturbance(constants, scratch)
    _push_derivative(constants, duration, work.remaining, work.by_force)
    _fade_derivative(constants, duration, work.remaining)


@compiled()
def fill_in_forces(constants, scratch, matrix):
    """Copy the derivatives by the disturbances to a transition matrix."""
    work, first = _workspace(scratch, n_terms(constants)), first_moving_row(constants)
    for axis in range(_N_AXES):
        row = row_of(constants, _ROWS[axis])
        if row >= 0:
            for i in range(N_MOTION):
                matrix[first + i, row] = work.by_force[i, axis]
            matrix[row, row] = work.remaining[axis]
            if depth_is_state(constants):
                matrix[row_of(constants, ROW.down), row] = work.depth_derivative[axis]


@compiled()
def fill_in_specific_force(constants, arm, component, gain, row):
    """Fill in the derivative of a component of the acceleration at a lever arm by the disturbances."""
    inverse = named_constants(constants).inverse
    j, k = (component + 1) % 3, (component + 2) % 3
    for axis in range(_N_AXES):
        state = row_of(constants, _ROWS[axis])
        if state >= 0:
            turning = inverse[6 * (3 + j) + axis] * arm[k] - inverse[6 * (3 + k) + axis] * arm[j]
            row[state] = gain * (inverse[6 * component + axis] + turning)
