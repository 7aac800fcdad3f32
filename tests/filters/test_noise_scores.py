"""Derivatives of the likelihood by its noise, against differences of it and against one big Gaussian."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.linear_smoother import LinearSmoothing, Trajectory
from auvid_cli.filters.noise_likelihood import scaled
from auvid_cli.filters.noise_scores import NoiseGroup, noise_scores
from auvid_cli.filters.problem import TRANSITION_SIGNATURE, Gaussian, JointProblem, joint_gaussian
from tests.filters.compile_later import compile_later

N_MOVING = 4
GROUPS = (NoiseGroup(moving=(0, 1)), NoiseGroup(moving=(2, 3)), NoiseGroup(sensor=0), NoiseGroup(sensor=1))


@pytest.fixture(params=[[0, 30], [0, 13, 30]], ids=["one segment", "two segments"])
def problem(request, linear_problem, events_of):
    p, cuts = linear_problem, request.param
    segments = [
        [events_of(p.timeline, k, min(k + 6, last)) for k in range(first, last, 6)] for first, last in pairwise(cuts)
    ]
    return JointProblem(p.process, p.sensors, segments, joint_gaussian([p.prior] * len(segments), N_MOVING))


def filtered_with(problem, logarithms, groups=GROUPS):
    """The smoothing of a problem with other noise, what it filters about a point, and that problem."""
    changed = scaled(problem, groups, np.exp(logarithms))
    smoothing = LinearSmoothing(changed)
    moving = [[np.zeros((t.time.size, N_MOVING)) for t in segment] for segment in problem.segments]
    initial = [np.zeros(N_MOVING) for _ in problem.segments]
    return smoothing, smoothing.filter(Trajectory(np.zeros(problem.n_parameters), initial, moving)), changed


def log_likelihood(problem, logarithms, groups=GROUPS):
    _, filtered, _ = filtered_with(problem, logarithms, groups)
    return -0.5 * (filtered.least + filtered.log_determinant)


def test_filter_is_independent_of_previous_trajectories(problem):
    smoothing, there, _ = filtered_with(problem, np.zeros(len(GROUPS)))
    elsewhere = smoothing.step(there)
    again, fresh = smoothing.filter(elsewhere), LinearSmoothing(problem).filter(elsewhere)
    assert (again.cost, again.least) == (fresh.cost, fresh.least) != (there.cost, there.least)
    assert np.array_equal(again.final.columns, fresh.final.columns)


def differences(problem, at, groups=GROUPS, step=1e-3):
    """Difference quotient by Richardson extrapolation."""

    def difference(way):
        ahead, behind = (log_likelihood(problem, at + by, groups) for by in (way, -way))
        return (ahead - behind) / (2.0 * step)

    return [(8.0 * difference(way) - difference(2.0 * way)) / 6.0 for way in step * np.eye(len(groups))]


@pytest.mark.parametrize("is_driven", [False, True], ids=["", "driven"])
def test_the_slope_is_that_of_the_likelihood(problem, is_driven):
    problem = with_driven_positions(problem) if is_driven else problem
    at = np.array([0.3, -0.7, 0.2, 0.5])
    scores = noise_scores(*filtered_with(problem, at), GROUPS)
    assert_allclose(scores.slope, differences(problem, at), rtol=1e-6, atol=1e-6)


STATIONARY = NoiseGroup(moving=(0, 1)), NoiseGroup(moving=(2, 3), is_stationary=True), NoiseGroup(sensor=0)


def with_independent_speeds(problem):
    """The problem with initial speeds that are independent of all else."""
    factor, n = problem.prior.factor.copy(), problem.n_parameters
    for place in problem.indices:
        factor[place[n + 2 :]] = 0.0
        factor[place[n + 2 :], place[n + 2 :]] = [0.3, 0.5]
    return problem._replace(prior=problem.prior._replace(factor=factor))


@pytest.mark.parametrize("is_driven", [False, True], ids=["", "driven"])
@pytest.mark.parametrize("groups", [GROUPS, STATIONARY], ids=["noise", "initial values too"])
def test_scores_are_those_of_one_joint_gaussian(linear_problem, moments_of_measurements, groups, is_driven):
    p = linear_problem
    problem = JointProblem(p.process, p.sensors, [[p.timeline]], p.prior)
    problem = with_independent_speeds(problem) if groups is STATIONARY else problem
    problem = with_driven_positions(problem) if is_driven else problem
    measured, mean, covariance = moments_of_measurements(problem)
    # A covariance is linear in squares of factors, so that this is its derivative by the logarithm of one.
    by_factor = [
        moments_of_measurements(scaled(problem, groups, 3.0 ** (0.5 * one)))[2] - covariance
        for one in np.eye(len(groups))
    ]
    weight, inverse = np.linalg.solve(covariance, measured - mean), np.linalg.inv(covariance)
    probable = np.array([by @ weight for by in by_factor])
    scores = noise_scores(*filtered_with(problem, np.zeros(len(groups)), groups), groups)
    expected = [0.5 * (weight @ by @ weight - np.sum(inverse * by)) for by in by_factor]
    assert_allclose(scores.slope, expected, rtol=1e-7, atol=1e-7)
    assert_allclose(scores.information, 0.5 * probable @ inverse @ probable.T, rtol=1e-6, atol=1e-9)


def with_driven_positions(problem):
    """The problem with noise of the speeds that also moves the positions until the next event."""
    driven = np.zeros((N_MOVING, N_MOVING))
    driven[0, 2] = driven[1, 3] = 1.0
    return problem._replace(process=problem.process._replace(driven=driven))


def test_the_slope_by_an_initial_deviation_is_that_of_the_likelihood(problem):
    problem, at = with_independent_speeds(problem), np.array([0.3, 0.6, -0.2])
    scores = noise_scores(*filtered_with(problem, at, STATIONARY), STATIONARY)
    assert_allclose(scores.slope, differences(problem, at, STATIONARY), rtol=1e-6, atol=1e-6)


@compile_later(TRANSITION_SIGNATURE)
def _fading_carts(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """Two positions that parameters and two speeds move; the speeds fade, at the rates behind the mixing."""
    elapsed, n_parameters = substep_duration.sum(), mean.size - N_MOVING
    for i in range(n_parameters, mean.size):
        for j in range(mean.size):
            matrix[i, j] = 0.0
    for axis in range(2):
        rate, position, speed = constants[2 * n_parameters + axis], n_parameters + axis, n_parameters + 2 + axis
        for j in range(n_parameters):
            matrix[position, j] = elapsed * constants[axis * n_parameters + j]
        matrix[position, position], matrix[speed, speed] = 1.0, np.exp(-rate * elapsed)
        matrix[position, speed] = -np.expm1(-rate * elapsed) / rate
    # Positions first, because they depend on the speeds before.
    for i in range(n_parameters, mean.size):
        moved = 0.0
        for j in range(mean.size):
            moved += matrix[i, j] * mean[j]
        mean[i] = moved


RATES = np.array([1.5, 0.4])


def fading(problem, with_decay):
    """The problem with speeds that fade, which nothing is known to begin with but that there are hardly any."""
    process, n = problem.process, problem.n_parameters
    decay = np.concatenate([np.zeros(2), RATES]) if with_decay else np.zeros(0)
    process = process._replace(
        transition=_fading_carts(), constants=np.concatenate([process.constants, RATES]), decay=decay
    )
    factor = problem.prior.factor.copy()
    for place in problem.indices:
        factor[place[n + 2 :]] = 0.0
        factor[place[n + 2 :], place[n + 2 :]] = 1e-6
    mean = np.where(np.diagonal(factor) < 1e-5, 0.0, problem.prior.mean)
    return problem._replace(process=process, prior=Gaussian(mean, factor))


def groups_of_fading(problem):
    first = problem.process.constants.size - 2
    timed = (NoiseGroup(moving=(2 + axis,), rates=(first + axis,)) for axis in range(2))
    return NoiseGroup(moving=(0, 1)), NoiseGroup(moving=(2, 3)), *timed, NoiseGroup(sensor=0)


@pytest.mark.parametrize("is_driven", [False, True], ids=["", "driven"])
@pytest.mark.parametrize("with_decay", [True, False])
def test_the_slope_by_a_time_constant_is_that_of_the_likelihood(problem, with_decay, is_driven):
    faded = fading(with_driven_positions(problem) if is_driven else problem, with_decay)
    at = np.array([0.3, -0.7, 0.5, -0.4, 0.2])
    groups = groups_of_fading(faded)
    scores = noise_scores(*filtered_with(faded, at, groups), groups)
    assert_allclose(scores.slope, differences(faded, at, groups), rtol=2e-4, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("is_driven", [False, True], ids=["", "driven"])
def test_time_constant_scores_are_those_of_one_joint_gaussian(linear_problem, moments_of_measurements, is_driven):
    p = linear_problem
    problem = fading(JointProblem(p.process, p.sensors, [[p.timeline]], p.prior), with_decay=False)
    problem = with_driven_positions(problem) if is_driven else problem
    problem = problem._replace(prior=problem.prior._replace(mean=np.zeros_like(problem.prior.mean)))
    groups = groups_of_fading(problem)
    measured, mean, covariance = moments_of_measurements(problem)

    def covariances(change):
        ahead, behind = (moments_of_measurements(scaled(problem, groups, np.exp(by)))[2] for by in (change, -change))
        return (ahead - behind) / (2.0 * np.abs(change).max())

    weight, inverse = np.linalg.solve(covariance, measured - mean), np.linalg.inv(covariance)
    probable = np.array([covariances(way) @ weight for way in 1e-3 * np.eye(len(groups))])
    scores = noise_scores(*filtered_with(problem, np.zeros(len(groups)), groups), groups)
    expected = 0.5 * probable @ inverse @ probable.T
    assert_allclose(scores.information, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())
