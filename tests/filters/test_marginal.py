"""Parameters whatever the motion was, against the likelihood of a model that is linear once they are known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from auvid_cli.filters.linear_smoother import LinearSmoothing
from auvid_cli.filters.marginal import _accelerated, integrate_out_motion
from auvid_cli.filters.problem import (
    LINEARISATION_SIGNATURE,
    OBSERVATION_SIGNATURE,
    OK,
    PROCESS_SIGNATURE,
    TRANSITION_SIGNATURE,
    Gaussian,
    JointProblem,
    Process,
    Sensors,
    Timeline,
)
from auvid_cli.filters.signatures import FaultEffects
from auvid_cli.filters.smoother import most_probable, run_smoother
from auvid_cli.numerics import LANES
from tests.filters.compile_later import compile_later

N, STEP, DENSITY, NOISE = 400, 0.5, 1.0, 0.7
TRUE = np.array([0.6, 0.3])


@compile_later(PROCESS_SIGNATURE)
def _advance(moving, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    """A velocity that decays at the rate of the first parameter."""
    for k in range(n_lanes):
        moving[k] *= 1.0 - duration * parameters[k]


@compile_later(TRANSITION_SIGNATURE)
def _transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    for j in range(3):
        matrix[2, j] = 1.0 if j == 2 else 0.0
    for duration in substep_duration:
        matrix[2, 0] = (1.0 - duration * mean[0]) * matrix[2, 0] - duration * mean[2]
        matrix[2, 2] *= 1.0 - duration * mean[0]
        mean[2] *= 1.0 - duration * mean[0]


@compile_later(OBSERVATION_SIGNATURE)
def _observe(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch):
    """A scale that is off by the second parameter."""
    for k in range(n_lanes):
        predicted[k] = (1.0 + parameters[LANES + k]) * moving[k]


@compile_later(LINEARISATION_SIGNATURE)
def _linearise(mean, sensor, inputs, constants, selection, predicted, matrix, scratch):
    predicted[0] = (1.0 + mean[1]) * mean[2]
    matrix[0, 0], matrix[0, 1], matrix[0, 2] = 0.0, mean[2], 1.0 + mean[1]


def simulated(rng):
    """Both sensors, one after the other at each time."""
    x, measured = 1.0, []
    for k in range(N):
        x = (1.0 - STEP * TRUE[0]) * x + DENSITY * np.sqrt(STEP) * rng.standard_normal() if k else x
        measured += [(1.0 + TRUE[1]) * x, x]
    return np.array(measured) + NOISE * rng.standard_normal(2 * N)


def problem_of(measured, cut):
    """Segments that end after these events."""

    def timeline(first, last):
        count = last - first
        return Timeline(
            time=STEP * np.arange(first, last, dtype=float),
            substep_offset=np.arange(count + 1) - (np.arange(count + 1) > 0),
            substep_duration=np.full(count - 1, STEP),
            substep_input=np.zeros(count - 1, dtype=np.int64),
            inputs=np.zeros((1, 1)),
            event_input=np.zeros(count, dtype=np.int64),
            measurement_offset=2 * np.arange(count + 1),
            measurement_sensor=np.tile(np.array([0, 1], dtype=np.int8), count),
            measurement=measured[2 * first : 2 * last, None].copy(),
        )

    process = Process(_advance(), _transition(), np.zeros(1), np.zeros(0, dtype=np.int64), np.array([DENSITY]))
    process = process._replace(observe=_observe(), linearise=_linearise())
    matrix = np.zeros((2, 1, 3))
    matrix[1, 0, 2] = 1.0
    sensors = Sensors(matrix, np.full((2, 1), NOISE**2), np.zeros((2, 1), dtype=np.bool_), np.array([True, False]))
    segments = [[timeline(first, last)] for first, last in zip([0, *cut], [*cut, N], strict=True)]
    n_joint = 2 + len(segments)
    return JointProblem(process, sensors, segments, Gaussian(np.zeros(n_joint), np.eye(n_joint)))


def minus_twice_log_posterior(parameters, measured, cut, left=1.0, fault=0.0):
    """By a Kalman filter; `left` is the share of the process noise that is there at the end of an interval."""
    decay, scale = parameters
    total, mean, variance, shrunk = parameters @ parameters, 0.0, 1.0, 1.0 - STEP * decay
    for k in range(N):
        if k in cut:
            mean, variance = 0.0, 1.0
        elif k:
            mean, variance = shrunk * mean, shrunk**2 * variance + left * DENSITY**2 * STEP
        for h, value in zip((1.0 + scale, 1.0 + fault), measured[2 * k : 2 * k + 2], strict=True):
            s = h * h * variance + NOISE**2
            total += (value - h * mean) ** 2 / s + np.log(s)
            mean, variance = mean + variance * h / s * (value - h * mean), variance * NOISE**2 / s
    return total


class ScaleOfThePlainSensor:
    labels = ("scale",)

    def effects(self, segment, timeline, about):
        added = np.zeros((*timeline.measurement.shape, 1))
        added[1::2, 0, 0] = about.moving[:, 0]
        return FaultEffects(np.zeros((*about.moving.shape, 1)), added)


def answer_of(problem, marginal):
    """The outcome, and the last state with its standard deviation."""
    chunks = []
    outcome = run_smoother(
        problem, lambda timeline, records: chunks.append(records), 50, ScaleOfThePlainSensor(), marginal
    )
    assert outcome.failure == OK
    return outcome, chunks[-1].mean[-1], chunks[-1].standard_deviation[-1]


@pytest.mark.slow
@pytest.mark.parametrize("cut", [(), (150, 270)], ids=["one segment", "three segments"])
def test_marginal_estimate_maximises_the_likelihood(cut, rng):
    measured = simulated(rng)
    outcomes, means, deviations = zip(*(answer_of(problem_of(measured, cut), m) for m in (False, True)), strict=True)
    # It forgets the noise as fast as the motion is by the joint answer.
    forgotten = 2.0 * means[0][0] * STEP
    args = measured, cut, (1.0 - np.exp(-forgotten)) / forgotten
    best = minimize(minus_twice_log_posterior, TRUE, args, "Nelder-Mead", options={"xatol": 1e-5}).x
    joint, marginal = (np.abs((m[:2] - best) / d[:2]) for m, d in zip(means, deviations, strict=True))
    assert joint.max() > 1.0
    assert marginal.max() < 0.2
    scores = outcomes[-1].faults
    # Profile of the posterior over the size of the fault.
    gained = [
        minimize(minus_twice_log_posterior, best, (*args, fault), "Nelder-Mead", options={"xatol": 1e-6}).fun
        for fault in (-0.005, 0.005)
    ]
    score = (gained[0] - gained[1]) / 0.02
    assert abs(scores.score[0] - score) < 0.2 * np.sqrt(scores.information[0, 0])


@pytest.mark.slow
def test_too_few_steps_report_convergence_status(rng):
    problem = problem_of(simulated(rng), ())
    smoothing = LinearSmoothing(problem)
    (joint, _), *_ = most_probable(problem, smoothing, 50)
    found, few = integrate_out_motion(problem, smoothing, joint, 50), integrate_out_motion(problem, smoothing, joint, 1)
    assert found is not None
    assert few is not None
    (late, settled, *_), (early, convergence, *_) = found, few
    assert settled is None
    assert convergence is not None
    deviation = np.sqrt(np.diagonal(joint.final.covariance())[:2])
    to_go = late.trajectory.parameters - early.trajectory.parameters
    # The remaining distance is less than the last step, because steps become shorter.
    assert (np.abs(to_go) < np.abs(convergence.step * deviation)).all()


def test_acceleration_ends_an_iteration_that_is_linear(rng):
    """With as many steps as parameters, Anderson's method finds the fixed point, even if plain steps lead away."""
    rate, fixed = -1.5 * np.eye(3) + 0.3 * rng.standard_normal((3, 3)), rng.standard_normal(3)
    made, x = [], np.zeros(3)
    for move in rng.standard_normal((3, 3)):
        made.append((rate @ (x - fixed), move))
        x = x + move
    assert_allclose(x + _accelerated(made, rate @ (x - fixed), np.array([1.0, 10.0, 0.1])), fixed, atol=1e-9)


