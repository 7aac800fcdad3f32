"""Fits that weigh down what is far off, against least squares that others solve."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from auvid_cli.filters.output_error import run_output_error
from auvid_cli.filters.problem import OK, JointProblem
from auvid_cli.filters.smoother import run_smoother
from auvid_cli.filters.smoother_forward import MIN_WEIGHT, weight

THRESHOLD = 2.0


def fit_one(process, sensors, timelines, prior, on_chunk, **settings):
    return run_output_error(JointProblem(process, sensors, [timelines], prior), on_chunk, **settings)


def smooth_one(process, sensors, timelines, prior, on_chunk):
    return run_smoother(JointProblem(process, sensors, [timelines], prior), on_chunk)


FITS = {
    "output error": fit_one,
    "output error with the prior": partial(fit_one, use_prior=True),
    "smoother": smooth_one,
}


@pytest.fixture
def with_outliers(linear_problem):
    """A linear problem with measurements far off, one of them as a whole."""
    p = linear_problem
    p.sensors = p.sensors._replace(threshold=THRESHOLD)
    p.timeline.measurement[3::8, 1] += 20.0
    p.timeline.measurement[10] -= 20.0
    return p


def weighed_by_hand(problem, run):
    """Reweight over and over, with a sensor for each measurement; what of it each component counts, too."""
    t, given_sensors = problem.timeline, problem.sensors
    of = t.measurement_sensor
    matrix, variance, angular, nonlinear = (field[of] for field in given_sensors[:4])
    apart = t._replace(measurement_sensor=np.arange(of.size, dtype=np.int8))
    at = np.repeat(np.arange(t.time.size), np.diff(t.measurement_offset))
    weights = np.ones(t.measurement.shape)
    for _ in range(60):
        problem.timeline = apart
        problem.sensors = given_sensors._replace(
            matrix=matrix, variance=variance / weights, angular=angular, nonlinear=nonlinear, threshold=np.inf
        )
        history = run(problem)
        residual = t.measurement - np.einsum("kci,ki->kc", matrix, history.records.mean[at])
        weights = np.nan_to_num(np.minimum(1.0, THRESHOLD * np.sqrt(variance) / np.abs(residual)), nan=1.0)
    problem.timeline, problem.sensors = t, given_sensors
    return history, weights


@pytest.mark.slow
@pytest.mark.parametrize("linear_problem", [1], indirect=True)
@pytest.mark.parametrize("fit", FITS.values(), ids=FITS)
def test_a_robust_fit_is_where_reweighting_ends(fit, with_outliers, run_whole, monkeypatch):
    monkeypatch.setattr("auvid_cli.filters.linear_smoother.MIN_DECREASE", 1e-9)
    expected, weights = weighed_by_hand(with_outliers, partial(run_whole, fit))
    history = run_whole(fit, with_outliers)
    assert history.failure == OK
    assert (weights < MIN_WEIGHT).sum() > 3
    deviation = expected.records.standard_deviation
    assert np.abs((history.records.mean - expected.records.mean) / deviation).max() < 5e-3
    assert_allclose(history.records.standard_deviation, deviation, rtol=1e-3)


@pytest.mark.parametrize("linear_problem", [1], indirect=True)
def test_a_robust_output_error_fit_is_that_of_scipy(with_outliers, by_hand, run_whole):
    p, t = with_outliers, with_outliers.timeline
    present = ~np.isnan(t.measurement)
    deviation = np.sqrt(p.sensors.variance[t.measurement_sensor])[present]
    matrix, measurement = by_hand.matrix[present] / deviation[:, None], by_hand.measurement[present] / deviation
    found = least_squares(
        lambda state: matrix @ state - measurement,
        p.prior.mean,
        lambda state: matrix,
        loss="huber",
        f_scale=THRESHOLD,
        x_scale="jac",
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    history = run_whole(fit_one, p)
    weights = np.minimum(1.0, THRESHOLD / np.abs(matrix @ found.x - measurement))
    covariance = np.linalg.inv(matrix.T @ (weights[:, None] * matrix))
    assert np.abs((history.records.mean[0] - found.x) / np.sqrt(np.diagonal(covariance))).max() < 5e-3
    assert_allclose(history.records.standard_deviation[0], np.sqrt(np.diagonal(covariance)), rtol=1e-3)


@pytest.mark.parametrize("linear_problem", [1], indirect=True)
@pytest.mark.parametrize("fit", FITS.values(), ids=FITS)
def test_small_weights_are_recorded_without_variance(fit, with_outliers, run_whole):
    records = run_whole(fit, with_outliers).records
    present, aside = ~np.isnan(with_outliers.timeline.measurement), records.weight < MIN_WEIGHT
    assert (records.weight[~present] == 1.0).all()
    assert np.array_equal(np.isnan(records.innovation_variance[present]), aside[present])
    assert np.isfinite(records.innovation[present]).all()
    assert aside[10, present[10]].all()


@pytest.mark.parametrize("linear_problem", [2], indirect=True)
@pytest.mark.parametrize("fit", FITS.values(), ids=FITS)
def test_large_threshold_changes_nothing(fit, linear_problem, run_whole):
    plain = run_whole(fit, linear_problem)
    linear_problem.sensors = linear_problem.sensors._replace(threshold=1e6)
    history = run_whole(fit, linear_problem)
    assert np.array_equal(history.records.mean, plain.records.mean)
    assert np.array_equal(history.records.standard_deviation, plain.records.standard_deviation)


SIZES = st.floats(-1e3, 1e3)


@given(SIZES, SIZES, st.floats(0.1, 100.0))
def test_a_weighted_square_is_nowhere_less_than_the_robust_one(about, residual, threshold):
    """So a step that lowers the one lowers the other."""

    def rho(r):
        return r * r if abs(r) <= threshold else 2.0 * threshold * abs(r) - threshold**2

    of_about = weight(about**2, threshold)
    bound = of_about * residual**2 + of_about * (1.0 - of_about) * about**2
    assert rho(residual) <= bound + 1e-9 * (1.0 + bound)
    assert of_about * (2.0 - of_about) * about**2 == pytest.approx(rho(about), rel=1e-9, abs=1e-12)
