"""The smoother against dense least squares over the whole trajectory."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares

from auvid_cli.filters.problem import OK, PREDICTION, JointProblem
from auvid_cli.filters.smoother import run_smoother
from auvid_cli.filters.smoother_backward import backward


def smooth_one(process, sensors, timelines, prior, on_chunk):
    """Joint problem of a single segment."""
    return run_smoother(JointProblem(process, sensors, [timelines], prior), on_chunk)


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


@pytest.mark.parametrize("chunk", [30, 7, 1])  # in chunks of one event, threads linearise ahead
def test_a_linear_problem_is_solved_as_by_one_big_system(chunk, linear_problem, by_least_squares, run_whole):
    history = run_whole(smooth_one, linear_problem, chunk=chunk)
    expected = by_least_squares
    assert (history.n_good, history.failure) == (30, OK)
    assert np.abs((history.records.mean - expected.mean) / expected.deviation).max() < 1e-9
    # A difference of variances.
    assert_allclose(history.records.standard_deviation, expected.deviation, rtol=1e-7)
    assert_allclose(history.covariance, expected.covariance, rtol=1e-8, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("chunk", [7, 1])
def test_same_numbers_from_memory_file_and_second_pass(chunk, linear_problem, run_whole, monkeypatch):
    whole = run_whole(smooth_one, linear_problem, chunk=chunk)
    monkeypatch.setattr("auvid_cli.arrays.MAX_IN_MEMORY", 0)
    monkeypatch.setattr("auvid_cli.filters.linear_smoother.CACHE_SIZE", 0)
    filed = run_whole(smooth_one, linear_problem, chunk=chunk)
    assert_array_equal(filed.covariance, whole.covariance)
    for name, rows in whole.records._asdict().items():
        assert_array_equal(getattr(filed.records, name), rows)


@pytest.fixture
def nonlinear_cost(nonlinear_problem):
    """Function: what `least_squares` makes small, of parameters and the moving states of all events in one row."""
    p, t = nonlinear_problem, nonlinear_problem.timeline
    n, n_moving = p.prior.mean.size, p.process.noise_density.size
    n_parameters = n - n_moving

    def residuals(row):
        parameters, moving = row[:n_parameters], row[n_parameters:].reshape(-1, n_moving)
        parts = [np.linalg.solve(p.prior.factor, np.append(parameters, moving[0]) - p.prior.mean)]
        for event in range(t.time.size):
            first, last = t.substep_offset[event : event + 2]
            if last > first:
                moved = np.append(parameters, moving[event - 1])
                pieces = t.substep_input[first:last], t.substep_duration[first:last]
                constants = p.process.constants, p.process.selection
                p.process.transition(moved, t.inputs, *pieces, *constants, np.eye(n), np.zeros(1))
                deviation = p.process.noise_density * np.sqrt(pieces[1].sum())
                parts.append((moving[event] - moved[n_parameters:]) / deviation)
            state = np.append(parameters, moving[event])
            for k in range(*t.measurement_offset[event : event + 2]):
                sensor, present = t.measurement_sensor[k], ~np.isnan(t.measurement[k])
                inputs = t.inputs[t.event_input[event]]
                predicted = p.plain_observe(state, inputs) if sensor == 0 else p.sensors.matrix[sensor] @ state
                difference = (t.measurement[k] - predicted) / np.sqrt(p.sensors.variance[sensor])
                parts.append(difference[present])
        return np.concatenate(parts)

    return residuals


@pytest.mark.slow
@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_nonlinear_sensors_are_smoothed_to_the_least_cost(nonlinear_problem, nonlinear_cost, run_whole):
    history = run_whole(smooth_one, nonlinear_problem)
    assert history.failure == OK
    mean, deviation = history.records.mean, history.records.standard_deviation
    n_parameters = nonlinear_problem.prior.mean.size - nonlinear_problem.process.noise_density.size
    rows = [np.append(each[0, :n_parameters], each[:, n_parameters:]) for each in (mean, deviation)]
    solution = least_squares(nonlinear_cost, rows[0], x_scale=rows[1], xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert np.abs((solution.x - rows[0]) / rows[1]).max() < 0.05
    covariance = np.linalg.inv(solution.jac.T @ solution.jac)
    assert_allclose(rows[1], np.sqrt(np.diagonal(covariance)), rtol=0.02)


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
def test_a_turn_more_of_an_angle_changes_nothing(nonlinear_problem, run_whole):
    p = nonlinear_problem
    # An innovation of an angle is less than half a turn.
    p.timeline.measurement[:] *= 0.2
    angular = p.sensors.angular.copy()
    angular[0, 2] = angular[1, 0] = True
    p.sensors = p.sensors._replace(angular=angular)
    plain = run_whole(smooth_one, p)
    turned = p.timeline.measurement.copy()
    for sensor, component in np.argwhere(angular):
        turned[p.timeline.measurement_sensor == sensor, component] += 2.0 * np.pi
    p.timeline = p.timeline._replace(measurement=turned)
    history = run_whole(smooth_one, p)
    assert_allclose(history.records.mean, plain.records.mean, atol=1e-9)


def test_lost_variance_is_a_failure(linear_problem, run_whole, monkeypatch):
    """Where the way back leaves nothing of it, the answer ends, and says so."""

    def lossy(timeline, about, forward_pass, adjoint, step, variance):
        backward(timeline, about, forward_pass, adjoint, step, variance)
        variance[12:, 1] = -1e-20

    monkeypatch.setattr("auvid_cli.filters.linear_smoother.backward", lossy)
    history = run_whole(smooth_one, linear_problem, chunk=30)
    assert (history.n_good, history.failure) == (12, PREDICTION)
