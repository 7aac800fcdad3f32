"""A depth sensor witnesses pitch, heave and itself."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.evaluation.checks import failed
from auvid_cli.evaluation.inspection.inspect import inspect_dataset


@pytest.fixture(scope="module")
def dive(simulated_with):
    """A spiral with a depth sensor of 5 Hz and 1 cm, from where the vehicle truly was; no accelerometer."""
    dataset = simulated_with("sensors.attitude.source=direct")
    assert dataset.truth is not None
    time = np.arange(0.0, 300.0, 0.2)
    down = np.interp(time, dataset.truth.time, dataset.truth.position[:, 2])
    noise = 0.01 * np.random.default_rng(5).standard_normal(time.size)
    sensors = {name: record for name, record in dataset.sensors.items() if name != "accelerometer"}
    depth = SensorRecord(time, (down + noise)[:, None], np.array([0.01]))
    return replace(dataset, sensors=sensors | {"depth": depth})


def fails_of(dataset):
    return {(check.subject, check.check) for check in failed(inspect_dataset(dataset).checks)}


def test_sound_depth_passes(dive):
    checks = inspect_dataset(dive).checks
    assert not failed(checks)
    assert {"depth against pitch and u", "w against depth", "pitch offset"} <= {check.check for check in checks}


def test_altitude_taken_for_depth_is_caught(dive, changed):
    def turn(time, values):
        values *= -1.0

    assert fails_of(changed(dive, "depth", turn)) == {("depth", "depth against pitch and u")}


def test_heave_counted_upwards_is_caught(dive, changed):
    def turn(time, values):
        values[:, 2] *= -1.0

    assert fails_of(changed(dive, "dvl", turn)) == {("dvl", "w against depth")}


def test_pitch_mounted_12_degrees_off_is_caught(dive, changed):
    def lift(time, values):
        values[:, 1] -= np.deg2rad(12.0)

    dataset = changed(dive, "attitude", lift)
    assert fails_of(dataset) == {("attitude", "pitch offset")}
    (check,) = failed(inspect_dataset(dataset).checks)
    assert "-12 deg" in check.statistic


@pytest.mark.parametrize(("column", "symbol"), [(1, "v"), (2, "w")])
def test_without_depth_and_accelerometer_the_turn_tells_the_sign(column, symbol, dive, changed):
    def turn(time, values):
        values[:, column] *= -1.0

    sensors = {name: record for name, record in dive.sensors.items() if name != "depth"}
    assert fails_of(replace(dive, sensors=sensors)) == set()
    assert fails_of(changed(replace(dive, sensors=sensors), "dvl", turn)) == {("dvl", f"{symbol} in a turn")}
