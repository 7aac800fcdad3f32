"""Derivatives of the equations of motion and of a Runge-Kutta step by motion and coefficients."""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.vehicle.coefficients import COEFFICIENTS, N_COEFFICIENTS, SIGNALS
from auvid_cli.vehicle.equations import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_FACTORS,
    N_SLOPE,
    motion_derivative,
    n_terms,
    named_constants,
    regressor_code,
    sine_cosine,
    term_place,
)
from auvid_cli.vehicle.parameters import N_MOTION, ActuatorErrors
from auvid_cli.vehicle.rigid_body import N_BALLAST

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
# Type of a global array in compiled code.
_constant = types.Array(types.float64, 1, "C", readonly=True)


# Number of columns of a derivative by the motion and all factors except the vehicle's own terms.
N_COLUMNS = N_MOTION + N_FACTORS
# Columns of the derivative of the forces: eight by velocities, roll and pitch, then by actuator errors and ballast.
_N_ATTITUDE = 8
_N_FORCE_COLUMNS = _N_ATTITUDE + N_FACTORS - N_COEFFICIENTS
_N_FORCE = 6 * _N_FORCE_COLUMNS
_N_MOMENTUM = _N_FORCE + 6
_N_SIGNAL_VALUES = _N_MOMENTUM + 2 * len(SIGNALS)
N_JACOBIAN_WORK = _N_SIGNAL_VALUES + 2 * len(SIGNALS)


# Indices among the factors.
_BALLAST = N_FACTORS - N_BALLAST
_THRUST = N_COEFFICIENTS + ActuatorErrors._fields.index("thrust")
# Index of the trim of a fin minus the index of its signal, equal for rudder and elevator.
_TRIM = N_COEFFICIENTS + ActuatorErrors._fields.index("rudder_trim") - SIGNALS.index("rudder")
_THRUST_SIGNAL = SIGNALS.index("thrust")
_N_SIGNAL = SIGNALS.index("n")
# Column of a factor in the derivative of the forces, minus its index among the factors.
_OF_ERRORS = _N_ATTITUDE - N_COEFFICIENTS
# Column of the state or factor that changes each signal; the slopes of revolutions and voltage are zero.
_COLUMNS = np.array([*range(6), *(_OF_ERRORS + _TRIM + which for which in (6, 7)), _OF_ERRORS + _THRUST, 0, 0])
_CODES = np.array([regressor_code(c) for c in COEFFICIENTS], dtype=np.int64)


@compiled(inline=True)
def _fill_in_signals(motion, coefficients, inputs, values, slopes):
    """Fill in all acting signals, each followed by its modulus, and their derivatives by the state or error."""
    for which in range(len(SIGNALS)):
        slope = 1.0
        if which < 6:
            value = motion[which]
        elif which < _THRUST_SIGNAL:
            value = inputs[which - 6] + coefficients[_TRIM + which]
        elif which == _THRUST_SIGNAL:
            value, slope = inputs[2] * coefficients[_THRUST], inputs[2]
        else:
            column = 4 + which - _N_SIGNAL
            value, slope = inputs[column] if column < inputs.size else 0.0, 0.0
        values[2 * which], values[2 * which + 1] = value, abs(value)
        slopes[2 * which], slopes[2 * which + 1] = slope, slope * np.sign(value)


