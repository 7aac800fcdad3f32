"""When a sensor speaks, on times made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.inspection.timing import clock_jumps, input_timing_checks, new_measurement_rate, timing_checks


def record_of(time, values):
    return SensorRecord(time, np.repeat(values[:, None], 3, axis=1), np.ones(3))


@pytest.fixture
def turning(rng):
    """100 s at 10 Hz of a sine whose course shows within a second."""
    time = 0.1 * np.arange(1000)
    return record_of(time, np.sin(time) + 0.001 * rng.standard_normal(1000))


def judged(record):
    return {check.check: check for check in timing_checks("dvl", record, clock_jumps(record))}


def test_an_even_sensor_passes(turning):
    checks = judged(turning)
    assert all(check.passed for check in checks.values())
    assert checks["rate"].statistic == "10 Hz"


def test_repeated_measurements_lower_the_rate(turning):
    copied = record_of(0.02 * np.arange(5000), np.repeat(turning.values[:, 0], 5))
    assert new_measurement_rate(copied) == pytest.approx(10.0)
    rate = judged(copied)["rate"]
    assert rate.statistic == "50 Hz, new measurements at 10 Hz"
    assert rate.passed is None


def test_held_measurements_lower_the_rate(turning):
    time = 0.1 * np.arange(1000)
    held = record_of(time, turning.values[(0.7 * np.arange(1000) + 1e-9).astype(int), 0])
    rate = judged(held)["rate"]
    assert rate.statistic == "10 Hz, new measurements at 7 Hz"
    assert rate.passed is None


def test_jitter_is_noted(turning, rng):
    shaken = replace(turning, time=turning.time + 0.04 * rng.random(1000))
    jitter = judged(shaken)["jitter"]
    assert jitter.passed is None
    assert "of 0.1" in jitter.threshold


def test_jump_without_motion_is_the_clock(turning):
    leapt = replace(turning, time=turning.time + np.where(turning.time > 30.05, 2.0, 0.0))
    assert clock_jumps(leapt).tolist() == [300]
    assert not judged(leapt)["clock"].passed
    kept = (turning.time < 30.05) | (turning.time > 32.05)
    silent = SensorRecord(turning.time[kept], turning.values[kept], turning.standard_deviation)
    assert clock_jumps(silent).size == 0


def test_resting_vehicle_shows_no_clock_jump(rng):
    time = 0.1 * np.arange(1000)
    still = record_of(time + np.where(time > 30.05, 2.0, 0.0), 0.001 * rng.standard_normal(1000))
    assert clock_jumps(still).size == 0


@pytest.mark.parametrize(("share", "passed"), [(0, True), (20, None), (800, False)])
def test_missing_share_sets_the_result(share, passed, turning):
    values = turning.values.copy()
    values[1 : 1 + share] = np.nan
    missing = judged(replace(turning, values=values))["missing"]
    assert missing.passed is passed
    assert missing.statistic == f"{share / 1000:.2%} of values"


def test_components_that_were_never_measured_are_not_missing(turning):
    values = turning.values.copy()
    values[:, 1:] = np.nan
    missing = judged(replace(turning, values=values))["missing"]
    assert (missing.passed, missing.statistic) == (True, "0.00% of values")


def test_components_with_own_times_are_not_missing(turning):
    values = turning.values.copy()
    values[::3, 0], values[1::3, 0], values[:, 1], values[2::3, 1] = np.nan, np.nan, np.nan, 1.0
    assert judged(replace(turning, values=values))["missing"].passed


def judged_inputs(time, time_constant):
    values = np.zeros((len(time), 4))
    values[::2, 0] = 0.1
    return {check.check: check for check in input_timing_checks(InputRecord(np.asarray(time), values), time_constant)}


def test_even_inputs_pass():
    checks = judged_inputs(0.1 * np.arange(1000), 0.5)
    assert all(check.passed for check in checks.values())
    assert checks["rate"].statistic == "10 Hz"


@pytest.mark.parametrize(("time_constant", "passed"), [(0.1, None), (0.3, True), (None, True)])
def test_slow_inputs_are_noted(time_constant, passed):
    checks = judged_inputs(0.2 * np.arange(500), time_constant)
    assert checks["rate"].passed is passed
    assert checks["gap"].passed is True


def test_input_gap_is_noted_with_its_time():
    time = 0.1 * np.arange(1000)
    gap = judged_inputs(time[(time < 30.05) | (time > 42.05)], 1.0)["gap"]
    assert gap.passed is None
    assert gap.statistic == "12.1 s from t = 30 s on"


@pytest.mark.parametrize(
    ("last", "setting", "passed"),
    [
        (30.5, "", True),
        (31.5, "", False),
        (90.0, "", False),
        # Measurements stamped two seconds late are within the inputs; inputs that act later end later.
        (31.5, "identification.delays={dvl: 2 s, gyroscope: 2 s, attitude: 2 s}", True),
        (31.5, "identification.delays={inputs: 2 s}", True),
        (39.0, "", False),
    ],
)
def test_inputs_that_end_early_fail(last, setting, passed, short_run, with_settings):
    """At 10 Hz until 30 s; by the rule that `Timelines` has."""
    time = 0.1 * np.arange(301)
    motion = np.linspace(0.0, last, 400)
    sensors = {
        name: replace(record, time=motion, values=np.resize(record.values, (400, record.values.shape[1])))
        for name, record in short_run.sensors.items()
    }
    dataset = replace(short_run, inputs=InputRecord(time, np.zeros((301, 4))), sensors=sensors)
    dataset = with_settings(dataset, setting) if setting else dataset
    (end,) = (check for check in inspect_dataset(dataset).checks if (check.subject, check.check) == ("inputs", "end"))
    assert end.passed is passed
    if passed:
        prepare(dataset)
    else:
        assert "--use 0:30" in end.advice
        with pytest.raises(DataError, match="inputs end at t = 30 s"):
            prepare(dataset)


def test_constant_inputs_have_no_rate_check():
    assert input_timing_checks(InputRecord(np.array([0.0, 300.0]), np.ones((2, 4))), 1.0) == []


def test_single_input_has_no_rate_check():
    assert judged_inputs([0.0], 1.0) == {}


def test_components_of_two_devices_have_no_jitter(rng):
    """Roll and pitch at 10 Hz, and a heading at 7 Hz that ends earlier."""
    tilt, compass = 0.1 * np.arange(1000), 0.0012 + np.arange(420) / 7.0
    time = np.union1d(tilt, compass)
    values = np.full((time.size, 3), np.nan)
    values[np.isin(time, tilt), :2] = rng.standard_normal((tilt.size, 2))
    values[np.isin(time, compass), 2] = rng.standard_normal(compass.size)
    checks = judged(SensorRecord(time, values, np.ones(3)))
    assert checks["rate"].statistic == "10 Hz"
    assert checks["jitter"].passed
    assert checks["missing"].passed is None
