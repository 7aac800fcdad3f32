"""The compiled equations of motion against a symbolic derivation from energies and virtual work."""

import math
from functools import cache

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.equations import (
    N_FACTORS,
    NO_ERRORS,
    motion_derivative,
    runge_kutta_step,
    sine_cosine,
    vehicle_constants,
)
from auvid_cli.vehicle.parameters import AS_STATED, INPUT_SYMBOLS, MOTION_SYMBOLS, N_MOTION, PARAMETER_SYMBOLS
from auvid_cli.vehicle.rigid_body import Ballast

seeds = st.integers(0, 2**32 - 1)


@cache
def symbolic_model():
    """Mass matrix, generalised force (propulsion and coefficients included) and Euler-rate matrix."""
    u, v, w, p, q, r, phi, theta, psi = motion = sp.symbols(MOTION_SYMBOLS, real=True)
    rudder, elevator, surge_force, roll_moment = inputs = sp.symbols(INPUT_SYMBOLS, real=True)
    known = dict(zip(PARAMETER_SYMBOLS, sp.symbols(PARAMETER_SYMBOLS, real=True), strict=True))
    unknown = [sp.Symbol(f"c{i}", real=True) for i in range(N_COEFFICIENTS)]
    c = dict(zip(SYMBOLS, unknown, strict=True))
    excess_buoyancy, trim_moment = ballast = sp.symbols(Ballast._fields, real=True)
    k = known
    velocity, turning = sp.Matrix([u, v, w]), sp.Matrix([p, q, r])

    # Kinetic energy of the body, point by point of it, and of the water (Kirchhoff).
    centre = sp.Matrix([k["xG"], k["yG"], k["zG"]])
    inertia = sp.diag(k["Ixx"], k["Iyy"], k["Izz"])
    body = k["m"] * (velocity.dot(velocity) / 2 + velocity.dot(turning.cross(centre)))
    body += (turning.T * inertia * turning)[0] / 2
    water = (
        -(
            k["X_udot"] * u**2
            + k["Y_vdot"] * v**2
            + k["Z_wdot"] * w**2
            + k["K_pdot"] * p**2
            + k["M_qdot"] * q**2
            + k["N_rdot"] * r**2
        )
        / 2
    )
    water -= k["Y_rdot"] * v * r + k["Z_qdot"] * w * q
    energy = body + water
    nu = sp.Matrix([u, v, w, p, q, r])
    mass = sp.hessian(energy, list(nu))
    momentum = sp.Matrix([energy.diff(x) for x in velocity])
    angular = sp.Matrix([energy.diff(x) for x in turning])

    def about(axis, angle):
        return sp.Matrix(
            sp.rot_axis1(-angle) if axis == 1 else sp.rot_axis2(-angle) if axis == 2 else sp.rot_axis3(-angle)
        )

    rotation = about(3, psi) * about(2, theta) * about(1, phi)

    # Virtual work of weight (down) and buoyancy (up) in a small shift or turn along each body axis, and of the ballast:
    # up at the origin, and a weight that is moved back (trim_moment = shift * weight).
    buoyancy_centre = sp.Matrix([k["xB"], k["yB"], k["zB"]])
    restoring = []
    for axis in range(3):
        unit = sp.eye(3)[:, axis]
        restoring.append((k["W"] - k["B"] - excess_buoyancy) * (rotation * unit)[2])
    for axis in range(3):
        unit = sp.eye(3)[:, axis]
        work = k["W"] * (rotation * unit.cross(centre))[2]
        work -= trim_moment * (rotation * unit.cross(sp.eye(3)[:, 0]))[2]
        restoring.append(work - k["B"] * (rotation * unit.cross(buoyancy_centre))[2])

    # Table II of the paper.
    table_ii = sp.Matrix(
        [
            c["X_u|u|"] * abs(u) * u + surge_force,
            c["Y_v|v|"] * abs(v) * v
            + c["Y_r|r|"] * abs(r) * r
            + c["Y_url"] * u * r
            + c["Y_uvl"] * u * v
            + c["Y_uudr"] * u**2 * rudder,
            c["Z_w|w|"] * abs(w) * w
            + c["Z_q|q|"] * abs(q) * q
            + c["Z_uql"] * u * q
            + c["Z_uwl"] * u * w
            + c["Z_uude"] * u**2 * elevator,
            c["K_p|p|"] * abs(p) * p + roll_moment,
            c["M_w|w|"] * abs(w) * w
            + c["M_q|q|"] * abs(q) * q
            + c["M_uwl"] * u * w
            + c["M_uql"] * u * q
            + c["M_uude"] * u**2 * elevator,
            c["N_v|v|"] * abs(v) * v
            + c["N_r|r|"] * abs(r) * r
            + c["N_uvl"] * u * v
            + c["N_url"] * u * r
            + c["N_uudr"] * u**2 * rudder,
        ]
    )
    inertial = sp.Matrix.vstack(turning.cross(momentum), turning.cross(angular) + velocity.cross(momentum))
    force = table_ii + sp.Matrix(restoring) - inertial

    # Euler rates: the angular velocity is the axial vector of R' dR/dt.
    columns = []
    for angle in (phi, theta, psi):
        spin = rotation.T * rotation.diff(angle)
        columns.append(sp.Matrix([spin[2, 1], spin[0, 2], spin[1, 0]]))
    rates = sp.simplify(sp.Matrix.hstack(*columns))
    arguments = [*motion, *unknown, *ballast, *inputs, *known.values()]
    return sp.lambdify(arguments, [mass, force, rates], "numpy", cse=True)