@compiled(inline=True)
def _differentiate_term(code, values, slopes, coefficient, force):
    """Add the derivatives of a term to those of its force; return the derivative by the coefficient."""
    row, n_factors, regressor, before = int(code[0]), int(code[1]), 1.0, coefficient
    for a in range(n_factors):
        factor = int(code[2 + a])
        # Product rule: the derivative of this factor times the others.
        slope = before * slopes[factor]
        for b in range(a + 1, n_factors):
            slope *= values[int(code[2 + b])]
        force[row, _COLUMNS[factor // 2]] += slope
        before *= values[factor]
        regressor *= values[factor]
    return regressor


@compiled(types.void(_vector, _vector, _vector, _vector, _matrix, _matrix, types.int64, _vector))
def motion_jacobian(motion, coefficients, inputs, constants, jacobian, by_terms, first, work):
    """Fill in the derivative of `motion_derivative` by motion, coefficients, actuator errors, ballast and own terms.

    Parameters
    ----------
    motion : ndarray, shape (9,)
    coefficients : ndarray, shape (N_FACTORS + terms,)
    inputs : ndarray, shape (4,) or (6,)
    constants : ndarray
        From `vehicle_constants`.
    jacobian : ndarray, shape (9, N_COLUMNS) or wider
        Filled in: A of Sabet et al. 2018, Table A1, for the motion, then the regressor B(x). The equations are linear
        in all factors.
    by_terms : ndarray, shape (9, first + terms)
        Filled in from column `first` on with the derivative by the vehicle's own terms; may be `jacobian`.
    first : int
    work : ndarray, shape (N_JACOBIAN_WORK,)
        Overwritten.
    """
    by_rows, inverse_by_rows, excess, lever_x, lever_y, lever_z = named_constants(constants)
    mass, inverse = by_rows.reshape(6, 6), inverse_by_rows.reshape(6, 6)
    excess, lever_x = excess - coefficients[_BALLAST], lever_x - coefficients[_BALLAST + 1]
    force, momentum = work[:_N_FORCE].reshape(6, _N_FORCE_COLUMNS), work[_N_FORCE:_N_MOMENTUM]
    values, slopes = work[_N_MOMENTUM:_N_SIGNAL_VALUES], work[_N_SIGNAL_VALUES:]
    _fill_in_signals(motion, coefficients, inputs, values, slopes)
    for i in range(6):
        momentum[i] = 0.0
        for j in range(6):
            momentum[i] += mass[i, j] * motion[j]
        for j in range(_N_FORCE_COLUMNS):
            force[i, j] = 0.0
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            jacobian[i, j] = 0.0
        for t in range(n_terms(constants)):
            by_terms[i, first + t] = 0.0

    # Kirchhoff: F = [a x omega, b x omega + a x v] with momentum (a, b); product rule.
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for c in range(6):
            force[i, c] += mass[j, c] * motion[3 + k] - mass[k, c] * motion[3 + j]
            force[3 + i, c] += mass[3 + j, c] * motion[3 + k] - mass[3 + k, c] * motion[3 + j]
            force[3 + i, c] += mass[j, c] * motion[k] - mass[k, c] * motion[j]
        force[i, 3 + k] += momentum[j]
        force[i, 3 + j] -= momentum[k]
        force[3 + i, 3 + k] += momentum[3 + j]
        force[3 + i, 3 + j] -= momentum[3 + k]
        force[3 + i, k] += momentum[j]
        force[3 + i, j] -= momentum[k]

    sin_phi, cos_phi = sine_cosine(motion[6])
    sin_theta, cos_theta = sine_cosine(motion[7])
    down = (-sin_theta, cos_theta * sin_phi, cos_theta * cos_phi)
    by_roll = (0.0, down[2], -down[1])
    by_pitch = (-cos_theta, -sin_theta * sin_phi, -sin_theta * cos_phi)
    for c, change in ((6, by_roll), (7, by_pitch)):
        for i in range(3):
            force[i, c] = excess * change[i]
        force[3, c] = lever_y * change[2] - lever_z * change[1]
        force[4, c] = lever_z * change[0] - lever_x * change[2]
        force[5, c] = lever_x * change[1] - lever_y * change[0]

    force[0, _OF_ERRORS + _THRUST] = inputs[2]
    for i in range(3):
        force[i, _OF_ERRORS + _BALLAST] = -down[i]
    force[4, _OF_ERRORS + _BALLAST + 1], force[5, _OF_ERRORS + _BALLAST + 1] = down[2], -down[1]

    for m in range(N_COEFFICIENTS):
        row, regressor = _CODES[m, 0], _differentiate_term(_CODES[m], values, slopes, coefficients[m], force)
        for i in range(6):
            jacobian[i, N_MOTION + m] = inverse[i, row] * regressor
    for t in range(n_terms(constants)):
        code = constants[term_place(constants, t) + 1 :]
        regressor = _differentiate_term(code, values, slopes, coefficients[N_FACTORS + t], force)
        for i in range(6):
            by_terms[i, first + t] = inverse[i, int(code[0])] * regressor

    for i in range(6):
        for k in range(6):
            share = inverse[i, k]
            # Most vehicles have no coupling between motions in the plane of symmetry and across it.
            if share == 0.0:
                continue
            for j in range(_N_ATTITUDE):
                jacobian[i, j] += share * force[k, j]
            for j in range(_N_ATTITUDE, _N_FORCE_COLUMNS):
                jacobian[i, N_MOTION - _OF_ERRORS + j] += share * force[k, j]
    pitch_rate, yaw_rate = motion[4], motion[5]
    turning = pitch_rate * sin_phi + yaw_rate * cos_phi
    turning_by_roll = pitch_rate * cos_phi - yaw_rate * sin_phi
    tangent, secant = sin_theta / cos_theta, 1.0 / cos_theta
    jacobian[6, 3] = 1.0
    jacobian[6, 4], jacobian[6, 5] = tangent * sin_phi, tangent * cos_phi
    jacobian[6, 6], jacobian[6, 7] = tangent * turning_by_roll, turning * secant * secant
    jacobian[7, 4], jacobian[7, 5], jacobian[7, 6] = cos_phi, -sin_phi, -turning
    jacobian[8, 4], jacobian[8, 5] = secant * sin_phi, secant * cos_phi
    jacobian[8, 6], jacobian[8, 7] = secant * turning_by_roll, turning * secant * tangent


class TransitionWorkspace(NamedTuple):
    """Scratch arrays of `transition_step`."""

    # Columns by own terms have arrays of their own, so that the row length of these four is constant and their loops
    # vectorise.
    start_transition: Array  # shape (9, N_COLUMNS); transition matrix at the start of the step
    stage_transition: Array  # shape (9, N_COLUMNS); transition matrix of a stage
    rate: Array  # shape (9, N_COLUMNS); time derivative of the transition matrix
    jacobian: Array  # shape (9, N_COLUMNS)
    start_of_terms: Array  # shape (9, terms); columns of `start_transition` by own terms
    stage_of_terms: Array  # shape (9, terms); columns of `stage_transition` by own terms
    rate_of_terms: Array  # shape (9, terms); columns of `rate` by own terms
    by_terms: Array  # shape (9, terms); columns of `jacobian` by own terms
    motion: Array  # shape (3, 9); motion at the start, in the middle and at the end of the step
    block: Array  # shape (N_BLOCK,); motion of a stage in the first lane
    slope: Array  # shape (N_SLOPE,); time derivative of the motion
    coefficient_block: Array  # shape (N_COEFFICIENT_BLOCK + terms * LANES,)
    for_jacobian: Array  # shape (N_JACOBIAN_WORK,)


# Ends of the arrays in the scratch whose lengths do not depend on the own terms; the others follow.
_MATRICES = 4 * N_MOTION * N_COLUMNS
_MOTION = _MATRICES + 3 * N_MOTION
_BLOCK = _MOTION + N_BLOCK
_SLOPE = _BLOCK + N_SLOPE
_FOR_JACOBIAN = _SLOPE + N_JACOBIAN_WORK


def transition_work(terms: int) -> int:
    """Return the length of the scratch of `transition_step`."""
    return _FOR_JACOBIAN + N_COEFFICIENT_BLOCK + terms * (LANES + 4 * N_MOTION)


@compiled(inline=True)
def _transition_workspace(scratch, terms):
    matrices = scratch[:_MATRICES].reshape(4, N_MOTION, N_COLUMNS)
    lanes = _FOR_JACOBIAN + N_COEFFICIENT_BLOCK + terms * LANES
    of_terms = scratch[lanes : lanes + 4 * N_MOTION * terms].reshape(4, N_MOTION, terms)
    return TransitionWorkspace(
        start_transition=matrices[0],
        stage_transition=matrices[1],
        rate=matrices[2],
        jacobian=matrices[3],
        start_of_terms=of_terms[0],
        stage_of_terms=of_terms[1],
        rate_of_terms=of_terms[2],
        by_terms=of_terms[3],
        motion=scratch[_MATRICES:_MOTION].reshape(3, N_MOTION),
        block=scratch[_MOTION:_BLOCK],
        slope=scratch[_BLOCK:_SLOPE],
        coefficient_block=scratch[_FOR_JACOBIAN:lanes],
        for_jacobian=scratch[_SLOPE:_FOR_JACOBIAN],
    )


@compiled(inline=True)
def _transition_rate(jacobian, transition, rate):
    """Fill in ``A Phi + [0 B]`` for the Jacobian ``[A B]`` and the transition matrix Phi."""
    # The short inner sum is unrolled, and the loop over columns vectorises. Yaw, the last state, has no effect.
    for i in range(N_MOTION):
        for j in range(N_COLUMNS):
            total = 0.0
            for k in range(N_MOTION - 1):
                total += jacobian[i, k] * transition[k, j]
            rate[i, j] = total
    for i in range(N_MOTION):
        for j in range(N_MOTION, N_COLUMNS):
            rate[i, j] += jacobian[i, j]


@compiled(inline=True)
def _rate_of_terms(jacobian, by_terms, transition, rate):
    """Fill in ``A Phi + B`` for the columns by the vehicle's own terms."""
    for t in range(rate.shape[1]):
        for i in range(N_MOTION):
            total = by_terms[i, t]
            for k in range(N_MOTION):
                total += jacobian[i, k] * transition[k, t]
            rate[i, t] = total


@compiled(types.void(_vector, _vector, _vector, _vector, types.float64, _matrix, _vector))
def transition_step(motion, coefficients, inputs, constants, duration, transition, scratch):
    """Advance one motion state and its transition matrix together by one Runge-Kutta step, in place.

    The variational equation ``dPhi/dt = A Phi + [0 B]`` is integrated with the Jacobian at the start, in the middle and
    at the end, so that the result is the derivative of the discrete step up to the error of the step.

    Parameters
    ----------
    motion : ndarray, shape (9,)
    coefficients, inputs, constants
        See `motion_jacobian`.
    duration : float
        s.
    transition : ndarray, shape (9, N_COLUMNS + terms)
        Derivative of the motion by initial motion and coefficients; initially [I 0].
    scratch : ndarray
        Memory of length `transition_work`; overwritten.
    """
    work = _transition_workspace(scratch, n_terms(constants))
    columns = N_COLUMNS + n_terms(constants)
    for m in range(columns - N_MOTION):
        work.coefficient_block[m * LANES] = coefficients[m]
    start, middle, end = work.motion[0], work.motion[1], work.motion[2]
    for i in range(N_MOTION):
        start[i] = middle[i] = end[i] = work.block[i * LANES] = motion[i]
        for j in range(N_COLUMNS):
            work.start_transition[i, j] = work.stage_transition[i, j] = transition[i, j]
        for t in range(columns - N_COLUMNS):
            work.start_of_terms[i, t] = work.stage_of_terms[i, t] = transition[i, N_COLUMNS + t]
    # The middle is the mean of the two inner stages.
    for weight, advance, share in ((1.0, 0.5, 0.25), (2.0, 0.5, 0.25), (2.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
        motion_derivative(work.block, work.coefficient_block, inputs, constants, 1, work.slope)
        for i in range(N_MOTION):
            change = duration * work.slope[i * LANES]
            end[i] += weight / 6.0 * change
            middle[i] += share * change
            work.block[i * LANES] = start[i] + advance * change
    # The inner stages have the same Jacobian.
    for stage, place, weight, advance in ((0, 0, 1.0, 0.5), (1, 1, 2.0, 0.5), (2, 1, 2.0, 1.0), (3, 2, 1.0, 0.0)):
        if stage != 2:
            motion_jacobian(
                work.motion[place], coefficients, inputs, constants, work.jacobian, work.by_terms, 0, work.for_jacobian
            )
        _transition_rate(work.jacobian, work.stage_transition, work.rate)
        _rate_of_terms(work.jacobian, work.by_terms, work.stage_of_terms, work.rate_of_terms)
        for i in range(N_MOTION):
            for j in range(N_COLUMNS):
                transition[i, j] += duration / 6.0 * weight * work.rate[i, j]
                work.stage_transition[i, j] = work.start_transition[i, j] + advance * duration * work.rate[i, j]
            for t in range(columns - N_COLUMNS):
                rate = work.rate_of_terms[i, t]
                transition[i, N_COLUMNS + t] += duration / 6.0 * weight * rate
                work.stage_of_terms[i, t] = work.start_of_terms[i, t] + advance * duration * rate
    for i in range(N_MOTION):
        motion[i] = end[i]
