"""Sensors that kinematics tie to each other tell which of them is stamped late."""

import numpy as np
import pytest

from auvid_cli.inspection.delays import likeliest_lag, peak, shifted
from auvid_cli.inspection.inspect import inspect_dataset

PAIRS = {"gyroscope": "attitude", "depth": "attitude", "dvl": "accelerometer"}


@pytest.fixture(scope="module")
def logged(simulated_with):
    """A run with all sensors at 10 Hz."""
    sensors = [f"sensors.{name}.rate=10 Hz" for name in ("gyroscope", "accelerometer", "dvl")]
    return simulated_with(
        "manoeuvre.duration=100 s",
        "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
        "sensors.depth={rate: 10 Hz, noise: 1 cm}",
        *sensors,
    )


@pytest.fixture(scope="module")
def heaving(multisine_with):
    """A run with as much heave as the sinking by pitch."""
    return multisine_with(
        "manoeuvre.duration=60 s",
        "manoeuvre.initial_speed=2 m/s",
        "sensors.depth={rate: 10 Hz, noise: 1 cm}",
        "sensors.dvl.noise=5 mm/s",
    )


def verdicts(dataset):
    return {(check.subject, check.check): check for check in inspect_dataset(dataset).checks}


def test_sound_sensors_have_no_delay(logged):
    found = verdicts(logged)
    for sensor, other in PAIRS.items():
        assert found[sensor, f"delay against {other}"].passed is True


@pytest.mark.parametrize("seconds", [0.4, -0.4])
@pytest.mark.parametrize("sensor", PAIRS)
def test_late_sensor_fails_with_its_delay(sensor, seconds, logged, changed):
    def late(time, _):
        time += seconds

    check = verdicts(changed(logged, sensor, late))[sensor, f"delay against {PAIRS[sensor]}"]
    assert check.passed is False
    named, size = check.statistic.split(" is ")
    assert named == (sensor if seconds > 0.0 else PAIRS[sensor])
    assert float(size.split()[0]) == pytest.approx(abs(seconds), abs=0.06)


def test_dvl_ahead_looks_late_and_is_a_note(logged, changed):
    truth = logged.truth

    def ahead(time, values):
        q, r = (np.interp(time, truth.time, truth.motion[:, row]) for row in (4, 5))
        values[:, 1] += 0.5 * r
        values[:, 2] -= 0.5 * q

    check = verdicts(changed(logged, "dvl", ahead))["dvl", "delay against accelerometer"]
    assert check.passed is None
    assert "later than accelerometer" in check.statistic


def test_late_dvl_is_a_note_at_constant_speed(multisine_with, changed):
    """There the swing of one that sits ahead is all that tells."""

    def late(time, _):
        time += 0.4

    steady = multisine_with("manoeuvre=manoeuvres/doublets.yaml", "manoeuvre.duration=60 s")
    check = verdicts(changed(steady, "dvl", late))["dvl", "delay against accelerometer"]
    assert check.passed is None


def test_heave_positive_upwards_is_no_delay(heaving, changed):
    def upwards(_, values):
        values[:, 2] *= -1.0

    found = verdicts(changed(heaving, "dvl", upwards))
    assert found["dvl", "w against depth"].passed is False
    check = found["depth", "delay against attitude"]
    assert check.passed is True
    assert "sign of w reversed" in check.statistic


def test_late_depth_is_no_wrong_sign(heaving, changed):
    def late(time, _):
        time += 0.8

    check = verdicts(changed(heaving, "depth", late))["depth", "delay against attitude"]
    assert check.passed is False
    assert "the sign" not in check.statistic


def test_contradicting_sensors_have_no_delay_check(logged, changed):
    def nothing_of_the_sort(_, values):
        values[:] = np.random.default_rng(2).standard_normal(values.shape)

    assert ("gyroscope", "delay against attitude") not in verdicts(changed(logged, "gyroscope", nothing_of_the_sort))


def test_peak_of_parabola():
    at = np.arange(-4.0, 5.0)
    lag, deviation = likeliest_lag(-0.5 * ((at - 1.3) / 0.7) ** 2)
    assert (lag, deviation) == pytest.approx((1.3, 0.7))
    assert peak(at, 8) == (0.0, 0.0)


def test_shifted_values_are_missing_at_the_end():
    np.testing.assert_array_equal(shifted(np.arange(4.0), 1), [1.0, 2.0, 3.0, np.nan])
    np.testing.assert_array_equal(shifted(np.arange(4.0), -2), [np.nan, np.nan, 0.0, 1.0])
    for cells in (5, -3, -5):
        np.testing.assert_array_equal(shifted(np.arange(2.0), cells), [np.nan, np.nan])
