"""Segments of the data that are used, each with a motion of its own."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.evaluation.accuracy import average_steady_state_error, coefficient_results
from auvid_cli.evaluation.free_run import free_run
from auvid_cli.evaluation.judgement import Grade, Judgement, status_of
from auvid_cli.identification.prepared_data import prepare, used_data, used_spans
from auvid_cli.identification.run import identify
from auvid_cli.identification.timeline import measuring_sensors
from auvid_cli.vehicle.coefficients import SYMBOLS

SOUND = Judgement(Grade.SOUND)

TWO = "identification.use.spans=[[5, 25], [40 s, 60 s]]"


def test_each_segment_has_its_own_measurements_and_no_others(short_run, with_settings):
    parts = [segment.dataset for segment in prepare(with_settings(short_run, TWO)).segments]
    for part, (begin, end) in zip(parts, [(5.0, 25.0), (40.0, 60.0)], strict=True):
        for name, record in part.sensors.items():
            whole = short_run.sensors[name]
            inside = (whole.time >= begin) & (whole.time <= end)
            assert np.array_equal(record.time, whole.time[inside])
            assert np.array_equal(record.values, whole.values[inside], equal_nan=True)
    used = used_data(with_settings(short_run, TWO))
    assert used.sensors["dvl"].time.size == sum(part.sensors["dvl"].time.size for part in parts)


def test_one_segment_is_not_copied(short_run):
    assert np.shares_memory(used_data(short_run).sensors["dvl"].values, short_run.sensors["dvl"].values)


@pytest.mark.slow
def test_two_segments_equal_two_runs_in_sequence(short_run, with_settings, kalman_filter):
    """The coefficients of the first run are the prior of the second, as with another dataset."""
    both = identify(with_settings(short_run, TWO), kalman_filter)
    alone = identify(with_settings(short_run, "identification.use.spans=[[5, 25]]"), kalman_filter)
    assert status_of(both) == "completed"
    assert both.time[0] >= 5.0
    assert both.time[-1] == pytest.approx(60.0)
    assert not ((both.time > 25.0) & (both.time < 40.0)).any()
    n = alone.time.size
    assert np.array_equal(both.mean[:n], alone.mean)
    assert both.steps == both.time.size
    # The coefficients continue; the motion starts again with the deviation of the settings.
    u, drag = both.state.index("u"), both.state.index("X_u|u|")
    assert both.standard_deviation[n, drag] <= alone.standard_deviation[-1, drag] * (1 + 1e-9)
    assert both.mean[n, drag] == pytest.approx(alone.mean[-1, drag], abs=alone.standard_deviation[-1, drag])
    assert both.standard_deviation[n, u] > 0.0
    errors = [average_steady_state_error(coefficient_results(e, short_run.truth, {}, SOUND)) for e in (alone, both)]
    assert errors[1] < errors[0]


def test_one_segment_of_everything_is_the_plain_run(short_run, short_estimates, with_settings):
    estimate = identify(with_settings(short_run, "identification.use.spans=[[0, 1000]]"), FilterName.CKF)
    assert np.array_equal(estimate.mean, short_estimates[FilterName.CKF].mean)


def test_free_run_restarts_in_each_segment(short_run, with_settings):
    dataset = with_settings(short_run, TWO)
    run, errors = free_run(prepare(dataset), identify(dataset, FilterName.CKF))
    broken = np.flatnonzero(np.isnan(run.motion).any(axis=1))
    assert broken.size == 1
    assert run.time[broken[0] + 1] >= 40.0
    assert all(error.mean_absolute_error is not None for error in errors)


def test_long_gap_ends_a_segment(short_run, with_settings):
    dvl = short_run.sensors["dvl"]
    heard = (dvl.time < 20.0) | (dvl.time > 30.0)
    silent = SensorRecord(dvl.time[heard], dvl.values[heard], dvl.standard_deviation)
    dataset = replace(short_run, sensors=short_run.sensors | {"dvl": silent})
    use = with_settings(dataset, "identification.use.longest_gap=2 s").experiment.identification.use
    (first, second) = used_spans(measuring_sensors(dataset), use)
    assert first == (0.0, dvl.time[dvl.time < 20.0][-1])
    assert second == (dvl.time[dvl.time > 30.0][0], 60.0)


def test_slow_segments_are_left_out_but_a_spike_is_not_slow(short_run, with_settings):
    dvl = short_run.sensors["dvl"]
    values = dvl.values.copy()
    values[(dvl.time > 30.0) & (dvl.time < 40.0), 0] = 0.1
    values[150, 0] = 0.0
    dataset = replace(short_run, sensors=short_run.sensors | {"dvl": replace(dvl, values=values)})
    use = with_settings(dataset, "identification.use.least_speed=1 m/s").experiment.identification.use
    first, second = used_spans(measuring_sensors(dataset), use)
    # The spiral begins slowly.
    assert dvl.values[np.searchsorted(dvl.time, first[0]), 0] == pytest.approx(1.0, abs=0.03)
    assert 29.7 < first[1] <= 30.0
    assert 40.0 <= second[0] < 40.3


@pytest.mark.slow
def test_joint_fit_of_segments_agrees_with_a_filter(short_run, with_settings):
    dataset = with_settings(short_run, TWO)
    fit, tukf = (identify(dataset, name) for name in (FilterName.OUTPUT_ERROR, FilterName.TUKF))
    assert status_of(fit) == "completed"
    assert np.array_equal(fit.time, tukf.time)
    assert fit.steps == fit.time.size
    n = len(SYMBOLS)
    assert np.ptp(fit.mean[:, :n], axis=0).max() == 0.0
    apart = np.abs(fit.mean[-1, :n] - tukf.mean[-1, :n]) / tukf.standard_deviation[-1, :n]
    assert np.sqrt(np.mean(apart**2)) < 1.0
    # Each has its own motion, as near to the measurements as those of the filter, and both say more than one.
    velocity = slice(n, n + 3)
    assert np.abs(fit.mean[:, velocity] - tukf.mean[:, velocity]).max() < 0.05
    alone = identify(with_settings(short_run, "identification.use.spans=[[5, 25]]"), FilterName.OUTPUT_ERROR)
    assert np.all(fit.standard_deviation[-1, :n] < alone.standard_deviation[-1, :n])


def test_covariance_of_segments_is_that_of_the_last_motion(short_run, with_settings):
    fit = identify(with_settings(short_run, TWO), FilterName.OUTPUT_ERROR)
    assert fit.covariance.shape == (len(fit.state), len(fit.state))
    assert_allclose(np.sqrt(np.diag(fit.covariance)), fit.standard_deviation[-1], rtol=1e-9)


@pytest.mark.slow
def test_a_fit_of_several_segments_that_blows_up_in_one_says_when(short_run, with_settings):
    """Inputs that nothing can follow, from a time within the second segment."""
    values = short_run.inputs.values.copy()
    values[short_run.inputs.time > 50.0] = 1e6
    broken = replace(short_run, inputs=replace(short_run.inputs, values=values))
    fit = identify(with_settings(broken, TWO), FilterName.OUTPUT_ERROR)
    assert fit.status.startswith("diverged at t = 50.")
    assert np.isfinite(fit.mean).all()
    assert 40.0 < fit.time[-1] <= 50.1


def test_no_remaining_segment_is_refused(short_run, with_settings):
    with pytest.raises(DataError, match=r"identification\.use.*t = 0 s to 60 s"):
        prepare(with_settings(short_run, "identification.use.spans=[[100, 200]]"))


@pytest.mark.parametrize(
    ("spans", "words"),
    [
        ("[[1, 1]]", "the end must be later"),
        ("[[1, 5], [4, 6]]", "two spans overlap from 4 s to 5 s"),
        ("[[1, 2, 3]]", r"expected \[begin, end\]"),
        ("5", r"expected a list of \[begin, end\]"),
        ("[[1 m, 2]]", "expected a time"),
    ],
)
def test_wrong_spans_are_refused(spans, words, experiment_with):
    with pytest.raises(ConfigError, match=words):
        experiment_with(f"identification.use.spans={spans}")


def test_segment_without_complete_measurements_has_a_start(short_run, with_settings):
    """As without a roll angle."""
    attitude = short_run.sensors["attitude"]
    no_roll = attitude.values.copy()
    no_roll[:, 0] = np.nan
    poor = replace(short_run, sensors=short_run.sensors | {"attitude": replace(attitude, values=no_roll)})
    (segment,) = prepare(with_settings(poor, "identification.use.spans=[[40, 60]]")).segments
    assert segment.timelines.span[0] == pytest.approx(40.0, abs=0.15)
    heading = attitude.values[attitude.time <= segment.timelines.span[0], 2][-1]
    assert segment.motion[8] == heading
    assert segment.motion[6] == 0.0
