"""Depth kinematics, and disturbances of force and moment as states."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.identification.compiled_layout import ROW, depth_is_state, fading_rate, first_moving_row, row_of
from auvid_cli.numerics import LANES, compiled
from auvid_cli.vehicle.equations import n_terms, named_constants, sine_cosine
from auvid_cli.vehicle.jacobian import N_COLUMNS, transition_step
from auvid_cli.vehicle.parameters import DISTURBANCE, N_MOTION

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
Array = NDArray[np.float64]
_N_AXES = len(DISTURBANCE)
_ROWS = tuple(getattr(ROW, quantity.symbol) for quantity in DISTURBANCE)
# Where the vectors end in the scratch that is handed over.
_LEFT, _MOTION = _N_AXES, _N_AXES + N_MOTION


@compiled()
def sink(moving, place, n_lanes, duration):
    """Move the depth on at the present rate: a half step before and one after the motion are the trapezoidal rule.

    The depth is the moving state at `place`.
    """
    for k in range(n_lanes):
        sin_phi, cos_phi = sine_cosine(moving[6 * LANES + k])
        sin_theta, cos_theta = sine_cosine(moving[7 * LANES + k])
        across = sin_phi * moving[LANES + k] + cos_phi * moving[2 * LANES + k]
        moving[place * LANES + k] += duration * (cos_theta * across - sin_theta * moving[k])


@compiled()
def before_moving(sensitivity, sinking):
    """Begin: the motion depends on itself alone, and the depth has not changed."""
    for i in range(N_MOTION):
        for j in range(sensitivity.shape[1]):
            sensitivity[i, j] = 1.0 if i == j else 0.0
    for j in range(sinking.size):
        sinking[j] = 0.0


@compiled()
def sink_rate(motion, sensitivity, duration, sinking):
    """Add the derivative of the present vertical velocity, for so long, and in the last place the velocity itself."""
    u, v, w = motion[0], motion[1], motion[2]
    sin_phi, cos_phi = sine_cosine(motion[6])
    sin_theta, cos_theta = sine_cosine(motion[7])
    across, along = sin_phi * v + cos_phi * w, cos_phi * v - sin_phi * w
    n_columns = sensitivity.shape[1]
    for j in range(n_columns):
        turning = cos_theta * along * sensitivity[6, j] - (sin_theta * across + cos_theta * u) * sensitivity[7, j]
        moving = cos_theta * (sin_phi * sensitivity[1, j] + cos_phi * sensitivity[2, j])
        sinking[j] += duration * (turning + moving - sin_theta * sensitivity[0, j])
    sinking[n_columns] += duration * (cos_theta * across - sin_theta * u)


class _Workspace(NamedTuple):
    """What is known of the way of one state so far.

    Attributes
    ----------
    by_force : ndarray, shape (9, N_COLUMNS + terms)
        Derivative of the motion by the force or moment of each axis where the way began; the other columns are moved
        along with them, and mean nothing.
    sinking : ndarray, shape (N_COLUMNS + terms + 1,)
        The same of the depth.
    left : ndarray, shape (6,)
        How much is left of each.
    motion : ndarray, shape (9,)
        Holds nothing from one use to the next.
    """

    by_force: Array
    sinking: Array
    left: Array
    motion: Array


@compiled(types.int64(types.int64))
def disturbance_work(terms):
    """Return the length of that scratch."""
    return _MOTION + (N_MOTION + 1) * (N_COLUMNS + terms) + 1


@compiled(inline=True)
def _workspace(scratch, terms):
    columns = N_COLUMNS + terms
    by_force = _MOTION + N_MOTION * columns
    return _Workspace(
        by_force=scratch[_MOTION:by_force].reshape(N_MOTION, columns),
        sinking=scratch[by_force : by_force + columns + 1],
        left=scratch[:_LEFT],
        motion=scratch[_LEFT:_MOTION],
    )


@compiled()
def push(moving, row_length, constants, n_lanes, duration, velocity, velocity_row_length):
    """Let what disturbs some states act for so long on their velocities and rates, or for 1 on these' derivatives.

    Parameters
    ----------
    moving : ndarray
        Rows of moving states, with a lane for each state.
    row_length : int
    constants : ndarray
        Of the process.
    n_lanes : int
    duration : float
        s.
    velocity : ndarray
        Rows of which the first six are changed; may be the same as `moving`.
    velocity_row_length : int
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
    """Let what disturbs some states fade for so long; arguments as of `disturbance`."""
    for axis in range(_N_AXES):
        row = row_of(constants, _ROWS[axis])
        if row >= 0:
            force = moving[(row - first_moving_row(constants)) * row_length :]
            left = np.exp(-duration * fading_rate(constants, axis))
            for k in range(n_lanes):
                force[k] *= left


