"""Transition matrices of the EKF against differences of the flow itself."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.extra_states import FURTHER_STATES, AugmentedStates
from auvid_cli.config.identification import Identification
from auvid_cli.identification.process import first_order_transition, vehicle_process
from auvid_cli.identification.states import state_layout
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.equations import vehicle_constants

SCALE = np.linspace(0.5, 2.0, N_COEFFICIENTS)
LEAST = (SYMBOLS[0],)
INPUTS = np.array([[0.1, -0.05, 30.0, 1.0], [-0.1, 0.07, 35.0, -1.0]])
MOTION = np.array([2.0, 0.1, -0.1, 0.02, 0.03, -0.05, 0.1, -0.2, 0.3])


def layout_of(vehicle, measuring=(), **settings):
    """A state with coefficients in units of `SCALE`."""
    prior = {"standard_deviation": dict(zip(SYMBOLS, SCALE.tolist(), strict=True))}
    return state_layout(Identification(prior=prior, **settings), vehicle, measuring)


@pytest.fixture(
    params=[(), *((state.sensor,) for state in FURTHER_STATES)], ids=lambda sensors: "".join(sensors) or "motion"
)
def state_and_flow(request, experiment_with):
    """A state, and a function from it, a duration and a kind of transition to the next state and the matrix."""
    vehicle = experiment_with().vehicle
    true = vehicle.all_coefficients()
    constants = vehicle_constants(vehicle.known_parameters())
    layout = layout_of(vehicle, request.param)

    def flow(state, duration, exact=True, inputs=INPUTS):
        process = vehicle_process(constants, {}, layout)
        if not exact:
            process = process._replace(transition=first_order_transition)
        moved, matrix = state.copy(), np.eye(state.size)
        substeps = np.array([0, 1]), np.array([0.25, 0.75]) * duration
        scratch = np.full(process.scratch_size, 7.0)
        process.transition(moved, inputs, *substeps, process.constants, process.selection, matrix, scratch)
        return moved, matrix

    state = np.concatenate([np.array([true[symbol] for symbol in SYMBOLS]) / SCALE, MOTION, [7.0] * len(request.param)])
    return state, flow


def test_the_exact_transition_is_the_derivative_of_the_flow(state_and_flow):
    state, flow = state_and_flow
    _, matrix = flow(state, 0.004)
    for j in range(state.size):
        step = np.zeros(state.size)
        step[j] = 1e-5 * max(1.0, abs(state[j]))
        difference = (flow(state + step, 0.004)[0] - flow(state - step, 0.004)[0]) / (2.0 * step[j])
        assert_allclose(matrix[:, j], difference, rtol=1e-6, atol=1e-9)


def test_the_first_order_transition_is_the_identity_plus_the_jacobian_times_the_interval(state_and_flow):
    """Linear in the interval, and the slope of the exact one: its error falls with the square of the interval."""
    state, flow = state_and_flow
    identity = np.eye(state.size)
    whole, half = (flow(state, duration, exact=False)[1] for duration in (0.01, 0.005))
    assert_allclose(whole - identity, 2.0 * (half - identity), rtol=1e-12, atol=1e-15)
    held = np.repeat(INPUTS[:1], 2, axis=0)
    errors = [
        np.abs(flow(state, d, exact=False, inputs=held)[1] - flow(state, d, inputs=held)[1]).max()
        for d in (4e-3, 2e-3, 1e-3)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05)


def test_both_transitions_propagate_the_same_mean(state_and_flow):
    """In as small steps as the integrator's error allows: the covariance is what differs."""
    state, flow = state_and_flow
    assert_allclose(flow(state, 0.04, exact=False)[0], flow(state, 0.04)[0], rtol=1e-12)