@pytest.mark.parametrize("rough_motion", [False, True], ids=["exact", "rough"])
@pytest.mark.parametrize("start", [(0.01, 0.0), (1.5, -0.5), (0.3, 2.0), (3.0, 1.0)])
def test_no_step_lowers_the_likelihood_far_from_the_estimate(start, rough_motion, rng):
    measured = simulated(rng)
    problem = problem_of(measured, ())
    smoothing = LinearSmoothing(problem)
    (joint, _), *_ = most_probable(problem, smoothing, 50)
    at = smoothing.filter(replace(joint.trajectory, parameters=np.array(start)))
    assert at is not None
    objective = minus_twice_log_posterior(np.array(start), measured, ())
    constants = list[float]()
    for _ in range(20):
        was_at_minimum = at.cost - at.least < 0.01
        found = integrate_out_motion(problem, smoothing, at, 1, rough_motion)
        assert found is not None
        at, convergence, gain, minus_twice_log = found
        before, objective = objective, minus_twice_log_posterior(at.trajectory.parameters, measured, ())
        constants.append(minus_twice_log - objective)
        # Once the parameters are known the model is linear, and the approximation is exact.
        assert gain == pytest.approx(0.5 * (before - objective), abs=0.01)
        # A rough step trusts the objective less if it starts far from the minimum of the linear problem.
        assert gain > -0.01 or (rough_motion and not was_at_minimum)
        if convergence is None or convergence.is_negligible:
            break
    assert convergence is None or convergence.is_negligible
    assert constants == pytest.approx([constants[0]] * len(constants), abs=0.02)
