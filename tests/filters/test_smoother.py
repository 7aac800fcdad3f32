"""The iterated smoother against dense least squares over the whole trajectory."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.problem import OK
from auvid_cli.filters.smoother import run_smoother


def smooth_one(process, sensors, timelines, prior, on_chunk):
    """Of a single segment."""
    return run_smoother(process, sensors, [timelines], prior, on_chunk)


@pytest.fixture
def by_least_squares(linear_problem):
    """Parameters and the moving states of all events from one big system: prior, process noise and measurements."""
    p, t = linear_problem, linear_problem.timeline
    n, n_moving = p.prior.mean.size, p.process.noise_density.size
    n_parameters, events = n - n_moving, t.time.size
    rows, right = [], []

    def place(event):
        return [*range(n_parameters), *range(n_parameters + event * n_moving, n_parameters + (event + 1) * n_moving)]

    def equation(matrix, columns, value, deviation):
        row = np.zeros((len(value), n_parameters + events * n_moving))
        row[:, columns] = matrix
        rows.append(row / deviation[:, None])
        right.append(value / deviation)

    for event in range(events):
        first, last = t.substep_offset[event : event + 2]
        if last > first:
            origin, matrix = np.zeros(n), np.eye(n)
            pieces = t.substep_input[first:last], t.substep_duration[first:last]
            p.process.transition(
                origin, t.inputs, *pieces, p.process.constants, p.process.selection, matrix, np.zeros(1)
            )
            deviation = p.process.noise_density * np.sqrt(pieces[1].sum())
            both = [*place(event - 1), *place(event)[n_parameters:]]
            dynamics = np.hstack([-matrix[n_parameters:], np.eye(n_moving)])
            equation(dynamics, both, origin[n_parameters:], deviation)
        for k in range(*t.measurement_offset[event : event + 2]):
            sensor, present = t.measurement_sensor[k], ~np.isnan(t.measurement[k])
            noise = np.sqrt(p.sensors.variance[sensor, present])
            equation(p.sensors.matrix[sensor, present], place(event), t.measurement[k, present], noise)
    # In units of the prior, whose inverse would lose digits: x = mean + factor z with z of unit variance.
    unit, origin = np.eye(n_parameters + events * n_moving), np.zeros(n_parameters + events * n_moving)
    unit[np.ix_(place(0), place(0))], origin[place(0)] = p.prior.factor, p.prior.mean
    system, known = np.vstack(rows), np.concatenate(right)
    prior = np.eye(len(origin))[place(0)]
    orthogonal, triangle = np.linalg.qr(np.vstack([system @ unit, prior]))
    root = unit @ np.linalg.inv(triangle)
    state = origin + root @ (orthogonal.T @ np.concatenate([known - system @ origin, np.zeros(n)]))
    covariance = root @ root.T
    at = np.array([place(event) for event in range(events)])
    return SimpleNamespace(
        mean=state[at],
        deviation=np.sqrt(np.diagonal(covariance))[at],
        covariance=covariance[np.ix_(at[-1], at[-1])],
    )


@pytest.mark.parametrize("chunk", [30, 7])
def test_a_linear_problem_is_solved_as_by_one_big_system(chunk, linear_problem, by_least_squares, run_whole):
    history = run_whole(smooth_one, linear_problem, chunk=chunk)
    expected = by_least_squares
    assert (history.n_good, history.failure) == (30, OK)
    assert np.abs((history.records.mean - expected.mean) / expected.deviation).max() < 1e-9
    # A difference of variances.
    assert_allclose(history.records.standard_deviation, expected.deviation, rtol=1e-7)
    assert_allclose(history.covariance, expected.covariance, rtol=1e-8, atol=1e-10)
