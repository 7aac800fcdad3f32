import numpy as np
import pytest
from scipy.stats import chi2

from auvid_cli.evaluation.predicted_motion import FreeRun
from auvid_cli.report.page.course import interpolated, sensor_plots
from auvid_cli.report.page.residuals import innovation_parts
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