@compiled()
def _push_derivative(constants, duration, left, by_force):
    """Do to the derivative of the motion what `disturbance` does to the motion."""
    inverse = named_constants(constants).inverse
    for i in range(6):
        for axis in range(_N_AXES):
            by_force[i, axis] += duration * inverse[6 * i + axis] * left[axis]


@compiled()
def _fade_derivative(constants, duration, left):
    for axis in range(_N_AXES):
        left[axis] *= np.exp(-duration * fading_rate(constants, axis))


@compiled()
def undisturbed(constants, scratch):
    """Begin the way of one state: all of the force is left, and nothing has come of it yet."""
    work = _workspace(scratch, n_terms(constants))
    for i in range(N_MOTION):
        for j in range(work.by_force.shape[1]):
            work.by_force[i, j] = 0.0
    for j in range(work.sinking.size):
        work.sinking[j] = 0.0
    for axis in range(_N_AXES):
        work.left[axis] = 1.0


@compiled()
def begin_step(mean, coefficients, inputs, constants, duration, scratch, for_step):
    """Move what the pushes so far came to over a substep, and push one state for the first half of it.

    The motion itself and its derivatives by all else are moved between this and `end_step`.

    Parameters
    ----------
    mean : ndarray, shape (n,)
    coefficients : ndarray, shape (N_FACTORS + terms,)
    inputs, constants : ndarray
        Of the process.
    duration : float
        Of the substep, s.
    scratch : ndarray
        Of `disturbance_work`; from the step before, or `undisturbed`.
    for_step : ndarray
        Of `transition_work`; overwritten.
    """
    work, moving = _workspace(scratch, n_terms(constants)), mean[first_moving_row(constants) :]
    if depth_is_state(constants):
        sink_rate(moving[:N_MOTION], work.by_force, 0.5 * duration, work.sinking)
    push(moving, 1, constants, 1, 0.5 * duration, moving, 1)
    _push_derivative(constants, 0.5 * duration, work.left, work.by_force)
    for i in range(N_MOTION):
        work.motion[i] = moving[i]
    transition_step(work.motion, coefficients, inputs, constants, duration, work.by_force, for_step)


@compiled()
def end_step(mean, constants, duration, scratch):
    """Let the force fade, and push for the second half of the substep; arguments as of `begin_step`."""
    work, moving = _workspace(scratch, n_terms(constants)), mean[first_moving_row(constants) :]
    fade(moving, 1, constants, 1, duration)
    _fade_derivative(constants, duration, work.left)
    push(moving, 1, constants, 1, 0.5 * duration, moving, 1)
    _push_derivative(constants, 0.5 * duration, work.left, work.by_force)
    if depth_is_state(constants):
        sink_rate(moving[:N_MOTION], work.by_force, 0.5 * duration, work.sinking)


@compiled()
def derive_at_once(constants, duration, scratch):
    """Find what comes of the forces to first order in the interval."""
    work = _workspace(scratch, n_terms(constants))
    undisturbed(constants, scratch)
    _push_derivative(constants, duration, work.left, work.by_force)
    _fade_derivative(constants, duration, work.left)


@compiled()
def fill_in_forces(constants, scratch, matrix):
    """Copy the derivatives by the forces to a transition matrix."""
    work, first = _workspace(scratch, n_terms(constants)), first_moving_row(constants)
    for axis in range(_N_AXES):
        row = row_of(constants, _ROWS[axis])
        if row >= 0:
            for i in range(N_MOTION):
                matrix[first + i, row] = work.by_force[i, axis]
            matrix[row, row] = work.left[axis]
            if depth_is_state(constants):
                matrix[row_of(constants, ROW.down), row] = work.sinking[axis]


@compiled()
def fill_in_specific_force(constants, arm, component, gain, row):
    """Copy the derivative of a component of the acceleration at a lever arm to a row of derivatives by the state."""
    inverse = named_constants(constants).inverse
    j, k = (component + 1) % 3, (component + 2) % 3
    for axis in range(_N_AXES):
        state = row_of(constants, _ROWS[axis])
        if state >= 0:
            turning = inverse[6 * (3 + j) + axis] * arm[k] - inverse[6 * (3 + k) + axis] * arm[j]
            row[state] = gain * (inverse[6 * component + axis] + turning)
