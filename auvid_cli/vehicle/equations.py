"""The equations of motion, compiled, Sabet et al. 2018, eqs. (3), (8) and (13), for simulator and filters.

They work on blocks of up to `LANES` states, with one row per quantity and one lane per state, so that the loop over
lanes vectorises. The row length is constant, because with a length that is known only at run time the compiler checks
rows for overlap and the loop stays scalar (four times slower). The vehicle's own terms beyond the 22 are added one by
one from a table among the constants.
"""

from collections import namedtuple
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.vehicle.coefficients import COEFFICIENTS, MAX_FACTORS, SIGNALS, Coefficient, CoefficientSet
from auvid_cli.vehicle.parameters import AS_STATED, N_MOTION, ActuatorErrors
from auvid_cli.vehicle.rigid_body import NO_BALLAST, Ballast, mass_matrix

# Offsets in the vector of constants.
_COUPLING = 36 + 36 + 4
_IS_COUPLED = _COUPLING + 36
_N_TERMS = _IS_COUPLED + 1
_TERMS_AT = _N_TERMS + 1
N_CONSTANTS = _TERMS_AT + 1
# Surge, heave and pitch.
_IN_PLANE = [0, 2, 4]
# Sway, roll and yaw.
_ACROSS = [1, 3, 5]
# Entries of a term in the table: held value, row, number of factors, codes of the factors.
TERM_WIDTH = 3 + MAX_FACTORS
# Values of actuator errors and ballast that change nothing.
NO_ERRORS = (*AS_STATED, *NO_BALLAST)
# Number of factors that every vehicle has: the 22 coefficients, actuator errors, ballast.
N_FACTORS = len(COEFFICIENTS) + len(NO_ERRORS)
_vector = types.float64[::1]
# First element of the row of each factor in a block. Signed like every index into a block: the loop does not vectorise
# if signed and unsigned indices are mixed.
_FactorRows = namedtuple(
    "_FactorRows", [*(c.identifier for c in COEFFICIENTS), *ActuatorErrors._fields, *Ballast._fields]
)
_AT = _FactorRows(*range(0, N_FACTORS * LANES, LANES))
_RUDDER = SIGNALS.index("rudder")
_ELEVATOR = SIGNALS.index("elevator")
_THRUST = SIGNALS.index("thrust")
_REVOLUTIONS = SIGNALS.index("n")
_ONE = 2 * len(SIGNALS)
_TWO_ROWS = 2 * LANES
_FOUR_ROWS = 4 * LANES
N_BLOCK = N_MOTION * LANES
N_SLOPE = N_BLOCK + LANES


class Constants(NamedTuple):
    """Constants of a vehicle in the compiled equations."""

    # The two matrices are stored by rows: as two-dimensional arrays `motion_derivative` would take a third more time.
    mass: Array  # shape (36,); mass matrix
    inverse: Array  # shape (36,); inverse of the mass matrix
    excess: float  # W - B, N
    lever_x: float  # xG W - xB B, N m
    lever_y: float  # yG W - yB B, N m
    lever_z: float  # zG W - zB B, N m


def _coupling(inverse: Array) -> Array:
    """Return C such that the accelerations are ``a + C a``, where a follows from the forces of the same plane alone."""
    decoupled = np.zeros_like(inverse)
    for motions in (_IN_PLANE, _ACROSS):
        decoupled[np.ix_(motions, motions)] = inverse[np.ix_(motions, motions)]
    return np.asarray((inverse - decoupled) @ np.linalg.inv(decoupled))


def regressor_code(coefficient: Coefficient) -> list[float]:
    """Return row, number of factors and codes of the factors, padded to `MAX_FACTORS` with the code of a factor 1.

    The code is twice the index among `SIGNALS`, plus one for a modulus.
    """
    pairs = zip(coefficient.signals, coefficient.moduli, strict=True)
    codes = [2 * SIGNALS.index(signal) + modulus for signal, modulus in pairs]
    return [float(n) for n in (coefficient.row, len(codes), *codes, *[_ONE] * (MAX_FACTORS - len(codes)))]