@pytest.mark.slow
@given(seed=seeds)
def test_compiled_model_equals_the_symbolic_one(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng)
    motion, coefficients, inputs = random_state(rng, vehicle["m"])
    ballast = vehicle["m"] * rng.uniform(-1.0, 1.0, 2)
    mass, force, rates = symbolic_model()(
        *motion, *coefficients, *ballast, *inputs, *(vehicle[symbol] for symbol in PARAMETER_SYMBOLS)
    )
    everything = np.concatenate([coefficients, AS_STATED, ballast])
    derivative = core.derivative(motion, everything, inputs, vehicle_constants(vehicle))
    expected = np.concatenate([np.linalg.solve(mass, force[:, 0]), np.linalg.solve(rates, motion[3:6])])
    assert_allclose(derivative[:6], expected[:6], rtol=1e-12, atol=1e-12 * np.abs(expected[:6]).max())
    assert_allclose(derivative[6:], expected[6:], rtol=1e-12, atol=1e-13)


@given(seed=seeds)
def test_euler_rates_turn_the_rotation_matrix_as_the_body_turns(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng)
    motion, coefficients, inputs = random_state(rng, vehicle["m"])
    rates = core.derivative(motion, coefficients, inputs, vehicle_constants(vehicle))[6:]

    def rotation(angles):
        (a, b, c), (d, e, f) = np.cos(angles), np.sin(angles)
        roll = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
        pitch = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
        yaw = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
        return yaw @ pitch @ roll

    step = 1e-5
    change = (rotation(motion[6:] + step * rates) - rotation(motion[6:] - step * rates)) / (2 * step)
    p, q, r = motion[3:6]
    spin = np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]])
    assert_allclose(change, rotation(motion[6:]) @ spin, atol=1e-7)


@given(seed=seeds)
def test_a_mirrored_vehicle_moves_as_in_a_mirror(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    constants = vehicle_constants(random_vehicle(rng) | {"yG": 0.0, "yB": 0.0})
    motion, coefficients, inputs = random_state(rng, 100.0)
    mirror = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
    mirrored_inputs = inputs * [-1.0, 1.0, 1.0, -1.0]
    here = core.derivative(motion, coefficients, inputs, constants)
    there = core.derivative(mirror * motion, coefficients, mirrored_inputs, constants)
    assert_allclose(there, mirror * here, rtol=1e-12, atol=1e-12 * np.abs(here).max())


@pytest.mark.parametrize("n_lanes", [1, 2, 7, 63, LANES])
def test_lanes_are_independent_of_each_other(n_lanes, rng, core, random_vehicle, random_state):
    constants = vehicle_constants(random_vehicle(rng))
    states = [random_state(rng, 100.0) for _ in range(n_lanes)]
    inputs = states[0][2]
    motion, coefficients = np.zeros((N_MOTION, LANES)), np.zeros((N_FACTORS, LANES))
    motion[:, :n_lanes] = np.transpose([state[0] for state in states])
    coefficients[:N_COEFFICIENTS, :n_lanes] = np.transpose([state[1] for state in states])
    coefficients[N_COEFFICIENTS:] = np.transpose([NO_ERRORS])
    derivative = np.full(N_MOTION * LANES, 7.0)
    motion_derivative(motion.ravel(), coefficients.ravel(), inputs, constants, n_lanes, derivative)
    alone = [core.derivative(m, c, inputs, constants) for m, c, _ in states]
    used = derivative.reshape(N_MOTION, LANES)
    assert_allclose(used[:, :n_lanes], np.transpose(alone), rtol=1e-12, atol=1e-12)
    assert np.all(used[:, n_lanes:] == 7.0)

    work = np.zeros(3 * N_MOTION * LANES)
    block = motion.ravel().copy()
    runge_kutta_step(block, coefficients.ravel(), inputs, constants, n_lanes, 0.01, work)
    moved = [core.advance(m, c, inputs, constants, 1, 0.01)[-1] for m, c, _ in states]
    assert_allclose(block.reshape(N_MOTION, LANES)[:, :n_lanes], np.transpose(moved), rtol=1e-12, atol=1e-12)


def test_sine_and_cosine_are_those_of_the_standard_library():
    turns = np.arange(-40, 41) * (np.pi / 4)
    close = np.concatenate([turns, turns + 1e-9, turns - 1e-9, np.linspace(-10, 10, 2001), [0.0, 1e-300]])
    far = np.concatenate([np.linspace(-1e5, 1e5, 4001), np.arange(1, 30000, 997) * (np.pi / 2)])
    for angle in (*close, *far):
        sine, cosine = sine_cosine(angle)
        assert abs(sine - math.sin(angle)) <= 2.5e-16, angle
        assert abs(cosine - math.cos(angle)) <= 2.5e-16, angle
