"""Jacobian and transition matrix against differences, linearity and an independent integrator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_FACTORS, factors, n_terms, vehicle_constants
from auvid_cli.vehicle.jacobian import N_COLUMNS, N_JACOBIAN_WORK, motion_jacobian, transition_step, transition_work
from auvid_cli.vehicle.parameters import N_MOTION, ActuatorErrors
from auvid_cli.vehicle.rigid_body import Ballast

seeds = st.integers(0, 2**32 - 1)


def jacobian(motion, coefficients, inputs, constants):
    both = np.full((N_MOTION, N_COLUMNS + n_terms(constants)), 7.0)
    motion_jacobian(motion, coefficients, inputs, constants, both, both, N_COLUMNS, np.full(N_JACOBIAN_WORK, 7.0))
    return both[:, :N_MOTION], both[:, N_MOTION:]


def away_from_kinks(motion):
    """|x| x has a jump in its second derivative at 0, which differences would see."""
    return motion + 0.01 * np.sign(motion)


def differences(function, x, step):
    """Central differences, fourth order, of a vector function."""
    columns = []
    for direction in np.eye(x.size):
        near = function(x + step * direction) - function(x - step * direction)
        wide = function(x + 2 * step * direction) - function(x - 2 * step * direction)
        columns.append((8 * near - wide) / (12 * step))
    return np.transpose(columns)


@given(seed=seeds)
def test_jacobian_by_motion_equals_differences(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng)
    constants = vehicle_constants(vehicle)
    motion, coefficients, inputs = random_state(rng, vehicle["m"])
    coefficients = np.concatenate([coefficients, [0.8, 0.03, -0.05], vehicle["m"] * rng.uniform(-1.0, 1.0, 2)])
    motion = away_from_kinks(motion)
    by_motion, _ = jacobian(motion, coefficients, inputs, constants)
    expected = differences(lambda x: core.derivative(x, coefficients, inputs, constants), motion, 1e-3)
    assert_allclose(by_motion, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
@given(seed=seeds)
def test_columns_by_coefficient_follow_from_linearity(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    constants = vehicle_constants(random_vehicle(rng) | {"W": 0.0, "B": 0.0})
    motion, coefficients, inputs = random_state(rng, 1.0)
    trimmed = np.concatenate([coefficients, [0.8, 0.03, -0.05], rng.uniform(-1.0, 1.0, 2)])
    _, by_coefficients = jacobian(motion, trimmed, inputs, constants)
    without = core.derivative(motion, 0.0 * trimmed, inputs, constants)
    # Of each term fins as they act are a factor, and a trim is worth as much of all terms of its fin.
    acting = inputs + np.array([0.03, -0.05, 0.0, 0.0])
    trims = slice(N_COEFFICIENTS + 1, N_COEFFICIENTS + 3)
    for column, unit in zip(
        *(np.delete(rows, trims, axis=0) for rows in (by_coefficients.T, np.eye(N_FACTORS))), strict=True
    ):
        # A large multiple, so that the rest of the derivative does not hide the column's digits.
        change = core.derivative(motion, 1e6 * unit, acting, constants) - without
        assert_allclose(1e6 * column, change, rtol=1e-10, atol=1e-12 * np.abs(without).max())
    for column, fin in zip(by_coefficients.T[trims], np.eye(4), strict=False):
        change = core.derivative(motion, trimmed, inputs + 1e6 * fin, constants)
        change -= core.derivative(motion, trimmed, inputs, constants)
        assert_allclose(1e6 * column, change, rtol=1e-8, atol=1e-12 * np.abs(without).max())


def one_transition(motion, coefficients, inputs, constants, steps, step):
    motion = motion.copy()
    transition = np.hstack([np.eye(N_MOTION), np.zeros((N_MOTION, coefficients.size))])
    for _ in range(steps):
        work = np.full(transition_work(n_terms(constants)), 7.0)
        transition_step(motion, coefficients, inputs, constants, step, transition, work)
    return motion, transition


@given(seed=seeds)
def test_transition_is_the_derivative_of_the_runge_kutta_step(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng)
    constants = vehicle_constants(vehicle)
    motion, coefficients, inputs = random_state(rng, vehicle["m"])
    coefficients = np.concatenate([coefficients, [0.8, 0.03, -0.05], vehicle["m"] * rng.uniform(-1.0, 1.0, 2)])
    # Gentle enough that no velocity changes its sign, which is a kink, within the step.
    motion, coefficients, step = 0.5 * motion + 0.3 * np.sign(motion), 0.05 * coefficients, 0.0001
    moved, transition = one_transition(motion, coefficients, inputs, constants, 1, step)

    def after(x):
        return core.advance(x[:N_MOTION], x[N_MOTION:], inputs, constants, 1, step)[-1]

    def after_scaled(x):
        return after(np.concatenate([x[:N_MOTION], vehicle["m"] * x[N_MOTION:]]))

    start = np.concatenate([motion, coefficients])
    assert_allclose(moved, after(start), rtol=1e-13, atol=1e-14)
    scaled = np.concatenate([motion, coefficients / vehicle["m"]])
    expected = differences(after_scaled, scaled, 1e-3)
    transition[:, N_MOTION:] *= vehicle["m"]
    assert_allclose(transition, expected, rtol=1e-7, atol=1e-10)


def test_transition_over_a_second_solves_the_variational_equation(core, experiment_with):
    vehicle = experiment_with().vehicle
    constants = vehicle_constants(vehicle.known_parameters())
    coefficients = factors(vehicle.all_coefficients(), ActuatorErrors(0.8, 0.03, -0.05))
    coefficients[-len(Ballast._fields) :] = 5.0, -2.0
    motion = np.array([2.0, 0.2, -0.15, 0.1, 0.12, 0.2, 0.1, -0.2, 0.5])
    inputs = np.array([0.05, -0.04, 20.0, 0.3])

    def slope(time, y):
        transition = y[N_MOTION:].reshape(N_MOTION, -1)
        by_motion, by_coefficients = jacobian(y[:N_MOTION].copy(), coefficients, inputs, constants)
        change = by_motion @ transition
        change[:, N_MOTION:] += by_coefficients
        rate = core.derivative(y[:N_MOTION], coefficients, inputs, constants)
        return np.concatenate([rate, change.ravel()])

    start = np.hstack([np.eye(N_MOTION), np.zeros((N_MOTION, N_FACTORS))])
    solution = solve_ivp(
        slope, (0.0, 1.0), np.concatenate([motion, start.ravel()]), "DOP853", rtol=1e-12, atol=1e-13
    ).y[:, -1]
    moved, transition = one_transition(motion, coefficients, inputs, constants, 500, 0.002)
    expected = solution[N_MOTION:].reshape(N_MOTION, -1)
    assert_allclose(moved, solution[:N_MOTION], rtol=1e-8)
    assert_allclose(transition, expected, rtol=1e-6, atol=1e-8 * np.abs(expected).max())