def vehicle_constants(parameters: Mapping[str, float], terms: Sequence[Coefficient] = ()) -> Array:
    """Return the constants of the equations of motion, shape (N_CONSTANTS + len(terms) * TERM_WIDTH,).

    They are `Constants`, the coupling between the planes, and the table of the vehicle's own terms.

    Parameters
    ----------
    parameters : mapping
        Known parameters by symbol, SI.
    terms : sequence of Coefficient
        Terms beyond the 22.
    """
    mass = mass_matrix(parameters)
    levers = [parameters[f"{a}G"] * parameters["W"] - parameters[f"{a}B"] * parameters["B"] for a in "xyz"]
    excess = parameters["W"] - parameters["B"]
    table = [number for term in terms for number in (0.0, *regressor_code(term))]
    inverse: Array = np.linalg.inv(mass).astype(np.float64)
    coupling = _coupling(inverse)
    hull = *mass.ravel(), *inverse.ravel(), excess, *levers, *coupling.ravel(), coupling.any()
    return np.array([*hull, len(terms), N_CONSTANTS, *table])


def with_table_at_end(vehicle: Array, held: Array, between: Array) -> Array:
    """Return vehicle constants with `between` inserted before the table of own terms, and `held` as values of these.

    Parameters
    ----------
    vehicle : ndarray
        From `vehicle_constants`.
    held : ndarray, shape (terms,)
        Values of the own terms, SI.
    between : ndarray
        Constants to insert.
    """
    table = vehicle[N_CONSTANTS:].copy()
    table[::TERM_WIDTH] = held
    constants = np.concatenate([vehicle[:N_CONSTANTS], between, table])
    constants[_TERMS_AT] = N_CONSTANTS + between.size
    return constants


@compiled(inline=True)
def named_constants(constants):
    """Name the parts of a vector from `vehicle_constants`."""
    return Constants(
        mass=constants[:36],
        inverse=constants[36:72],
        excess=constants[72],
        lever_x=constants[73],
        lever_y=constants[74],
        lever_z=constants[75],
    )


@compiled(types.int64(_vector))
def n_terms(constants):
    """Return the number of the vehicle's own terms."""
    return int(constants[_N_TERMS])


@compiled()
def term_place(constants, t):
    """Return the index of the held value of own term t; its code follows."""
    return int(constants[_TERMS_AT]) + TERM_WIDTH * t


def factors(
    coefficients: Mapping[str, float],
    actuators: ActuatorErrors = AS_STATED,
    of_vehicle: CoefficientSet = COEFFICIENTS,
) -> Array:
    """Return coefficients, actuator errors and zero ballast as one vector, shape (N_FACTORS + terms,).

    Parameters
    ----------
    coefficients : mapping
        All coefficients of the vehicle by symbol, SI.
    actuators : ActuatorErrors
    of_vehicle : CoefficientSet
    """
    values = [coefficients[symbol] for symbol in of_vehicle.symbols]
    return with_errors(np.array([values]), (*actuators, *NO_BALLAST))[0]


def with_errors(coefficients: Array, errors: Sequence[float] | Array = NO_ERRORS) -> Array:
    """Return rows of coefficients with actuator errors and ballast, see `NO_ERRORS`, inserted after the 22."""
    n, shape = len(COEFFICIENTS), (len(coefficients), len(NO_ERRORS))
    return np.hstack([coefficients[:, :n], np.broadcast_to(errors, shape), coefficients[:, n:]])


@compiled(types.UniTuple(types.float64, 2)(types.float64))
def sine_cosine(angle: float) -> tuple[float, float]:
    """Return sine and cosine to about 1 ulp for |angle| < 1e5 rad; branch-free, so that it vectorises.

    Cody-Waite reduction to +-pi/4 and the minimax polynomials of Cephes (Moshier 1989).
    """
    quadrant = np.floor(angle * 0.6366197723675814 + 0.5)
    z = (angle - quadrant * 1.5707963267341256) - quadrant * 6.077100506303966e-11
    z = z - quadrant * 2.0222662487959506e-21
    y = z * z
    sine = -2.50507477628578072866e-8 + y * 1.58962301576546568060e-10
    sine = -1.98412698295895385996e-4 + y * (2.75573136213857245213e-6 + y * sine)
    sine = z + z * y * (-1.66666666666666307295e-1 + y * (8.33333333332211858878e-3 + y * sine))
    cosine = 2.08757008419747316778e-9 - y * 1.13585365213876817300e-11
    cosine = 2.48015872888517045348e-5 + y * (-2.75573141792967388112e-7 + y * cosine)
    cosine = 4.16666666666665929218e-2 + y * (-1.38888888888730564116e-3 + y * cosine)
    cosine = 1.0 - 0.5 * y + y * y * cosine
    turn = quadrant - 4.0 * np.floor(quadrant * 0.25)
    odd = (turn == 1.0) or (turn == 3.0)
    s = cosine if odd else sine
    c = sine if odd else cosine
    s = -s if turn >= 2.0 else s
    c = -c if (turn == 1.0 or turn == 2.0) else c
    return s, c


