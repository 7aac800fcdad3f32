"""Nonlinear measurements against plain covariance filters in NumPy, side by side with a linear sensor."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters import square_root
from auvid_cli.filters.ekf import run_extended_filter
from auvid_cli.filters.problem import OK
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature, transformed, unscented

N_MOVING, ALPHA = 4, 0.5


# Repeated subtraction of covariances in doubles leaves seven digits with 44 states.
EXTENDED = np.longdouble
TOLERANCE = 1e-8 if np.finfo(EXTENDED).eps < 1e-18 else 1e-6


@pytest.fixture
def problem(nonlinear_problem):
    return nonlinear_problem


def triangle(matrix):
    """Cholesky's, of extended precision too."""
    lower = np.zeros_like(matrix)
    for j in range(len(matrix)):
        lower[j, j] = np.sqrt(matrix[j, j] - lower[j, :j] @ lower[j, :j])
        lower[j + 1 :, j] = (matrix[j + 1 :, j] - lower[j + 1 :, :j] @ lower[j, :j]) / lower[j, j]
    return lower


def inverse(matrix):
    lower, whitening = triangle(matrix), np.eye(len(matrix), dtype=matrix.dtype)
    for j in range(len(matrix)):
        whitening[j] = (whitening[j] - lower[j, :j] @ whitening[:j]) / lower[j, j]
    return whitening.T @ whitening


def covariance_filter(problem, predict, see):
    """Joint updates, full covariances in extended precision; `predict` moves a gaussian, `see` is a sensor's view."""
    t, n = problem.timeline, problem.prior.mean.size
    mean, factor = problem.prior.mean.astype(EXTENDED), problem.prior.factor.astype(EXTENDED)
    covariance = factor @ factor.T
    means, innovations, variances = [], np.full(t.measurement.shape, np.nan), np.full(t.measurement.shape, np.nan)
    nis = np.zeros(len(t.measurement))
    noise = np.diag([*np.zeros(n - N_MOVING), *problem.process.noise_density**2])
    for event in range(t.time.size):
        substeps = slice(t.substep_offset[event], t.substep_offset[event + 1])
        mean, covariance = predict(mean, covariance, t.substep_input[substeps], t.substep_duration[substeps])
        covariance = covariance + noise * t.substep_duration[substeps].sum()
        for k in range(t.measurement_offset[event], t.measurement_offset[event + 1]):
            sensor, present = t.measurement_sensor[k], ~np.isnan(t.measurement[k])
            predicted, predicted_covariance, cross = see(mean, covariance, sensor, t.inputs[t.event_input[event]])
            innovation = (t.measurement[k] - predicted)[present]
            s = (predicted_covariance + np.diag(problem.sensors.variance[sensor]))[np.ix_(present, present)]
            gain = cross[:, present] @ inverse(s)
            mean, covariance = mean + gain @ innovation, covariance - gain @ s @ gain.T
            innovations[k, present], variances[k, present] = innovation, np.diag(s)
            nis[k] = innovation @ inverse(s) @ innovation
        means.append(mean)
    return np.array(means), covariance, innovations, variances, nis


def linear_predict(problem):
    """The process is linear, and every filter moves it exactly."""

    def predict(mean, covariance, substep_input, substep_duration):
        moved, matrix = mean.astype(np.float64), np.eye(mean.size)
        if substep_duration.size:
            p, inputs = problem.process, problem.timeline.inputs
            p.transition(
                moved,
                inputs,
                substep_input,
                substep_duration,
                p.constants,
                p.selection,
                matrix,
                np.zeros(p.scratch_size),
            )
        return moved, matrix @ covariance @ matrix.T

    return predict


def sigma_view(problem, directions, for_mean, for_covariance):
    def see(mean, covariance, sensor, inputs):
        points = mean + directions @ triangle(covariance).T
        images = np.array(
            [problem.plain_observe(x, inputs) if sensor == 0 else problem.sensors.matrix[sensor] @ x for x in points]
        )
        predicted = for_mean @ images
        centre = for_mean @ points
        weighted = ((images - predicted).T * for_covariance) @ (images - predicted)
        return predicted, weighted, ((points - centre).T * for_covariance) @ (images - predicted)

    return see


def both_ways(directions):
    return np.vstack([directions.T, -directions.T])


