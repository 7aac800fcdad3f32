"""Derivatives of the likelihood by its noise, against differences of it and against one big Gaussian."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.linear_smoothing import LinearSmoothing, Trajectory
from auvid_cli.filters.noise_likelihood import scaled
from auvid_cli.filters.noise_scores import NoiseGroup, noise_scores
from auvid_cli.filters.segments import JointProblem, joint_gaussian

N_MOVING = 4
GROUPS = (NoiseGroup(moving=(0, 1)), NoiseGroup(moving=(2, 3)), NoiseGroup(sensor=0), NoiseGroup(sensor=1))


@pytest.fixture(params=[[0, 30], [0, 13, 30]], ids=["one segment", "two segments"])
def problem(request, linear_problem, events_of):
    p, cuts = linear_problem, request.param
    segments = [
        [events_of(p.timeline, k, min(k + 6, last)) for k in range(first, last, 6)] for first, last in pairwise(cuts)
    ]
    return JointProblem(p.process, p.sensors, segments, joint_gaussian([p.prior] * len(segments), N_MOVING))


def filtered_with(problem, logarithms):
    """The smoothing of a problem with other noise, what it filters about a point, and that problem."""
    changed = scaled(problem, GROUPS, np.exp(logarithms))
    smoothing = LinearSmoothing(changed)
    moving = [[np.zeros((t.time.size, N_MOVING)) for t in segment] for segment in problem.segments]
    initial = [np.zeros(N_MOVING) for _ in problem.segments]
    return smoothing, smoothing.filter(Trajectory(np.zeros(problem.n_parameters), initial, moving)), changed


def log_likelihood(problem, logarithms):
    _, filtered, _ = filtered_with(problem, logarithms)
    return -0.5 * (filtered.least + filtered.log_determinant)


def test_the_slope_is_that_of_the_likelihood(problem):
    at, step = np.array([0.3, -0.7, 0.2, 0.5]), 1e-3

    def difference(way):
        return (log_likelihood(problem, at + way) - log_likelihood(problem, at - way)) / (2.0 * step)

    # Of two differences, what does not go with the square of the step.
    expected = [(8.0 * difference(way) - difference(2.0 * way)) / 6.0 for way in step * np.eye(len(GROUPS))]
    scores = noise_scores(*filtered_with(problem, at), GROUPS)
    assert_allclose(scores.slope, expected, rtol=1e-6, atol=1e-6)


def test_they_are_those_of_one_big_gaussian(linear_problem, moments_of_measurements):
    p = linear_problem
    problem = JointProblem(p.process, p.sensors, [[p.timeline]], p.prior)
    measured, mean, covariance = moments_of_measurements(problem)
    # A covariance is linear in squares of factors, so that this is its derivative by the logarithm of one.
    by_factor = [
        moments_of_measurements(scaled(problem, GROUPS, 3.0 ** (0.5 * one)))[2] - covariance
        for one in np.eye(len(GROUPS))
    ]
    weight, inverse = np.linalg.solve(covariance, measured - mean), np.linalg.inv(covariance)
    probable = np.array([by @ weight for by in by_factor])
    scores = noise_scores(*filtered_with(problem, np.zeros(len(GROUPS))), GROUPS)
    expected = [0.5 * (weight @ by @ weight - np.sum(inverse * by)) for by in by_factor]
    assert_allclose(scores.slope, expected, rtol=1e-7, atol=1e-7)
    assert_allclose(scores.information, 0.5 * probable @ inverse @ probable.T, rtol=1e-6, atol=1e-9)