@compiled()
def _couple(constants, n_lanes, rates):
    """Add the coupling between accelerations in the plane of symmetry and across it."""
    coupling, n = constants[_COUPLING:_IS_COUPLED], LANES
    for k in range(n_lanes):
        surge, sway, heave = rates[k], rates[n + k], rates[2 * n + k]
        roll, pitch, yaw = rates[3 * n + k], rates[4 * n + k], rates[5 * n + k]
        for i in range(0, 6, 2):
            rates[i * n + k] += coupling[6 * i + 1] * sway + coupling[6 * i + 3] * roll + coupling[6 * i + 5] * yaw
            j = i + 1
            rates[j * n + k] += coupling[6 * j] * surge + coupling[6 * j + 2] * heave + coupling[6 * j + 4] * pitch


class _Factor(NamedTuple):
    """A factor of a regressor, ``shift + gain * signal``, or its modulus if `sign` is negative."""

    signal: Array
    gain: float
    shift: float
    sign: float


@compiled(inline=True)
def _factor(code, motion, coefficients, inputs):
    """Return a factor by its code, see `regressor_code`."""
    # Branch-free, so that the loop over lanes vectorises.
    which, sign = code // 2, 1.0 - 2.0 * (code % 2)
    if which < _RUDDER:
        return _Factor(motion[which * LANES :], 1.0, 0.0, sign)
    if which == _RUDDER:
        return _Factor(coefficients[_AT.rudder_trim :], 1.0, inputs[0], sign)
    if which == _ELEVATOR:
        return _Factor(coefficients[_AT.elevator_trim :], 1.0, inputs[1], sign)
    if which == _THRUST:
        return _Factor(coefficients[_AT.thrust :], inputs[2], 0.0, sign)
    return _Factor(motion, 0.0, 1.0 if code == _ONE else inputs[4 + which - _REVOLUTIONS], sign)


@compiled(inline=True)
def _value(factor, k):
    """Return a factor in lane k; a modulus is the larger of a value and its negative, without a branch."""
    value = factor.shift + factor.gain * factor.signal[k]
    return max(value, factor.sign * value)


@compiled(inline=True)
def _accelerate(value, first, second, shares, n_lanes, rates):
    """Add a product with two factors, times a share for each, to the accelerations in rows 0, 2 and 4.

    A separate function, because the compiler then assumes that arguments do not overlap.
    """
    share0, share1, share2 = shares
    # The compiler cannot infer this limit.
    for k in range(min(n_lanes, LANES)):
        force = value[k] * _value(first, k) * _value(second, k)
        rates[k] += share0 * force
        rates[_TWO_ROWS + k] += share1 * force
        rates[_FOUR_ROWS + k] += share2 * force


@compiled()
def add_terms(motion, coefficients, inputs, constants, n_lanes, derivative):
    """Add the vehicle's own terms to the derivative; parameters are those of `motion_derivative`."""
    inverse, product = constants[36:72], derivative[N_BLOCK:]
    for t in range(n_terms(constants)):
        entry, value = term_place(constants, t), coefficients[(N_FACTORS + t) * LANES :]
        row, codes = int(constants[entry + 1]), constants[entry + 3 : entry + TERM_WIDTH]
        # Few terms have more than two factors.
        for a in range(2, int(constants[entry + 2])):
            factor = _factor(int(codes[a]), motion, coefficients, inputs)
            for k in range(n_lanes):
                product[k] = value[k] * _value(factor, k)
            value = product
        first = _factor(int(codes[0]), motion, coefficients, inputs)
        second = _factor(int(codes[1]), motion, coefficients, inputs)
        plane = row % 2
        shares = inverse[6 * plane + row], inverse[6 * plane + 12 + row], inverse[6 * plane + 24 + row]
        _accelerate(value, first, second, shares, n_lanes, derivative[plane * LANES :])


