"""The estimate of each segment is that from its data alone, and differences have the stated deviation."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.problem import JointProblem, joint_gaussian
from auvid_cli.filters.smoother import other_minimum, run_smoother


@pytest.fixture
def two_segments(linear_problem, events_of):
    """A problem cut into two segments with the same prior."""
    p, t = linear_problem, linear_problem.timeline
    middle = t.time.size // 2
    halves = [[events_of(t, 0, middle)], [events_of(t, middle, t.time.size)]]
    prior = joint_gaussian([p.prior, p.prior], p.process.noise_density.size)
    return p, halves, prior


def final(records, outcome, n):
    return records[-1].mean[-1, :n], np.diagonal(outcome.covariance)[:n]


def smoothed(problem, segments, prior, n):
    records = []
    joint = JointProblem(problem.process, problem.sensors, segments, prior)
    outcome = run_smoother(joint, lambda timeline, chunk: records.append(chunk))
    return *final(records, outcome, n), outcome


@pytest.mark.slow
def test_segment_estimate_is_that_of_the_segment_alone(two_segments):
    problem, halves, prior = two_segments
    n = problem.prior.mean.size - problem.process.noise_density.size
    together, variance, outcome = smoothed(problem, halves, prior, n)
    assert [other.begin for other in outcome.others] == [half[0].time[0] for half in halves]
    for half, other in zip(halves, outcome.others, strict=True):
        alone, own_variance, _ = smoothed(problem, [half], problem.prior, n)
        deviation = np.sqrt(own_variance)
        assert_allclose(other.difference / deviation, (alone - together) / deviation, atol=1e-7)
        assert_allclose(other.deviation**2, own_variance - variance, rtol=1e-5)
        assert_allclose(other.moved, other.deviation * variance / own_variance)


@pytest.mark.slow
def test_single_segment_has_no_alternatives(linear_problem):
    p = linear_problem
    outcome = run_smoother(JointProblem(p.process, p.sensors, [[p.timeline]], p.prior), lambda timeline, chunk: None)
    assert outcome.others == ()


def found(parameters, cost, deviation=0.5):
    """Parameters, covariance and cost of a fit."""
    final = SimpleNamespace(mean=np.array([0.0, 1.0, 9.0]), covariance=lambda: np.eye(3) * deviation**2)
    return SimpleNamespace(trajectory=SimpleNamespace(parameters=np.array(parameters)), final=final, cost=cost)


def test_distant_probable_minimum_is_reported():
    answer = found([1.0, 2.0], cost=100.0)
    other = other_minimum(answer, found([1.0, 4.0], cost=101.0))
    assert_allclose(other.difference, [0.0, 2.0])
    assert_allclose(other.deviation, [0.5, 0.5])
    assert other_minimum(answer, found([1.0, 4.0], cost=110.0)) is None
    assert other_minimum(answer, found([1.4, 2.4], cost=100.0)) is None
