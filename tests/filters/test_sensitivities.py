"""The motion left to itself and its sensitivities against matrices by hand, differences and another integration."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.sensitivities import responses
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import SYMBOLS

N_MOVING = 9


def whole(problem, start, chunks):
    """States, sensitivities, innovations and whitened rows of all chunks as one."""
    found = list(responses(problem.process, problem.sensors, chunks, start))
    assert not found[-1].diverged
    return tuple(np.concatenate([r[k] for r in found]) for k in (1, 2, 3, 4))


def test_linear_sensitivities_are_products_of_matrices(linear_problem, by_hand):
    p = linear_problem
    mean, sensitivity, innovation, whitened = whole(p, p.prior.mean, [p.timeline])
    n_parameters = p.prior.mean.size - sensitivity.shape[1]
    assert_allclose(mean, by_hand.offset + by_hand.transition @ p.prior.mean, rtol=1e-11, atol=1e-11)
    assert_allclose(sensitivity, by_hand.transition[:, n_parameters:], rtol=1e-11, atol=1e-11)
    assert_allclose(innovation, by_hand.measurement - by_hand.matrix @ p.prior.mean, rtol=1e-10, atol=1e-10)
    present = ~np.isnan(p.timeline.measurement)
    assert not present.all()
    deviation = np.sqrt(p.sensors.variance[p.timeline.measurement_sensor])[..., None]
    assert_allclose((whitened[..., :-1] * deviation)[present], by_hand.matrix[present], rtol=1e-10, atol=1e-10)
    assert_allclose((whitened[..., -1:] * deviation)[present][:, 0], innovation[present], rtol=1e-12)
    assert np.all(whitened[~present] == 0.0)


@pytest.mark.parametrize("chunk", [1, 7, 29])
def test_chunks_change_nothing(chunk, linear_problem, events_of):
    p = linear_problem
    chunks = [events_of(p.timeline, first, min(first + chunk, 30)) for first in range(0, 30, chunk)]
    for a, b in zip(
        whole(p, p.prior.mean, chunks),
        whole(p, p.prior.mean, [p.timeline]),
        strict=True,
    ):
        assert np.array_equal(a, b, equal_nan=True)


@pytest.mark.parametrize("turns", [-2, 1])
def test_an_angle_counts_modulo_a_turn(turns, linear_problem):
    p = linear_problem
    plain = whole(p, p.prior.mean, [p.timeline])
    p.sensors.angular[0, 1] = True
    p.timeline.measurement[p.timeline.measurement_sensor == 0, 1] += 2.0 * np.pi * turns
    turned = whole(p, p.prior.mean, [p.timeline])
    wrapped = np.angle(np.exp(1j * plain[2]))
    angular = (p.timeline.measurement_sensor == 0)[:, None] & (np.arange(3) == 1)
    assert np.nanmax(np.abs(plain[2][angular])) > np.pi, "something should wrap"
    assert_allclose(turned[2], np.where(angular, wrapped, plain[2]), rtol=1e-9, atol=1e-9)
    assert_allclose(turned[3][..., :-1], plain[3][..., :-1], rtol=1e-12)


def test_nonlinear_sensitivities_are_differences(nonlinear_problem):
    p = nonlinear_problem
    start = 0.2 * p.prior.mean
    _, _, innovation, whitened = whole(p, start, [p.timeline])
    deviation = np.sqrt(p.sensors.variance[p.timeline.measurement_sensor])
    present = ~np.isnan(p.timeline.measurement)
    assert_allclose((whitened[..., -1] * deviation)[present], innovation[present], rtol=1e-12)
    for j, direction in enumerate(np.eye(start.size)):
        ahead, behind = (whole(p, start + s * 1e-5 * direction, [p.timeline])[2] for s in (1.0, -1.0))
        expected = -(ahead - behind) / 2e-5
        assert_allclose((whitened[..., j] * deviation)[present], expected[present], rtol=1e-6, atol=1e-6)


def test_responses_end_at_divergence(linear_problem, events_of):
    p = linear_problem
    t = p.timeline
    event = 13
    substep_input = t.substep_input.copy()
    substep_input[t.substep_offset[event]] = 5
    t = t._replace(inputs=np.vstack([t.inputs, np.full((1, t.inputs.shape[1]), np.nan)]), substep_input=substep_input)
    chunks = [events_of(t, first, first + 10) for first in (0, 10, 20)]
    found = list(responses(p.process, p.sensors, chunks, p.prior.mean))
    assert [r.diverged for r in found] == [False, True]
    assert [len(r.mean) for r in found] == [10, 3]
    assert len(found[1].innovation) == len(found[1].whitened) == chunks[1].measurement_offset[3]
    assert all(np.isfinite(r.mean).all() and np.isfinite(r.whitened).all() for r in found)


@pytest.fixture(scope="module")
def vehicle_problem(simulated_with):
    """5 s of the vehicle, and a state near the true one."""
    rates = "sensors.gyroscope.rate=100 Hz", "sensors.attitude.rate=100 Hz"
    dataset = simulated_with(
        "manoeuvre.duration=5 s", "manoeuvre.initial_speed=2 m/s", "manoeuvre.excitation.fade_in=0.5 s", *rates
    )
    problem = augmented_problem(prepare(dataset))
    start = problem.prior.mean.copy()
    start[: len(SYMBOLS)] = [dataset.truth.coefficients[s] for s in SYMBOLS] / problem.layout.scale[: len(SYMBOLS)]
    return problem, start


def free_motion(problem, start):
    """By the filters' own integration of a block of states, which knows of no derivative."""
    n_parameters = start.size - N_MOVING
    block = np.zeros((start.size, LANES))
    block[:, 0] = start
    moving, parameters = block[n_parameters:].ravel(), block[:n_parameters].ravel()
    process, motions = problem.process, []
    for t in problem.segments[0].timelines:
        for event in range(t.time.size):
            for substep in range(t.substep_offset[event], t.substep_offset[event + 1]):
                held, scratch = t.inputs[t.substep_input[substep]], np.zeros(process.scratch_size)
                model = process.constants, process.selection, 1, t.substep_duration[substep], scratch
                process.advance(moving, parameters, held, *model)
            motions.append(moving.reshape(N_MOVING, LANES)[:, 0].copy())
    return np.array(motions)


@pytest.mark.slow
def test_vehicle_sensitivities_are_differences(vehicle_problem):
    problem, start = vehicle_problem
    mean, sensitivity, _, _ = whole(problem, start, problem.segments[0].timelines)
    assert len(mean) > 400
    assert_allclose(mean[:, -N_MOVING:], free_motion(problem, start), rtol=1e-10, atol=1e-12)
    assert np.array_equal(mean[:, :-N_MOVING], np.broadcast_to(start[:-N_MOVING], (len(mean), len(SYMBOLS))))
    for j, direction in enumerate(np.eye(start.size)):
        step = 1e-5
        difference = (
            free_motion(problem, start + step * direction) - free_motion(problem, start - step * direction)
        ) / (2.0 * step)
        assert_allclose(sensitivity[:, :, j], difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max() + 1e-9)
