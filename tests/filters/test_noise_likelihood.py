"""The likelihood of noise against one big Gaussian, and what is found of noise that was simulated."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_triangular
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal

from auvid_cli.filters.linear_smoother import LinearSmoothing, Trajectory, gauss_newton
from auvid_cli.filters.noise_likelihood import (
    NoiseLikelihood,
    NoiseProgress,
    TrajectoryStep,
    log_likelihood,
    scaled,
)
from auvid_cli.filters.noise_scores import NoiseGroup, NoiseScores
from auvid_cli.filters.noise_search import _climb, _end_of_interval, _intervals, _search, most_likely_noise
from auvid_cli.filters.problem import (
    PROCESS_SIGNATURE,
    TRANSITION_SIGNATURE,
    Gaussian,
    JointProblem,
    Process,
    Sensors,
    Timeline,
)
from tests.filters.compile_later import compile_later

INFORMATION = 100.0
GROUPS = (NoiseGroup(moving=(0, 1)), NoiseGroup(moving=(2, 3)), NoiseGroup(sensor=0))


def joint(problem):
    return JointProblem(problem.process, problem.sensors, [[problem.timeline]], problem.prior)


@pytest.mark.parametrize("is_driven", [False, True], ids=["", "driven"])
@pytest.mark.parametrize("factors", [(1.0, 1.0, 1.0), (0.3, 2.0, 0.7)])
def test_likelihood_is_that_of_one_joint_gaussian(linear_problem, moments_of_measurements, factors, is_driven):
    problem = scaled(joint(linear_problem), GROUPS, np.array(factors))
    if is_driven:
        driven = np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(2))  # noise of the speeds moves the positions too
        problem = problem._replace(process=problem.process._replace(driven=driven))
    n, events = linear_problem.prior.mean.size, linear_problem.timeline.time.size
    n_moving = problem.n_moving
    nowhere = Trajectory(np.zeros(n - n_moving), [np.zeros(n_moving)], [[np.zeros((events, n_moving))]])
    filtered = LinearSmoothing(problem).filter(nowhere)
    measured, mean, covariance = moments_of_measurements(problem)
    expected = -2.0 * multivariate_normal(mean, covariance).logpdf(measured) - measured.size * np.log(2.0 * np.pi)
    assert_allclose(filtered.least + filtered.log_determinant, expected, rtol=1e-8)


@pytest.mark.parametrize("least", [-14.0, 1.0])
def test_start_follows_from_the_nis_of_each_sensor(linear_problem, moments_of_measurements, least):
    problem, n = joint(linear_problem), linear_problem.prior.mean.size
    n_moving, timeline = problem.n_moving, linear_problem.timeline
    nowhere = Trajectory(np.zeros(n - n_moving), [np.zeros(n_moving)], [[np.zeros((timeline.time.size, n_moving))]])
    sensors = np.unique(timeline.measurement_sensor)
    groups = [NoiseGroup(sensor=sensor, min_log_factor=least) for sensor in sensors]
    likelihood = NoiseLikelihood(problem, [*groups, NoiseGroup(moving=(0, 1))], lambda progress: None)
    found = likelihood.start_from_innovations(likelihood.filter(np.zeros(sensors.size + 1), nowhere))
    measured, mean, covariance = moments_of_measurements(problem)
    # The factor of the covariance makes each measurement independent of those before, which gives the innovations.
    squares = solve_triangular(np.linalg.cholesky(covariance), measured - mean, lower=True) ** 2
    component = np.isfinite(timeline.measurement)
    of = np.broadcast_to(timeline.measurement_sensor[:, None], component.shape)[component]
    nis = np.array([squares[of == sensor].mean() for sensor in sensors])
    assert_allclose(found[:-1], np.maximum(0.5 * np.log(nis), least), atol=1e-8)
    assert_allclose(found[-1], 0.5 * np.log(nis).mean(), atol=1e-8)


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_wrong_noise_is_estimated(linear_problem, moments_of_measurements, rng):
    """Measurements are drawn with the true noise; then the problem states three times as much, or less."""
    _, mean, covariance = moments_of_measurements(joint(linear_problem))
    drawn, t = mean + np.linalg.cholesky(covariance) @ rng.standard_normal(mean.size), linear_problem.timeline
    measurement = t.measurement.copy()
    measurement[~np.isnan(measurement)] = drawn
    p = joint(linear_problem)._replace(segments=[[t._replace(measurement=measurement)]])
    groups = NoiseGroup(moving=(0, 1, 2, 3)), *(NoiseGroup(sensor=s) for s in range(len(p.sensors.matrix)))
    wrong = np.array([3.0, *np.resize([0.3, 3.0], len(groups) - 1)])
    found = most_likely_noise(scaled(p, groups, wrong), groups, 20)
    assert found.converged
    assert found.gain > 0.0
    within = (found.low <= 1.0 / wrong) & (1.0 / wrong <= found.high)
    assert within.sum() >= len(groups) - 1
    assert (np.abs(np.log(found.factor * wrong))[1:] < 1.0).all()


@compile_later(PROCESS_SIGNATURE)
def _fade(moving, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    """A velocity that forgets at a rate that is known."""
    for k in range(n_lanes):
        moving[k] *= np.exp(-constants[0] * duration)


@compile_later(TRANSITION_SIGNATURE)
def _fading(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    left = np.exp(-constants[0] * substep_duration.sum())
    matrix[1, 0], matrix[1, 1] = 0.0, left
    mean[1] *= left


@pytest.mark.slow
def test_density_is_that_of_noise_that_acts_all_along(rng):
    """A velocity forgets much from one measurement to the next; its exact likelihood says how it is driven."""
    n, interval, rate, noise = 400, 0.5, 1.6, 0.1
    left = np.exp(-rate * interval)

    def spread(density):
        return density * np.sqrt((1.0 - left**2) / (2.0 * rate))

    x, measured = 0.0, np.zeros(n)
    for k in range(n):
        x = left * x + spread(1.0) * rng.standard_normal() if k else rng.standard_normal()
        measured[k] = x + noise * rng.standard_normal()

    def minus_twice_log_likelihood(logarithm):
        total, mean, variance = 0.0, 0.0, 1.0
        for k in range(n):
            if k:
                mean, variance = left * mean, left**2 * variance + spread(np.exp(logarithm)) ** 2
            s = variance + noise**2
            total += (measured[k] - mean) ** 2 / s + np.log(s)
            mean, variance = mean + variance / s * (measured[k] - mean), variance * noise**2 / s
        return total

    exact = np.exp(minimize_scalar(minus_twice_log_likelihood, (-1.0, 0.0, 1.0)).x)
    timeline = Timeline(
        time=interval * np.arange(n),
        substep_offset=np.arange(n + 1) - (np.arange(n + 1) > 0),
        substep_duration=np.full(n - 1, interval),
        substep_input=np.zeros(n - 1, dtype=np.int64),
        inputs=np.zeros((1, 1)),
        event_input=np.zeros(n, dtype=np.int64),
        measurement_offset=np.arange(n + 1),
        measurement_sensor=np.zeros(n, dtype=np.int8),
        measurement=measured[:, None],
    )
    # The parameter does nothing.
    process = Process(_fade(), _fading(), np.array([rate]), np.zeros(0, dtype=np.int64), np.array([2.0]))
    linear = np.zeros((1, 1), dtype=np.bool_)
    sensors = Sensors(np.array([[[0.0, 1.0]]]), np.full((1, 1), noise**2), linear, linear[0])
    problem = JointProblem(process, sensors, [[timeline]], Gaussian(np.zeros(2), np.eye(2)))
    found = most_likely_noise(problem, [NoiseGroup(moving=(0,))], 20)
    assert 2.0 * found.factor[0] == pytest.approx(exact, rel=0.01)
    assert 2.0 * found.low[0] < 1.0 < 2.0 * found.high[0]


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_exception_of_callback_ends_the_search(linear_problem):
    class Enough(Exception):
        pass

    def count(progress):
        raise Enough

    with pytest.raises(Enough):
        most_likely_noise(joint(linear_problem), GROUPS, 20, count)


@pytest.mark.parametrize(("left", "begins_at_none"), [(1.0, True), (3.0, False)])
def test_interval_begins_at_zero_if_others_compensate(left, begins_at_none):
    """Without this noise the log-likelihood is lower by 5, or by `left` if the others compensate."""

    def below(logarithms):
        return 5.0 * (1.0 - np.exp(logarithms[0])) ** 2

    low, high = _intervals(below, lambda i: left, np.zeros(1), np.array([[4.0]]))
    assert (low[0] == 0.0) == begins_at_none
    expected = np.log1p(np.sqrt(1.92 / 5.0)) if begins_at_none else 1.96 / 2.0
    assert np.log(high[0]) == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_fixed_factor_stays_and_others_are_optimised(linear_problem):
    likelihood = NoiseLikelihood(joint(linear_problem), GROUPS, lambda progress: None)
    n, n_moving = linear_problem.prior.mean.size, joint(linear_problem).n_moving
    events = linear_problem.timeline.time.size
    nowhere = Trajectory(np.zeros(n - n_moving), [np.zeros(n_moving)], [[np.zeros((events, n_moving))]])
    start = np.array([0.0, -1.0, 0.0])
    found = _climb(likelihood, start, nowhere, np.array([True, False, True])).log_factor
    assert found[1] == -1.0
    assert (found[[0, 2]] != 0.0).all()
    best = likelihood.at(found, nowhere)
    for change in (0.3, -0.3):
        for group in (0, 2):
            assert likelihood.at(found + change * np.eye(3)[group], nowhere) < best + 0.02


class AlternatingLikelihood:
    """Log-likelihood of a log factor with its maximum at 1 - feedback * trajectory; the trajectory is a number.

    One step sets the trajectory to the log factor.
    """

    def __init__(self, feedback):
        self.feedback, self.minimum, self.x, self.histories = feedback, np.array([-14.0]), 0.0, []
        self.progress = NoiseProgress(0, 0, np.zeros(1), -np.inf, 0.0, None, 0.0)

    def filter(self, logarithms, trajectory):
        self.x, self.maximum = logarithms[0], 1.0 - self.feedback * trajectory
        least = INFORMATION * (self.x - self.maximum) ** 2
        return SimpleNamespace(trajectory=trajectory, least=least, log_determinant=0.0)

    def at(self, logarithms, trajectory):
        return log_likelihood(self.filter(logarithms, trajectory))

    def scores(self, filtered):
        return NoiseScores(np.array([INFORMATION * (self.maximum - self.x)]), np.array([[INFORMATION]]))

    def one_step(self, filtered, is_coarse, history):
        self.histories.append(history)
        return TrajectoryStep(self.x, gain=0.0, objective=0.0)

    def set_share(self, share):
        pass

    def set_process_memory(self, trajectory):
        pass


@pytest.mark.parametrize(("feedback", "converges"), [(0.0, True), (0.5, True), (0.95, False)])
def test_search_ends_where_noise_and_trajectory_agree(feedback, converges):
    likelihood = AlternatingLikelihood(feedback)
    found = _search(likelihood, np.zeros(1), 0.0, is_coarse=False)
    assert found.converged == likelihood.progress.converged == converges
    # Fixed point of x = 1 - feedback * x.
    fixed = 1.0 / (1.0 + feedback)
    assert (found.log_factor[0] == pytest.approx(fixed, abs=0.4 / np.sqrt(INFORMATION))) == converges


def test_steps_but_the_first_are_accelerated_by_those_before():
    likelihood = AlternatingLikelihood(0.95)
    _search(likelihood, np.zeros(1), 0.0, is_coarse=False)
    first, second, *later = likelihood.histories
    assert first is None
    assert second == []
    assert all(history is second for history in later)
    likelihood.histories.clear()
    _search(likelihood, np.zeros(1), 0.0, is_coarse=True)
    assert set(likelihood.histories) == {None}


def test_search_starts_from_the_stated_noise_if_that_from_innovations_has_no_finite_cost():
    class Bounded(AlternatingLikelihood):
        def start_from_innovations(self, filtered):
            return np.array([5.0])

        def filter(self, logarithms, trajectory):
            return None if logarithms[0] > 4.0 else super().filter(logarithms, trajectory)

    assert _search(Bounded(0.0), None, 0.0, is_coarse=False).log_factor[0] == pytest.approx(1.0, abs=0.01)


class MisleadingLikelihood(AlternatingLikelihood):
    """The objective is least at log factors of 1. About later trajectories the likelihood has its maximum elsewhere.

    Far from 1 a step does not even exist if `diverges`.
    """

    def __init__(self, preferred, diverges):
        super().__init__(0.0)
        self.preferred, self.diverges, self.n_steps, self.kept = preferred, diverges, 0, []

    def filter(self, logarithms, trajectory):
        found = super().filter(logarithms, trajectory)
        # An interrupt in this pass keeps this noise.
        self.kept.append(self.progress.log_factor[0])
        if self.n_steps:
            self.maximum = self.preferred
            found.least = INFORMATION * (self.x - self.preferred) ** 2 - 1000.0
        return found

    def one_step(self, filtered, is_coarse, history):
        self.n_steps += 1
        if self.diverges and abs(self.x - 1.0) > 1.0:
            return None
        return TrajectoryStep(self.x, gain=0.0, objective=INFORMATION * (self.x - 1.0) ** 2)


@pytest.mark.parametrize("diverges", [False, True])
@pytest.mark.parametrize("preferred", [-8.0, 8.0])
def test_noise_that_lowers_the_posterior_is_rejected(preferred, diverges):
    likelihood = MisleadingLikelihood(preferred, diverges)
    found = _search(likelihood, np.zeros(1), 0.0, is_coarse=False)
    assert not found.converged
    assert found.log_factor[0] == pytest.approx(1.0, abs=0.1)
    assert found.level == likelihood.at(found.log_factor, found.trajectory)
    assert not found.has_intervals
    # Also after the first rejection the search went on: two steps with the noise before, and two with that rejected.
    assert likelihood.n_steps == 4
    assert likelihood.progress.log_factor[0] == found.log_factor[0]
    assert max(abs(kept) for kept in likelihood.kept) < 2.0


@pytest.mark.parametrize(("excess", "is_answer"), [(0.05, True), (0.5, False)])
@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_search_without_passes_left_has_an_answer_if_its_cost_can_hardly_fall(linear_problem, excess, is_answer):
    """The problem is linear: one step leads to the minimum, and the cost grows with the square of the way from it."""
    problem = joint(linear_problem)
    smoothing, n = LinearSmoothing(problem), problem.n_parameters
    shape = linear_problem.timeline.time.size, problem.n_moving
    nowhere = Trajectory(np.zeros(n), [np.zeros(shape[1])], [[np.zeros(shape)]])
    first = smoothing.filter(nowhere)
    minimum = nowhere.stepped(smoothing.step(first), 1.0)
    way = Trajectory(np.zeros(n), [np.zeros(shape[1])], [[np.ones(shape)]])
    at_one = smoothing.filter(minimum.stepped(way, 1.0))
    start = minimum.stepped(way, np.sqrt(excess / (at_one.cost - at_one.least)))
    stopped, answered = gauss_newton(smoothing, start, max_passes=1)
    assert_allclose(stopped.cost - stopped.least, excess, rtol=1e-6)
    assert answered == is_answer


@pytest.mark.parametrize("growth", [0.5, 5.0, 50.0])
def test_end_of_an_interval_of_a_quadratic_in_the_variance_is_found(growth):
    """From a curvature that is wrong by a factor of ten."""
    evaluated = []

    def decrease(change):
        evaluated.append(change)
        return 1.92 * (np.expm1(2.0 * change) / growth) ** 2

    found = _end_of_interval(decrease, 0.1 * (2.0 * 1.96 / growth) ** 2, 14.0)
    assert found == pytest.approx(0.5 * np.log1p(growth), abs=0.05)
    assert len(evaluated) <= 5


@pytest.mark.parametrize("power", [1, 2, 3])
@pytest.mark.parametrize("end", [9.0, 15.0, 20.0])
def test_end_of_an_interval_far_above_the_estimate_is_found(end, power):
    def decrease(change):
        return 1.92 * (np.expm1(2.0 * change) / np.expm1(2.0 * end)) ** power

    assert _end_of_interval(decrease, 0.0, 28.0) == pytest.approx(end, abs=0.1)


def test_interval_without_an_end_is_infinite():
    assert _end_of_interval(lambda change: 0.5, 4.0, 14.0) == np.inf
    assert _end_of_interval(lambda change: 5.0, 4.0, 0.0) == np.inf