def test_depth_follows_the_vertical_velocity(experiment_with):
    """Against an integral over many small steps of the velocity along the rotation matrix's third row."""
    vehicle = experiment_with().vehicle
    true, constants = vehicle.all_coefficients(), vehicle_constants(vehicle.known_parameters())
    coefficients = np.array([true[symbol] for symbol in SYMBOLS]) / SCALE
    process = vehicle_process(constants, {}, layout_of(vehicle, measuring=("depth",)))
    state, scratch = np.concatenate([coefficients, MOTION, [7.0]]), np.zeros(process.scratch_size)
    depth, n, duration = 7.0, 4000, 0.4
    fine = state.copy()
    rates = []
    for k in range(n + 1):
        u, v, w, *_, phi, theta, _ = fine[N_COEFFICIENTS:-1]
        down = [-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)]
        rates.append(down @ np.array([u, v, w]))
        if k < n:
            substeps = np.array([0]), np.array([duration / n])
            model = process.constants, process.selection, np.eye(fine.size), scratch
            process.transition(fine, INPUTS, *substeps, *model)
    depth += duration / n * (np.sum(rates) - 0.5 * (rates[0] + rates[-1]))
    assert abs(depth - 7.0) > 0.05

    moved = state.copy()
    substeps = np.zeros(20, dtype=np.int64), np.full(20, duration / 20)
    process.transition(moved, INPUTS, *substeps, process.constants, process.selection, np.eye(moved.size), scratch)
    assert moved[-1] == pytest.approx(depth, abs=1e-5)

    parameters, moving = np.repeat(coefficients, LANES), np.repeat(state[N_COEFFICIENTS:], LANES)
    for _ in range(20):
        process.advance(moving, parameters, INPUTS[0], process.constants, process.selection, 5, duration / 20, scratch)
    assert_allclose(moving.reshape(-1, LANES)[:, :5], np.repeat(moved[N_COEFFICIENTS:, None], 5, axis=1), rtol=1e-12)


@pytest.mark.parametrize("walk", [0.0, 1e-3])
@pytest.mark.parametrize("exact", [True, False])
def test_thrust_scale_has_its_derivative(walk, exact, experiment_with):
    """As if the inputs themselves were larger; the column is a difference."""
    asked = AugmentedStates(biases=("thrust",), thrust={"walk": walk})
    vehicle = experiment_with().vehicle
    true = vehicle.all_coefficients()
    constants = vehicle_constants(vehicle.known_parameters())
    # Settings ask for one coefficient at least.
    first, place = len(LEAST), len(LEAST) + (0 if walk == 0.0 else MOTION.size)
    process = vehicle_process(constants, true, layout_of(vehicle, coefficients=LEAST, estimate=asked))
    if not exact:
        process = process._replace(transition=first_order_transition)
    plain = vehicle_process(constants, true, layout_of(vehicle, coefficients=LEAST))
    if not exact:
        plain = plain._replace(transition=first_order_transition)

    def moved(process, state, inputs):
        state, matrix, scratch = state.copy(), np.eye(state.size), np.zeros(process.scratch_size)
        substeps = np.array([0]), np.array([0.004])
        process.transition(state, inputs, *substeps, process.constants, process.selection, matrix, scratch)
        return state, matrix

    without = np.concatenate([[true[LEAST[0]]], MOTION])
    without[0] /= layout_of(vehicle, coefficients=LEAST).scale[0]
    state = np.insert(without, place, 0.25)
    after, matrix = moved(process, state, INPUTS)
    assert_allclose(np.delete(after, place), moved(plain, without, INPUTS * [1.0, 1.0, 1.25, 1.0])[0], rtol=1e-12)
    step = np.insert(np.zeros(without.size), place, 1e-4)
    difference = (moved(process, state + step, INPUTS)[0] - moved(process, state - step, INPUTS)[0]) / 2e-4
    assert_allclose(matrix[:, place], difference, rtol=1e-5 if exact else 0.05, atol=1e-9 if exact else 1e-4)

    block = np.repeat(state[:, None], LANES, axis=1)
    n_parameters = first + (walk == 0.0)
    parameters, moving = block[:n_parameters], block[n_parameters:]
    moving, scratch = moving.ravel().copy(), np.zeros(process.scratch_size)
    model = process.constants, process.selection, 5, 0.004, scratch
    process.advance(moving, parameters.ravel().copy(), INPUTS[0], *model)
    assert_allclose(moving.reshape(-1, LANES)[:, 0], after[n_parameters:], rtol=1e-12)
