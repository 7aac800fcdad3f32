"""Parameters and faults whatever the motion was, where damping depends on the motion, against its exact likelihood."""

import numpy as np
import pytest
from scipy.optimize import minimize

from auvid_cli.filters.linear_smoother import LinearSmoothing
from auvid_cli.filters.marginal import integrate_out_motion
from auvid_cli.filters.marginal_gradient import marginal_scores
from auvid_cli.filters.problem import (
    PROCESS_SIGNATURE,
    TRANSITION_SIGNATURE,
    Gaussian,
    JointProblem,
    Process,
    Sensors,
    Timeline,
)
from auvid_cli.filters.signatures import FaultEffects, Signatures
from auvid_cli.filters.smoother import most_probable
from tests.filters.compile_later import compile_later

N, STEP, THRUST, DRAG, DENSITY, NOISE = 400, 0.1, 1.0, 0.5, 0.4, 0.05
START, SPREAD = 1.4, 0.3
CHUNK = 70
GRID = np.linspace(-0.2, 3.0, 321)


@compile_later(PROCESS_SIGNATURE)
def _advance(moving, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    """A velocity under a constant thrust and a drag by its square."""
    for k in range(n_lanes):
        moving[k] += duration * (1.0 - parameters[k] * moving[k] ** 2)


@compile_later(TRANSITION_SIGNATURE)
def _transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    matrix[1, 0], matrix[1, 1] = 0.0, 1.0
    for duration in substep_duration:
        slope = 1.0 - 2.0 * duration * mean[0] * mean[1]
        matrix[1, 0] = slope * matrix[1, 0] - duration * mean[1] ** 2
        matrix[1, 1] *= slope
        mean[1] += duration * (1.0 - mean[0] * mean[1] ** 2)


class Scale:
    labels = ("scale",)

    def effects(self, segment, timeline, about):
        return FaultEffects(np.zeros((*about.moving.shape, 1)), about.moving[:, None, :].copy())


def simulated(rng):
    x, measured = START, []
    for k in range(N):
        x += (STEP * (THRUST - DRAG * x**2) + DENSITY * np.sqrt(STEP) * rng.standard_normal()) if k else 0.0
        measured.append(x + NOISE * rng.standard_normal())
    return np.array(measured)


def problem_of(measured, cut):
    """Segments that end after these events, each in chunks."""

    def timeline(first, last, led):
        count = last - first
        return Timeline(
            time=STEP * np.arange(first, last, dtype=float),
            substep_offset=np.arange(count + 1) - (0 if led else (np.arange(count + 1) > 0)),
            substep_duration=np.full(count - (not led), STEP),
            substep_input=np.zeros(count - (not led), dtype=np.int64),
            inputs=np.zeros((1, 1)),
            event_input=np.zeros(count, dtype=np.int64),
            measurement_offset=np.arange(count + 1),
            measurement_sensor=np.zeros(count, dtype=np.int8),
            measurement=measured[first:last, None].copy(),
        )

    process = Process(_advance(), _transition(), np.zeros(1), np.zeros(0, dtype=np.int64), np.array([DENSITY]))
    no = np.zeros((1, 1), dtype=np.bool_)
    sensors = Sensors(np.array([[[0.0, 1.0]]]), np.full((1, 1), NOISE**2), no, no[0])
    segments = [
        [timeline(k, min(k + CHUNK, last), k > first) for k in range(first, last, CHUNK)]
        for first, last in zip([0, *cut], [*cut, N], strict=True)
    ]
    mean, factor = np.array([DRAG] + [START] * len(segments)), np.diag([1.0] + [SPREAD] * len(segments))
    return JointProblem(process, sensors, segments, Gaussian(mean, factor))


def minus_twice_log_posterior(parameters, measured, cut, scale):
    """By a filter of the whole density, on a grid."""
    (drag,) = parameters
    led = GRID + STEP * (THRUST - drag * GRID**2)
    moved = np.exp(-0.5 * (GRID[:, None] - led) ** 2 / (DENSITY**2 * STEP))
    heard = np.exp(-0.5 * ((measured[:, None] - (1.0 + scale) * GRID) / NOISE) ** 2)
    first = np.exp(-0.5 * ((GRID - START) / SPREAD) ** 2)
    total, density = (drag - DRAG) ** 2, first / first.sum()
    for k in range(N):
        if k in cut:
            density = first / first.sum()
        elif k:
            density = moved @ density
        density = density * heard[k]
        total -= 2.0 * np.log(density.sum())
        density = density / density.sum()
    return total


@pytest.mark.slow
@pytest.mark.parametrize("cut", [(), (130, 300)], ids=["one segment", "three segments"])
def test_motion_dependent_damping_matches_exact_likelihood(cut, rng):
    measured = simulated(rng)
    problem = problem_of(measured, cut)
    smoothing = LinearSmoothing(problem)
    (joint, _), *_ = most_probable(problem, smoothing, 50)
    found = integrate_out_motion(problem, smoothing, joint, 50)
    assert found is not None
    answer, *_ = found
    scores = marginal_scores(Signatures(problem, smoothing, answer, Scale()))

    def exact(scale):
        args = measured, cut, scale
        return minimize(minus_twice_log_posterior, DRAG, args, "Nelder-Mead", options={"xatol": 1e-5})

    deviation = np.sqrt(answer.final.covariance()[0, 0])
    z = (answer.trajectory.parameters[0] - exact(0.0).x[0]) / deviation
    information = scores.information[0, 0]
    score = (exact(-0.005).fun - exact(0.005).fun) / 0.02
    assert abs(z) < 0.1
    assert abs(scores.score[0] - score) < 0.1 * np.sqrt(information)