@compiled(types.void(_vector, _vector, _vector, _vector, types.int64, _vector))
def motion_derivative(motion, coefficients, inputs, constants, n_lanes, derivative):
    """Fill in the time derivative of the nine motion states, Sabet et al. 2018, eqs. (3), (8) and (13).

    Parameters
    ----------
    motion : ndarray, shape (9 * LANES,)
        Rows u, v, w, p, q, r, phi, theta, psi; m/s, rad/s, rad.
    coefficients : ndarray, shape ((N_FACTORS + terms) * LANES,)
        Rows in the order of `COEFFICIENTS`, `ActuatorErrors`, `Ballast`, and the vehicle's own terms, SI.
    inputs : ndarray, shape (4,) or (6,)
        Rudder, elevator (rad), surge force (N), roll moment (N m), and for own terms revolutions (turn/s) and voltage
        (V); the same for all lanes.
    constants : ndarray
        From `vehicle_constants`.
    n_lanes : int
        Number of lanes in use.
    derivative : ndarray, shape (N_SLOPE,)
        Filled in; the last of its ten rows is scratch for own terms.
    """
    n = LANES
    stated_rudder, stated_elevator, surge_force, roll_moment = inputs[0], inputs[1], inputs[2], inputs[3]
    mass, inverse, stated_excess, stated_lever_x, lever_y, lever_z = named_constants(constants)
    m11, m15, m16 = mass[0], mass[4], mass[5]
    m22, m24, m26 = mass[7], mass[9], mass[11]
    m33, m34, m35 = mass[14], mass[15], mass[16]
    m44, m55, m66 = mass[21], mass[28], mass[35]
    omega = coefficients
    for k in range(n_lanes):
        u, v, w = motion[k], motion[n + k], motion[2 * n + k]
        p, q, r = motion[3 * n + k], motion[4 * n + k], motion[5 * n + k]
        sin_phi, cos_phi = sine_cosine(motion[6 * n + k])
        sin_theta, cos_theta = sine_cosine(motion[7 * n + k])

        # Momentum M nu; the Coriolis forces are its cross products (Kirchhoff), C(nu) nu.
        a1, a2, a3 = m11 * u + m15 * q + m16 * r, m22 * v + m24 * p + m26 * r, m33 * w + m34 * p + m35 * q
        b1, b2, b3 = m24 * v + m34 * w + m44 * p, m15 * u + m35 * w + m55 * q, m16 * u + m26 * v + m66 * r
        down_y, down_z = cos_theta * sin_phi, cos_theta * cos_phi

        rudder = stated_rudder + omega[_AT.rudder_trim + k]
        elevator = stated_elevator + omega[_AT.elevator_trim + k]
        excess = stated_excess - omega[_AT.excess_buoyancy + k]
        lever_x = stated_lever_x - omega[_AT.trim_moment + k]
        uv, uw, uq, ur = u * v, u * w, u * q, u * r
        uu_rudder, uu_elevator = u * u * rudder, u * u * elevator
        vv, ww, pp, qq, rr = abs(v) * v, abs(w) * w, abs(p) * p, abs(q) * q, abs(r) * r
        x = r * a2 - q * a3 - excess * sin_theta + omega[_AT.thrust + k] * surge_force
        x += omega[_AT.X_uu + k] * abs(u) * u
        y = p * a3 - r * a1 + excess * down_y
        y += omega[_AT.Y_vv + k] * vv + omega[_AT.Y_rr + k] * rr
        y += omega[_AT.Y_url + k] * ur + omega[_AT.Y_uvl + k] * uv + omega[_AT.Y_uudr + k] * uu_rudder
        z = q * a1 - p * a2 + excess * down_z
        z += omega[_AT.Z_ww + k] * ww + omega[_AT.Z_qq + k] * qq
        z += omega[_AT.Z_uql + k] * uq + omega[_AT.Z_uwl + k] * uw + omega[_AT.Z_uude + k] * uu_elevator
        roll = r * b2 - q * b3 + w * a2 - v * a3 + lever_y * down_z - lever_z * down_y + roll_moment
        roll += omega[_AT.K_pp + k] * pp
        pitch = p * b3 - r * b1 + u * a3 - w * a1 - lever_z * sin_theta - lever_x * down_z
        pitch += omega[_AT.M_qq + k] * qq + omega[_AT.M_ww + k] * ww
        pitch += omega[_AT.M_uql + k] * uq + omega[_AT.M_uwl + k] * uw + omega[_AT.M_uude + k] * uu_elevator
        yaw = q * b1 - p * b2 + v * a1 - u * a2 + lever_x * down_y + lever_y * sin_theta
        yaw += omega[_AT.N_rr + k] * rr + omega[_AT.N_vv + k] * vv
        yaw += omega[_AT.N_url + k] * ur + omega[_AT.N_uvl + k] * uv + omega[_AT.N_uudr + k] * uu_rudder

        # Most vehicles have no coupling between motions in the plane of symmetry and across it.
        for i in range(np.uint64(3)):
            j = np.uint64(12) * i
            derivative[i * (2 * n) + k] = (
                inverse[j] * x + inverse[j + np.uint64(2)] * z + inverse[j + np.uint64(4)] * pitch
            )
            derivative[i * (2 * n) + (n + k)] = (
                inverse[j + np.uint64(7)] * y + inverse[j + np.uint64(9)] * roll + inverse[j + np.uint64(11)] * yaw
            )
        heading_rate = (q * sin_phi + r * cos_phi) / cos_theta
        derivative[6 * n + k] = p + sin_theta * heading_rate
        derivative[7 * n + k] = q * cos_phi - r * sin_phi
        derivative[8 * n + k] = heading_rate
    if n_terms(constants) > 0:
        add_terms(motion, coefficients, inputs, constants, n_lanes, derivative)
    if constants[_IS_COUPLED] != 0.0:
        _couple(constants, n_lanes, derivative)


