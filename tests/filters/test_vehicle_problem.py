"""The square-root filters on the 31 states of the vehicle against plain covariance filters in NumPy."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import set_up_filters
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.parameters import N_MOTION

N_MOVING = 9


@pytest.fixture(scope="module")
def problem_of(simulated_with, run_whole):
    """Function: what is handed to the square-root filter, and what came back."""
    dataset = simulated_with(
        "manoeuvre.duration=1.5 s", "manoeuvre.initial_speed=2 m/s", "manoeuvre.excitation.fade_in=0 s",
        "identification.prior.factor=0.3", "sensors.gyroscope.rate=100 Hz", "sensors.attitude.rate=100 Hz",
    )  # fmt: skip

    def capture(name):
        (run,) = set_up_filters(prepare(dataset), [name])
        point_set, process, sensors = run.estimator.points, run.estimator.process, run.estimator.sensors
        (timelines,), prior = run.segments, run.prior
        (timeline,) = timelines
        problem = SimpleNamespace(process=process, sensors=sensors, timeline=timeline, prior=prior)
        history = run_whole(partial(run_square_root_filter, point_set), problem, chunk=50)
        return dataset, process, sensors, timeline, prior, history

    return capture


def points_of(name, n, settings):
    """All points (rows) and their weights for mean and covariance, by the textbook."""
    if name is FilterName.CKF:
        points = np.sqrt(n) * np.vstack([np.eye(n), -np.eye(n)])
        return points, np.full(2 * n, 0.5 / n), np.full(2 * n, 0.5 / n)
    if name is FilterName.TUKF:
        i, j = np.arange(1, 2 * n + 1)[:, None], np.arange(1, n // 2 + 1)
        angle = (2 * j - 1) * i * np.pi / n
        points = np.empty((2 * n, n))
        points[:, 0 : 2 * (n // 2) : 2] = np.sqrt(2) * np.cos(angle)
        points[:, 1 : 2 * (n // 2) : 2] = np.sqrt(2) * np.sin(angle)
        if n % 2:
            points[:, n - 1] = (-1.0) ** i[:, 0]
        return points, np.full(2 * n, 0.5 / n), np.full(2 * n, 0.5 / n)
    scaled = settings.alpha**2 * (n + settings.kappa) - n
    points = np.sqrt(n + scaled) * np.vstack([np.zeros(n), np.eye(n), -np.eye(n)])
    for_mean = np.full(2 * n + 1, 0.5 / (n + scaled))
    for_covariance = for_mean.copy()
    for_mean[0] = scaled / (n + scaled)
    for_covariance[0] = for_mean[0] + 1 - settings.alpha**2 + settings.beta
    return points, for_mean, for_covariance


def propagate(process, points, timeline, substeps):
    """Each point over consecutive substeps, one block at a time."""
    n_parameters = points.shape[1] - N_MOVING
    result = points.copy()
    for first in range(0, len(points), LANES):
        rows = points[first : first + LANES]
        block = np.zeros((points.shape[1], LANES))
        block[:, : len(rows)] = rows.T
        moving, parameters = block[n_parameters:].ravel(), block[:n_parameters].ravel()
        for substep in substeps:
            held = timeline.inputs[timeline.substep_input[substep]]
            process.advance(
                moving,
                parameters,
                held,
                process.constants,
                process.selection,
                len(rows),
                timeline.substep_duration[substep],
                np.zeros(process.scratch_size),
            )
        result[first : first + LANES, n_parameters:] = moving.reshape(N_MOVING, LANES)[:, : len(rows)].T
    return result


@pytest.mark.parametrize("name", [FilterName.CKF, FilterName.TUKF, FilterName.UKF])
def test_square_root_form_equals_the_covariance_form(name, problem_of, share_of_largest):
    dataset, process, sensors, timeline, prior, history = problem_of(name)
    n = prior.mean.size
    assert n == N_COEFFICIENTS + N_MOTION
    points, for_mean, for_covariance = points_of(name, n, dataset.experiment.identification.ukf)
    noise = np.zeros(n)
    noise[-N_MOVING:] = process.noise_density**2
    mean, covariance = prior.mean, prior.factor @ prior.factor.T
    means = []
    for event in range(timeline.time.size):
        substeps = range(timeline.substep_offset[event], timeline.substep_offset[event + 1])
        if substeps:
            drawn = mean + points @ np.linalg.cholesky(covariance).T
            moved = propagate(process, drawn, timeline, substeps)
            mean = for_mean @ moved
            covariance = ((moved - mean).T * for_covariance) @ (moved - mean)
            covariance += np.diag(noise * timeline.substep_duration[substeps.start : substeps.stop].sum())
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            present = ~np.isnan(timeline.measurement[k])
            sensor = timeline.measurement_sensor[k]
            h = sensors.matrix[sensor, present]
            s = h @ covariance @ h.T + np.diag(sensors.variance[sensor, present])
            gain = np.linalg.solve(s, h @ covariance).T
            mean = mean + gain @ (timeline.measurement[k, present] - h @ mean)
            covariance = covariance - gain @ s @ gain.T
            covariance = 0.5 * (covariance + covariance.T)
        deviation = np.sqrt(np.diag(covariance))
        assert_allclose(history.records.standard_deviation[event], deviation, rtol=1e-8)
        assert_allclose(history.records.mean[event], mean, rtol=1e-8, atol=1e-8 * deviation.max())
        means.append(mean)
    assert event > 100
    assert share_of_largest(history.records.mean, np.array(means)).max() <= 1e-8
    scale = np.outer(deviation, deviation)
    assert_allclose(history.covariance / scale, covariance / scale, atol=1e-8)


def test_the_filters_differ_on_this_problem(problem_of):
    """Else the comparison above could not tell one set of points from another."""
    ckf, tukf, ukf = (problem_of(name)[-1].records for name in (FilterName.CKF, FilterName.TUKF, FilterName.UKF))
    for a, b in ((ckf, tukf), (ckf, ukf), (tukf, ukf)):
        difference = np.abs(a.mean[-1] - b.mean[-1]) / a.standard_deviation[-1]
        assert difference.max() > 1e-6
