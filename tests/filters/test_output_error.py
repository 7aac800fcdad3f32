"""The output-error method against least squares in NumPy and against the Kalman filter."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from auvid_cli.filters.ekf import run_extended_filter
from auvid_cli.filters.least_squares import Information, LeastSquaresFit, fit_free_motion
from auvid_cli.filters.output_error import FirstEvents, run_output_error
from auvid_cli.filters.problem import NOT_CONVERGED, OK, PREDICTION, Gaussian, JointProblem
from auvid_cli.filters.square_root import run_square_root_filter

EVENTS = 30


def fit_one(process, sensors, timelines, prior, on_chunk, **settings):
    """Joint problem of a single segment."""
    return run_output_error(JointProblem(process, sensors, [timelines], prior), on_chunk, **settings)


def least_squares_by_hand(problem, by_hand, with_prior):
    """Initial state that fits all measurements, and the prior, by the singular values of their stacked rows.

    Without the prior many parameters are observed in a few combinations only, of which `observed` is a basis.
    """
    t = problem.timeline
    present = ~np.isnan(t.measurement)
    deviation = np.sqrt(problem.sensors.variance[t.measurement_sensor])[present]
    matrix, measurement = by_hand.matrix[present] / deviation[:, None], by_hand.measurement[present] / deviation
    if with_prior:
        weight = np.linalg.inv(problem.prior.factor)
        matrix, measurement = np.vstack([matrix, weight]), np.append(measurement, weight @ problem.prior.mean)
    left, values, right = np.linalg.svd(matrix, full_matrices=False)
    kept = values > 1e-10 * values[0]
    root = right[kept].T / values[kept]
    return SimpleNamespace(state=root @ (left[:, kept].T @ measurement), covariance=root @ root.T, observed=right[kept])


@pytest.mark.parametrize("with_prior", [False, True])
@pytest.mark.parametrize("chunk", [30, 7])
def test_a_linear_problem_is_solved_by_weighted_least_squares(with_prior, chunk, linear_problem, by_hand, run_whole):
    p = linear_problem
    expected = least_squares_by_hand(p, by_hand, with_prior)
    history = run_whole(partial(fit_one, use_prior=with_prior), p, chunk=chunk)
    assert (history.n_good, history.failure) == (EVENTS, OK)
    unobserved = by_hand.transition - by_hand.transition @ expected.observed.T @ expected.observed
    known = np.linalg.norm(unobserved, axis=-1) < 1e-8
    assert known.any()
    mean = by_hand.offset + by_hand.transition @ expected.state
    covariance = by_hand.transition @ expected.covariance @ by_hand.transition.swapaxes(-1, -2)
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert_allclose(history.records.standard_deviation, np.where(known, deviation, np.inf), rtol=1e-6)
    assert np.abs((history.records.mean - mean) / deviation)[known].max() < 1e-5
    last = np.ix_(known[-1], known[-1])
    size = np.outer(deviation[-1], deviation[-1])[last]
    assert_allclose(history.covariance[last] / size, covariance[-1][last] / size, atol=1e-6)
    assert np.all(np.diagonal(history.covariance)[~known[-1]] == np.inf)


@pytest.mark.parametrize("with_prior", [False, True])
def test_residuals_have_the_covariance_that_the_fit_leaves(with_prior, linear_problem, by_hand, run_whole):
    p, t = linear_problem, linear_problem.timeline
    expected = least_squares_by_hand(p, by_hand, with_prior)
    records = run_whole(partial(fit_one, use_prior=with_prior), p).records
    for k in range(len(t.measurement)):
        present = ~np.isnan(t.measurement[k])
        h, noise = by_hand.matrix[k, present], np.diag(p.sensors.variance[t.measurement_sensor[k], present])
        residual = by_hand.measurement[k, present] - h @ expected.state
        left = noise - h @ expected.covariance @ h.T
        assert_allclose(records.innovation[k, present], residual, atol=1e-4)
        assert_allclose(records.innovation_variance[k, present], np.diag(left), atol=1e-6)
        assert np.isnan(records.innovation[k, ~present]).all()
        assert np.isnan(records.innovation_variance[k, ~present]).all()
        if present.any() and np.linalg.eigvalsh(left).min() > 1e-3:
            assert records.nis[k] == pytest.approx(residual @ np.linalg.solve(left, residual), abs=1e-3)
    assert np.all(records.nis[np.isnan(t.measurement).all(axis=1)] == 0.0)


def test_without_process_noise_the_kalman_filter_ends_where_the_fit_ends(linear_problem, run_whole):
    p = linear_problem
    p.process = p.process._replace(noise_density=np.zeros_like(p.process.noise_density))
    fit, ekf = run_whole(partial(fit_one, use_prior=True), p), run_whole(run_extended_filter, p)
    assert_allclose(fit.records.mean[-1], ekf.records.mean[-1], rtol=1e-6, atol=1e-6)
    assert_allclose(fit.covariance, ekf.covariance, rtol=1e-6, atol=1e-7)
    p.prior = Gaussian(p.prior.mean, 1e2 * np.eye(p.prior.mean.size))
    fit, ekf = run_whole(fit_one, p), run_whole(run_extended_filter, p)
    deviation = fit.records.standard_deviation[-1]
    # The wide prior still holds what the measurements hardly tell.
    known = deviation < 1.0
    assert known.sum() >= 4
    assert np.abs((fit.records.mean[-1] - ekf.records.mean[-1]) / deviation)[known].max() < 0.01
    assert_allclose(ekf.records.standard_deviation[-1][known], deviation[known], rtol=1e-3)


def test_prior_and_timeline_are_not_modified(linear_problem, run_whole):
    prior, timeline = linear_problem.prior, linear_problem.timeline
    before = prior.mean.copy(), prior.factor.copy(), timeline.measurement.copy()
    run_whole(fit_one, linear_problem)
    assert np.array_equal(prior.mean, before[0])
    assert np.array_equal(prior.factor, before[1])
    assert np.array_equal(timeline.measurement, before[2], equal_nan=True)


def test_on_chunk_receives_every_chunk_once(linear_problem, run_whole):
    assert run_whole(fit_one, linear_problem, chunk=12).told == [(12, 12), (12, 12), (6, 6)]


@pytest.mark.parametrize("first", [1, 4, 11])
def test_first_span_changes_nothing(first, linear_problem, run_whole, monkeypatch):
    whole = run_whole(fit_one, linear_problem)
    monkeypatch.setattr("auvid_cli.filters.output_error.FIRST_SPAN", first)
    grown = run_whole(fit_one, linear_problem)
    assert grown.failure == OK
    difference = (grown.records.mean - whole.records.mean) / whole.records.standard_deviation
    assert np.abs(difference).max() < 1e-4


def test_first_events_cut_the_last_chunk(linear_problem, events_of):
    t = linear_problem.timeline
    chunks = [events_of(t, first, first + 8 if first < 24 else 30) for first in range(0, 30, 8)]
    for n_events in (1, 8, 13, 24, 30):
        span = FirstEvents(chunks, n_events)
        for _ in range(2):
            cut = list(span)
            assert np.array_equal(np.concatenate([chunk.time for chunk in cut]), t.time[:n_events])
            for name in ("measurement", "measurement_sensor", "substep_duration", "substep_input"):
                together = np.concatenate([getattr(chunk, name) for chunk in cut])
                assert np.array_equal(together, getattr(t, name)[: len(together)], equal_nan=name == "measurement")
            assert sum(chunk.measurement_offset[-1] for chunk in cut) == t.measurement_offset[n_events]
            assert sum(chunk.substep_offset[-1] for chunk in cut) == t.substep_offset[n_events]


def test_a_nonlinear_sensor_is_fitted_as_by_all_rows_at_once(nonlinear_problem, by_hand, run_whole):
    p, t = nonlinear_problem, nonlinear_problem.timeline
    deviation = np.sqrt(p.sensors.variance[t.measurement_sensor])
    present = ~np.isnan(t.measurement)
    event = np.repeat(np.arange(EVENTS), np.diff(t.measurement_offset))
    weight = np.linalg.inv(p.prior.factor)

    def residuals(x):
        states = by_hand.offset + by_hand.transition @ x
        observed = np.array(
            [
                p.plain_observe(states[e], t.inputs[t.event_input[e]]) if s == 0 else p.sensors.matrix[s] @ states[e]
                for e, s in zip(event, t.measurement_sensor, strict=True)
            ]
        )
        return np.append(((observed - t.measurement) / deviation)[present], weight @ (x - p.prior.mean))

    history = run_whole(partial(fit_one, use_prior=True), p)
    assert history.failure == OK
    start = np.concatenate([history.records.mean[0, :-4], history.records.mean[0, -4:]])
    # Nothing leads to the first event, so its state is the initial one.
    found = least_squares(residuals, start, x_scale="jac", ftol=1e-14, xtol=1e-14)
    uncertainty = np.linalg.inv(found.jac.T @ found.jac)
    assert np.abs((start - found.x) / np.sqrt(np.diag(uncertainty))).max() < 1e-3
    assert_allclose(history.records.standard_deviation[0], np.sqrt(np.diag(uncertainty)), rtol=1e-4)


@pytest.mark.parametrize("turns", [-3, 2])
def test_angle_is_measured_modulo_a_turn(turns, linear_problem, run_whole):
    p = linear_problem
    p.prior = Gaussian(0.01 * p.prior.mean, 0.01 * p.prior.factor)
    p.timeline = p.timeline._replace(measurement=0.01 * p.timeline.measurement, inputs=0.0 * p.timeline.inputs)
    plain = run_whole(partial(fit_one, use_prior=True), p)
    p.sensors = p.sensors._replace(angular=np.ones_like(p.sensors.angular))
    p.timeline = p.timeline._replace(measurement=p.timeline.measurement + 2.0 * np.pi * turns)
    turned = run_whole(partial(fit_one, use_prior=True), p)
    assert_allclose(turned.records.mean, plain.records.mean, rtol=1e-7, atol=1e-9)
    assert_allclose(turned.records.innovation, plain.records.innovation, rtol=1e-7, atol=1e-9)


def test_unobserved_parameter_keeps_its_start(linear_problem, run_whole):
    p = linear_problem
    p.mixing[:, 0] = 0.0
    p.process = p.process._replace(constants=p.mixing.ravel())
    p.sensors.matrix[:, :, 0] = 0.0
    # Independent of the others, so that the filter from which it starts does not move it.
    p.prior.factor[:, 0] = p.prior.factor[0] = 0.0
    p.prior.factor[0, 0] = 1.0
    history = run_whole(fit_one, p)
    assert history.failure == OK
    assert np.all(history.records.standard_deviation[:, 0] == np.inf)
    assert np.isfinite(history.records.standard_deviation[:, -4:]).all()
    assert_allclose(history.records.mean[:, 0], p.prior.mean[0], rtol=1e-6)
    assert history.covariance[0, 0] == np.inf
    assert np.isfinite(history.covariance[-4:, -4:]).all()


def test_bounds_are_respected(linear_problem, by_hand, run_whole):
    p = linear_problem
    expected = least_squares_by_hand(p, by_hand, with_prior=True)
    free, n = expected.state, p.prior.mean.size
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    # One bound that holds and one that does not matter.
    high[0], low[-1] = free[0] - 1.0, free[-1] - 100.0
    history = run_whole(partial(fit_one, use_prior=True, bounds=(low, high)), p)
    state = history.records.mean[0]
    precision = np.linalg.inv(expected.covariance)
    shift = np.linalg.solve(precision[1:, 1:], precision[1:, :1])[:, 0]
    assert state[0] <= high[0]
    assert state[0] == pytest.approx(high[0], abs=1e-3)
    assert_allclose(
        state[1:], free[1:] + shift * (free[0] - state[0]), atol=0.01 * np.sqrt(np.diag(expected.covariance))[1:].max()
    )


@pytest.mark.slow
def test_too_few_evaluations_do_not_converge(nonlinear_problem, run_whole):
    history = run_whole(partial(fit_one, max_evaluations=1), nonlinear_problem)
    assert (history.n_good, history.failure) == (EVENTS, NOT_CONVERGED)
    assert np.isfinite(history.records.mean).all()


@pytest.mark.slow
def test_fit_of_a_shorter_span_does_not_converge(linear_problem, run_whole, monkeypatch):
    whole = run_whole(fit_one, linear_problem)
    monkeypatch.setattr("auvid_cli.filters.output_error.FIRST_SPAN", 8)
    culprits = []
    for limit in range(1, 16):
        history = run_whole(partial(fit_one, max_evaluations=limit), linear_problem)
        culprits.append(history.failure)
        if history.failure == OK:
            difference = (history.records.mean - whole.records.mean) / whole.records.standard_deviation
            assert np.abs(difference).max() < 1e-3
    assert culprits[0] == NOT_CONVERGED
    assert culprits[-1] == OK


@pytest.mark.parametrize("event", [1, 5, 29])
def test_diverging_motion_fails_at_its_event(event, linear_problem, run_whole):
    p, t = linear_problem, linear_problem.timeline
    substep_input = t.substep_input.copy()
    substep_input[t.substep_offset[event]] = 5
    inputs = np.vstack([t.inputs, np.full((1, t.inputs.shape[1]), np.nan)])
    p.timeline = t._replace(inputs=inputs, substep_input=substep_input)
    history = run_whole(fit_one, p)
    assert (history.n_good, history.failure) == (event, PREDICTION)
    assert np.isfinite(history.records.mean[:event]).all()
    assert np.isnan(history.records.mean[event:]).all()
    assert np.isnan(history.records.standard_deviation[event:]).all()


@pytest.mark.parametrize("linear_problem", [1], indirect=True)
def test_false_minimum_from_ckf_is_rejected(linear_problem, run_whole, monkeypatch):
    """Angles that are known modulo a turn fit somehow wherever a fit starts."""
    p = linear_problem
    p.prior = Gaussian(0.01 * p.prior.mean, 0.01 * p.prior.factor)
    p.timeline = p.timeline._replace(measurement=0.01 * p.timeline.measurement, inputs=0.0 * p.timeline.inputs)
    angular, sharp = np.ones_like(p.sensors.angular), 1e-4 * p.sensors.variance
    p.sensors = p.sensors._replace(angular=angular, variance=sharp)
    right = run_whole(fit_one, p)

    def misled(points, process, sensors, timelines, prior, on_chunk):
        def tell(timeline, records):
            records.mean[:, 0] += 5.0
            on_chunk(timeline, records)

        return run_square_root_filter(points, process, sensors, timelines, prior, tell)

    monkeypatch.setattr("auvid_cli.filters.output_error.run_square_root_filter", misled)
    history = run_whole(fit_one, p)
    assert history.failure == OK
    difference = (history.records.mean - right.records.mean) / right.records.standard_deviation
    assert np.abs(difference).max() < 0.01
    assert right.others == ()
    (other,) = history.others
    assert other.begin is None
    assert other.cost_increase >= 0.0
    assert abs(other.difference[0]) > 10.0 * other.deviation[0]


def test_fit_without_information_is_rejected(linear_problem, run_whole, monkeypatch):
    """The Jacobian of a motion that went wild has one direction: of all else the uncertainty is infinite."""
    p = linear_problem
    right = run_whole(fit_one, p)
    lost: list[LeastSquaresFit] = []

    def fit(problem, start, *others):
        if not lost:
            lost.append(LeastSquaresFit(start + 100.0, Information.empty(start.size), 1e8, True, 1))
            return lost[0]
        return fit_free_motion(problem, start, *others)

    monkeypatch.setattr("auvid_cli.filters.output_error.fit_free_motion", fit)
    history = run_whole(fit_one, p)
    assert history.failure == OK
    assert lost
    # Observed in a few combinations only, what the measurements say is the same.
    known = np.isfinite(right.records.standard_deviation[-1])
    assert_allclose(history.records.mean[:, known], right.records.mean[:, known], rtol=1e-6, atol=1e-6)


def test_unconverged_fit_reports_convergence_status(linear_problem, run_whole):
    history = run_whole(partial(fit_one, max_evaluations=1), linear_problem)
    whole = run_whole(fit_one, linear_problem)
    assert history.failure == NOT_CONVERGED
    n_parameters = history.convergence.step.size
    known = np.isfinite(whole.records.standard_deviation[0, :n_parameters])
    move = (whole.records.mean - history.records.mean)[0, :n_parameters] / whole.records.standard_deviation[
        0, :n_parameters
    ]
    assert_allclose(history.convergence.step[known], move[known], atol=1e-3)
    assert history.convergence.cost_decrease > 0.0
    assert history.convergence.fraction == 1.0
    assert whole.convergence is None
