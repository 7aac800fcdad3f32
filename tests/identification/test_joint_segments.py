"""Several segments together: the fit against scipy's on plain residuals, the information against dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from auvid_cli.config.enums import FilterName
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.free_run import free_motion
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.filters.sensitivities import responses
from auvid_cli.identification.information import information_at
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.run import identify
from auvid_cli.identification.timeline import measuring_sensors
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, N_MOTION, SENSORS

FEW = ("X_u|u|", "Y_url", "N_url", "N_uudr")
TWO = "identification.use.spans=[[0, 8], [12, 20]]"
WHITE = (
    "manoeuvre.duration=20 s",
    "manoeuvre.initial_speed=2 m/s",
    "manoeuvre.excitation.fade_in=2 s",
    "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg}",
)


@pytest.fixture(scope="module")
def two_segments(simulated_with):
    """All 22 coefficients."""
    return simulated_with(*WHITE, TWO)


def residuals(dataset, coefficients, motions):
    """Return the whitened residuals of all measurements of all segments, with the integration of the predictions."""
    parameters, parts = dataset.experiment.vehicle.known_parameters(), []
    for segment, motion in zip(prepare(dataset).segments, motions, strict=True):
        for timeline, predicted in free_motion(segment.timelines, motion, parameters, coefficients):
            event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
            for sensor, (name, record) in enumerate(measuring_sensors(dataset).items()):
                own = timeline.measurement_sensor == sensor
                columns = [MOTION_SYMBOLS.index(quantity.symbol) for quantity in SENSORS[name]]
                difference = predicted[event[own]][:, columns] - timeline.measurement[own, : len(columns)]
                angles = np.isin(columns, (6, 7, 8))
                difference[:, angles] = np.angle(np.exp(1j * difference[:, angles]))
                whitened = difference / record.standard_deviation
                parts.append(whitened[~np.isnan(difference)])
    return np.concatenate(parts)


@pytest.mark.slow
def test_the_fit_is_that_of_scipy_with_differences_of_the_motion(two_segments, with_settings):
    """Four coefficients and two motions of nine states."""
    dataset = with_settings(two_segments, f"identification.coefficients={list(FEW)}")
    fit = identify(dataset, FilterName.OUTPUT_ERROR)
    assert fit.completed
    scale = np.array([dataset.truth.coefficients[symbol] for symbol in FEW])

    def whitened(x):
        values = fit.held | dict(zip(FEW, scale * x[: len(FEW)], strict=True))
        return residuals(dataset, values, x[len(FEW) :].reshape(2, N_MOTION))

    measured = [segment.motion for segment in prepare(dataset).segments]
    start = np.concatenate([np.ones(len(FEW)), *measured])
    found = least_squares(whitened, start, "3-point", x_scale="jac", ftol=1e-12, xtol=1e-12)
    deviation = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    n = len(FEW)
    assert np.abs((fit.mean[-1, :n] / scale - found.x[:n]) / deviation[:n]).max() < 1e-3
    assert_allclose(fit.standard_deviation[-1, :n] / np.abs(scale), deviation[:n], rtol=1e-4)
    # The motions at the beginning of each.
    second = np.searchsorted(fit.time, 10.0)
    for row, own in ((0, slice(n, n + N_MOTION)), (second, slice(n + N_MOTION, None))):
        assert np.abs((fit.mean[row, n:] - found.x[own]) / deviation[own]).max() < 1e-3
        assert_allclose(fit.standard_deviation[row, n:], deviation[own], rtol=1e-4)


def test_the_information_is_the_sum_of_what_each_says_whatever_its_motion(two_segments):
    truth, n = two_segments.truth, len(SYMBOLS)
    problem = augmented_problem(prepare(two_segments))
    found = information_at(prepare(two_segments), truth.coefficients)
    start = problem.prior.mean.copy()
    start[:n] = [
        truth.coefficients[symbol] / scale for symbol, scale in zip(SYMBOLS, problem.layout.scale, strict=False)
    ]
    total = np.zeros((n, n))
    for segment, place in zip(problem.segments, problem.places, strict=True):
        parts = responses(problem.process, problem.sensors, segment.timelines, start[place])
        rows = np.concatenate([part.whitened.reshape(-1, n + N_MOTION + 1) for part in parts])[:, :-1]
        normal = rows.T @ rows
        total += normal[:n, :n] - normal[:n, n:] @ np.linalg.solve(normal[n:, n:], normal[n:, :n])
    deviation = problem.layout.scale[:n] * np.sqrt(np.diag(np.linalg.inv(total)))
    bound = found.bound()
    assert_allclose([bound[symbol] for symbol in SYMBOLS], deviation, rtol=1e-6)
    time, last = found.growing[-1]
    assert time == pytest.approx(16.0, abs=0.1)
    grown = problem.layout.scale[:n] * last.uncertainty().deviation(np.eye(n, n + N_MOTION))
    assert_allclose(grown, deviation, rtol=1e-6)


@pytest.mark.slow
def test_bounds_of_several_segments_are_those_of_their_fit_and_below_those_of_one(two_segments, with_settings):
    fit = identify(two_segments, FilterName.OUTPUT_ERROR)
    bounds = BoundsOf(prepare(two_segments))(fit)
    assert bounds.remark == ""
    of_data = np.array([bounds.of_data[symbol] for symbol in SYMBOLS])
    assert_allclose(of_data, fit.standard_deviation[-1, : len(SYMBOLS)], rtol=0.1)
    one = with_settings(two_segments, "identification.use.spans=[[0, 8]]")
    alone = BoundsOf(prepare(one))(replace(fit, experiment=one.experiment))
    assert np.all(of_data < [alone.of_data[symbol] for symbol in SYMBOLS])
    used = information_at(prepare(two_segments), two_segments.truth.coefficients).bound_with_prior()
    assert all(used[symbol] <= bounds.of_data[symbol] * 1.1 for symbol in SYMBOLS)


def test_several_segments_are_assessed_as_one_set_of_data(two_segments):
    found = assess_dataset(two_segments)
    assert_allclose(np.sum(list(found.shares.values()), axis=0), 1.0)
    bounds = information_at(prepare(two_segments), two_segments.truth.coefficients).bound()
    assert_allclose([b.cramer_rao_bound for b in found.bounds], [bounds[symbol] for symbol in SYMBOLS], rtol=0.05)
    times = np.array([time for time, _ in found.growth])
    assert np.all(np.diff(times) > 0.0)
    assert times[-1] == pytest.approx(16.0, abs=0.1)
