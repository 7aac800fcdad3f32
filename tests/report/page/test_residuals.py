import numpy as np
import pytest
from scipy.stats import chi2

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.report.page.curves import innovation_parts, sensor_plots
from auvid_cli.report.plot_data import interpolated
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

from ..conftest import TIME, diverged, make_estimate


def plots_of(estimates):
    _, plots = innovation_parts(estimates)
    return {plot.title: plot for plot in plots.plots}


def test_nis_stands_beside_the_band_of_chi_squared():
    estimate = make_estimate("ckf")
    lines = {line.label: line for line in plots_of([estimate])["dvl: NIS"].lines}
    # The first of sixty windows of 80 s: 4/3 s, seven samples of three components.
    innovations = estimate.innovations["dvl"]
    first = innovations.time < 80.0 / 60.0
    n = 3 * int(first.sum())
    assert lines["CKF"].values[0] == pytest.approx(innovations.nis[first].sum() / n)
    assert lines["chance, upper"].values[0] == pytest.approx(chi2.ppf(0.975, n) / n)
    assert lines["chance, lower"].values[0] == pytest.approx(chi2.ppf(0.025, n) / n)


def test_innovations_lie_with_their_bounds_and_what_is_beyond_is_counted():
    estimate = make_estimate("ckf")
    estimate.innovations["dvl"].innovation[7, 0] = 1.0
    plot = plots_of([estimate])["dvl: u"]
    innovation, upper, lower = plot.lines
    assert np.nanmax(innovation.values) == 1.0
    np.testing.assert_allclose(upper.values, 0.02)
    np.testing.assert_allclose(lower.values, -0.02)
    assert plot.limits == pytest.approx((-0.05, 0.05))
    assert plot.says.endswith("Beyond the axis: 1.")


def test_a_filter_that_saw_nothing_has_no_line():
    titles = plots_of([make_estimate("ckf"), diverged(make_estimate("ekf"), 1)])
    assert {line.of for line in titles["dvl: u"].lines} == {"ckf"}


def test_a_free_run_is_known_between_its_finite_samples_only():
    motion = np.zeros((4, 9))
    motion[:, 8] = [3.0, -3.0, np.nan, 0.0]
    run = FreeRun(np.arange(4.0), motion)
    psi = interpolated(np.array([-1.0, 0.5, 1.0, 1.5, 3.0, 4.0]), run, MOTION_SYMBOLS.index("psi"))
    np.testing.assert_array_equal(np.isnan(psi), [True, False, False, True, False, True])
    # The short way round: from 3 to 2 pi - 3, not through zero.
    assert psi[1] == pytest.approx(np.pi)


def test_a_residual_of_an_angle_is_the_short_way_round(dataset, evaluation):
    plots = {plot.title: plot for plot in sensor_plots(dataset.sensors, evaluation.free_runs)}
    residual = plots["attitude: psi, residual"]
    # The free run is 0.02 rad off, and the noise 0.01 rad.
    assert {line.label for line in residual.lines} == {"EKF", "CKF", "TUKF"}
    for line in residual.lines:
        assert np.nanmean(line.values) == pytest.approx(-np.rad2deg(0.02), abs=0.1)
        assert np.nanmax(np.abs(line.values)) < np.rad2deg(0.08)
    assert plots["dvl: u"].lines[0].time.size == TIME.size


def test_a_component_that_only_every_other_of_many_samples_has_is_drawn_with_its_residual():
    time = np.linspace(0.0, 1500.0, 150_000)
    values = np.full((time.size, 3), np.nan)
    values[1::2, 0] = 0.5
    record = SensorRecord(time, values, np.full(3, 0.1))
    run = FreeRun(np.array([0.0, 1500.0]), np.zeros((2, len(MOTION_SYMBOLS))))
    _, residual = sensor_plots({"dvl": record}, {"ckf": run})
    assert np.nanmax(residual.lines[0].values) == 0.5


def test_what_is_left_of_the_depth_is_drawn_where_a_free_run_has_one():
    time = np.linspace(0.0, 10.0, 101)
    record = SensorRecord(time, time[:, None], np.array([0.1]))
    motion = np.zeros((2, len(MOTION_SYMBOLS) + 1))
    with_depth, without = FreeRun(time[[0, -1]], motion), FreeRun(time[[0, -1]], motion[:, :-1])
    assert [plot.title for plot in sensor_plots({"depth": record}, {"ckf": without})] == ["depth: down"]
    _, residual = sensor_plots({"depth": record}, {"ckf": with_depth})
    np.testing.assert_allclose(residual.lines[0].values, time, atol=1e-6)


def test_a_component_looks_the_same_of_every_filter_and_is_named_below_its_autocorrelation():
    alone = make_estimate("ckf")
    sensor = alone.innovations["dvl"]
    # Its surge alone was heard of.
    sensor.innovation[:, 1:] = np.nan
    plot = plots_of([alone, make_estimate("ekf")])["dvl: autocorrelation"]
    looks = {line.label: (line.look, line.key) for line in plot.lines if line.of}
    assert "CKF w" not in looks
    assert looks["EKF u"] == ("component0", "u") == looks["CKF u"]
    assert looks["EKF w"] == ("component2", "w")
