"""Influences of measurements against what batch estimators themselves say of their covariance and of their answer."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters import output_error
from auvid_cli.filters.least_squares import Information, fit_free_motion
from auvid_cli.filters.linear_smoother import LinearSmoothing
from auvid_cli.filters.problem import Gaussian, JointProblem, joint_gaussian
from auvid_cli.filters.signatures import Signatures
from auvid_cli.filters.smoother import most_probable

N_MOVING, EVENTS = 4, 30


@pytest.fixture(params=["one segment", "two segments"])
def problem(request, linear_problem, events_of):
    """In chunks of seven events."""
    p, cuts, prior = linear_problem, [0, EVENTS], linear_problem.prior
    if request.param == "two segments":
        mean = np.append(prior.mean[:-N_MOVING], np.random.default_rng(5).standard_normal(N_MOVING))
        cuts, prior = [0, 13, EVENTS], joint_gaussian([prior, Gaussian(mean, prior.factor)], N_MOVING)
    segments = [
        [events_of(p.timeline, k, min(k + 7, last)) for k in range(first, last, 7)] for first, last in pairwise(cuts)
    ]
    return JointProblem(p.process, p.sensors, segments, prior)


def explained(segments):
    """Covariance that white residuals would leave, and what the residuals move."""
    chunks = [chunk for segment in segments for chunk in segment]
    rows, residual = (np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in ("rows", "residual"))
    times = [np.concatenate([chunk.time for chunk in segment]) for segment in segments]
    assert all((np.diff(time) >= 0.0).all() for time in times)
    return rows.T @ rows, rows.T @ residual


def test_smoother_influences_sum_to_the_covariance(problem):
    smoothing, n = LinearSmoothing(problem), problem.n_parameters
    ((answer, _), *_) = most_probable(problem, smoothing, 20)
    covariance = answer.final.covariance()[:n, :n]
    found = answer.trajectory.parameters + answer.final.mean[:n]
    factor = problem.prior.factor[:n, :n]
    known = np.linalg.inv(factor @ factor.T)
    variance, moved = explained(Signatures(problem, smoothing, answer).influences())
    size = np.sqrt(np.diagonal(covariance))
    assert_allclose(
        variance / np.outer(size, size),
        (covariance - covariance @ known @ covariance) / np.outer(size, size),
        atol=1e-5,
    )
    assert_allclose(moved / size, covariance @ known @ (found - problem.prior.mean[:n]) / size, atol=1e-5)


def test_output_error_influences_sum_to_the_covariance(problem):
    n, whole = (
        problem.n_parameters,
        (np.full(problem.prior.mean.size, -np.inf), np.full(problem.prior.mean.size, np.inf)),
    )
    fit = fit_free_motion(problem, problem.prior.mean, problem.prior, whole, 1e-12, 20)
    joint = fit.information.join(Information.of_gaussian(problem.prior, fit.state))
    uncertainty, known = joint.uncertainty(), np.linalg.inv(problem.prior.factor @ problem.prior.factor.T)
    variance, moved = explained(output_error.influence_functions(problem, fit.state, uncertainty))
    covariance = uncertainty.root @ uncertainty.root.T
    size = np.sqrt(np.diagonal(covariance))[:n]
    left = (covariance - covariance @ known @ covariance)[:n, :n]
    assert_allclose(variance / np.outer(size, size), left / np.outer(size, size), atol=1e-5)
    towards_prior = (covariance @ known @ (fit.state - problem.prior.mean))[:n]
    assert_allclose(moved / size, towards_prior / size, atol=1e-4)