N_WORK = 2 * N_BLOCK + N_SLOPE
N_COEFFICIENT_BLOCK = N_FACTORS * LANES


# In the next three functions the loop over rows is unrolled, and the loop over lanes vectorises.
@compiled()
def _first_stage(motion, slope, advance, n_lanes, total, stage):
    """Set the sum of slopes to the first slope, and the stage to ``motion + advance * slope``."""
    for k in range(n_lanes):
        for row in range(N_MOTION):
            i = row * LANES + k
            total[i] = slope[i]
            stage[i] = motion[i] + advance * slope[i]


@compiled()
def _inner_stage(motion, slope, advance, n_lanes, total, stage):
    """Add the slope of an inner stage, with weight 2, to the sum, and set the next stage."""
    for k in range(n_lanes):
        for row in range(N_MOTION):
            i = row * LANES + k
            total[i] += 2.0 * slope[i]
            stage[i] = motion[i] + advance * slope[i]


@compiled()
def _last_stage(total, slope, share, n_lanes, motion):
    """Add the last slope to the sum, and advance the motion by `share` times the sum."""
    for k in range(n_lanes):
        for row in range(N_MOTION):
            i = row * LANES + k
            motion[i] += share * (total[i] + slope[i])


@compiled(types.void(_vector, _vector, _vector, _vector, types.int64, types.float64, _vector))
def runge_kutta_step(motion, coefficients, inputs, constants, n_lanes, duration, work):
    """Advance a block of motion states by one classical fourth-order Runge-Kutta step, in place.

    Parameters
    ----------
    motion, coefficients, inputs, constants, n_lanes
        See `motion_derivative`.
    duration : float
        s.
    work : ndarray, shape (N_WORK,)
        Overwritten.
    """
    stage, total, slope = work[:N_BLOCK], work[N_BLOCK : 2 * N_BLOCK], work[2 * N_BLOCK :]
    motion_derivative(motion, coefficients, inputs, constants, n_lanes, slope)
    _first_stage(motion, slope, 0.5 * duration, n_lanes, total, stage)
    motion_derivative(stage, coefficients, inputs, constants, n_lanes, slope)
    _inner_stage(motion, slope, 0.5 * duration, n_lanes, total, stage)
    motion_derivative(stage, coefficients, inputs, constants, n_lanes, slope)
    _inner_stage(motion, slope, duration, n_lanes, total, stage)
    motion_derivative(stage, coefficients, inputs, constants, n_lanes, slope)
    _last_stage(total, slope, duration / 6.0, n_lanes, motion)