def point_sets(n):
    """The filter's own point set, and all points with weights as a textbook has them."""
    equal = np.full(2 * n, 0.5 / n)
    cross = np.sqrt(n) * np.vstack([np.eye(n), -np.eye(n)])
    yield "ckf", cubature(n), cross, equal, equal
    # The points themselves are tested against the paper's formula elsewhere.
    yield "tukf", transformed(n), both_ways(transformed(n).directions), equal, equal
    scaled = ALPHA**2 * n - n
    spread = np.sqrt(n + scaled) * np.vstack([np.zeros(n), np.eye(n), -np.eye(n)])
    for_mean = np.full(2 * n + 1, 0.5 / (n + scaled))
    for_mean[0] = scaled / (n + scaled)
    for_covariance = for_mean.copy()
    for_covariance[0] += 1.0 - ALPHA**2 + 2.0
    yield "ukf", unscented(n, ALPHA, 2.0, 0.0), spread, for_mean, for_covariance


def assert_equal(history, expected, share_of_largest):
    mean, covariance, innovation, variance, nis = expected
    assert history.failure == OK
    assert np.isfinite(mean).all()
    assert_allclose(history.records.innovation, innovation, rtol=1e-7, atol=1e-7)
    assert_allclose(history.records.innovation_variance, variance, rtol=1e-7)
    assert_allclose(history.records.nis, nis, rtol=1e-7, atol=1e-12)
    assert_allclose(history.records.mean, mean, rtol=1e-7, atol=1e-7)
    assert_allclose(history.covariance, covariance, rtol=1e-8, atol=1e-8 * np.abs(covariance).max())
    for got, plain in (
        (history.records.innovation, innovation),
        (history.records.innovation_variance, variance),
        (history.records.nis, nis),
        (history.records.mean, mean),
    ):
        assert share_of_largest(got, plain).max() <= TOLERANCE


@pytest.mark.parametrize("which", [0, 1, 2], ids=["ckf", "tukf", "ukf"])
def test_sigma_point_filters_are_the_covariance_form(which, problem, run_whole, share_of_largest):
    n = problem.prior.mean.size
    _, point_set, directions, for_mean, for_covariance = list(point_sets(n))[which]
    history = run_whole(partial(run_square_root_filter, point_set), problem)
    see = sigma_view(problem, directions, for_mean, for_covariance)
    assert_equal(history, covariance_filter(problem, linear_predict(problem), see), share_of_largest)


@pytest.mark.parametrize("which", [0, 2], ids=["ckf", "ukf"])
def test_axis_shortcut_changes_only_rounding(which, problem, run_whole, monkeypatch):
    """Products with their matrix are left out, and change nothing but rounding."""
    _, point_set, *_ = list(point_sets(problem.prior.mean.size))[which]
    run = partial(run_square_root_filter, point_set)
    basis = square_root.basis_of(point_set)
    assert basis.length > 0.0
    without = run_whole(run, problem)
    monkeypatch.setattr(square_root, "basis_of", lambda _: basis._replace(length=0.0))
    products = run_whole(run, problem)
    assert without.failure == products.failure == OK
    assert_allclose(without.records.mean, products.records.mean, rtol=1e-12, atol=1e-12)
    assert_allclose(without.covariance, products.covariance, rtol=1e-12, atol=1e-12)


def test_the_extended_filter_is_the_textbooks(problem, run_whole, share_of_largest):
    def see(mean, covariance, sensor, inputs):
        matrix = problem.jacobian(mean) if sensor == 0 else problem.sensors.matrix[sensor]
        predicted = problem.plain_observe(mean, inputs) if sensor == 0 else matrix @ mean
        return predicted, matrix @ covariance @ matrix.T, covariance @ matrix.T

    history = run_whole(run_extended_filter, problem)
    assert_equal(history, covariance_filter(problem, linear_predict(problem), see), share_of_largest)


def test_the_sensor_is_far_from_linear(problem, run_whole):
    """Else the comparisons above could not tell the filters apart."""
    n = problem.prior.mean.size
    ekf = run_whole(run_extended_filter, problem)
    ckf = run_whole(partial(run_square_root_filter, cubature(n)), problem)
    assert np.abs(ekf.records.mean - ckf.records.mean).max() > 1e-3


def test_an_angle_that_is_measured_nonlinearly_is_known_modulo_a_turn(problem, run_whole):
    run = partial(run_square_root_filter, cubature(problem.prior.mean.size))
    t = problem.timeline
    problem.timeline = t._replace(inputs=0.0 * t.inputs, measurement=0.1 * t.measurement)
    plain = run_whole(run, problem)
    angle = plain.records.innovation[t.measurement_sensor == 0, 2]
    assert 0.0 < np.nanmax(np.abs(angle)) < 3.0, "no innovation near half a turn, where the wrap itself would jump"
    problem.sensors.angular[0, 2] = True
    problem.timeline.measurement[t.measurement_sensor == 0, 2] += 4.0 * np.pi
    assert_allclose(run_whole(run, problem).records.mean, plain.records.mean, rtol=1e-8, atol=1e-9)
