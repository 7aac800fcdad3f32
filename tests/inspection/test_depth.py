"""A depth sensor witnesses pitch, heave and itself."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.inspection.inspect import inspect_dataset

from .conftest import ATTITUDE


@pytest.fixture(scope="module")
def dive(simulated_with):
    """A spiral with a depth sensor of 5 Hz and 1 cm, from where the vehicle truly was; no accelerometer."""
    dataset = simulated_with("sensors.attitude.source=direct", ATTITUDE)
    assert dataset.truth is not None
    time = np.arange(0.0, 300.0, 0.2)
    down = np.interp(time, dataset.truth.time, dataset.truth.position[:, 2])
    noise = 0.01 * np.random.default_rng(5).standard_normal(time.size)
    sensors = {name: record for name, record in dataset.sensors.items() if name != "accelerometer"}
    depth = SensorRecord(time, (down + noise)[:, None], np.array([0.01]))
    return replace(dataset, sensors=sensors | {"depth": depth})


def fails_of(dataset):
    return {(check.subject, check.check) for check in inspect_dataset(dataset).checks.failed()}


@pytest.mark.slow
def test_sound_depth_passes(dive):
    checks = inspect_dataset(dive).checks
    assert not checks.failed()
    assert {"depth against pitch and u", "w against depth", "pitch offset"} <= {check.check for check in checks}


@pytest.mark.slow
def test_altitude_as_depth_fails(dive, changed):
    def turn(time, values):
        values *= -1.0

    assert fails_of(changed(dive, "depth", turn)) == {("depth", "depth against pitch and u")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensor", "component", "factor", "words"),
    [
        ("depth", 0, 1.0 / 0.3048, "depth is in feet"),
        ("depth", 0, 1000.0, "depth is in mm"),
        ("dvl", slice(None), 3600.0 / 1852.0, "u is in knots"),
        ("dvl", slice(None), 1852.0 / 3600.0, "converted from knots"),
    ],
)
def test_wrong_unit_of_depth_or_velocity_is_named(sensor, component, factor, words, dive, changed):
    def scale(time, values):
        values[:, component] *= factor

    (check,) = inspect_dataset(changed(dive, sensor, scale)).checks.failed()
    assert (check.subject, check.check) == ("depth", "depth against pitch and u")
    assert words in check.advice


def test_heave_positive_upwards_fails(dive, changed):
    def turn(time, values):
        values[:, 2] *= -1.0

    assert fails_of(changed(dive, "dvl", turn)) == {("dvl", "w against depth")}


@pytest.mark.slow
def test_pitch_offset_fails_with_its_size(dive, changed):
    def lift(time, values):
        values[:, 1] -= np.deg2rad(12.0)

    dataset = changed(dive, "attitude", lift)
    assert fails_of(dataset) == {("attitude", "pitch offset")}
    (check,) = inspect_dataset(dataset).checks.failed()
    assert "-12 deg" in check.statistic


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [11.0, -11.0])
def test_temporary_pitch_offset_fails_with_size_and_time(degrees, dive, changed):
    """Depth against pitch and surge is sound over seconds, and is not blamed."""

    def lift(time, values):
        values[(time >= 80.0) & (time < 200.0), 1] += np.deg2rad(degrees)

    checks = inspect_dataset(changed(dive, "attitude", lift)).checks
    fails = {(check.subject, check.check): check for check in checks.failed()}
    assert set(fails) == {("attitude", "pitch offset"), ("attitude", "steps of theta")}
    words = fails["attitude", "pitch offset"].statistic.split()
    assert float(words[2]) == pytest.approx(degrees, abs=0.5)
    assert [float(words[words.index(word) + at]) for word, at in (("t", 2), ("to", 1), ("s,", 1))] == pytest.approx(
        [80.0, 200.0, 0.0], abs=0.5
    )


def test_constant_pitch_is_no_offset(dive, changed):
    """Depth then follows nothing, neither over seconds nor over the run."""

    def hold(time, values):
        values[:, 1] = np.median(values[:, 1]) + 0.002 * np.random.default_rng(2).standard_normal(time.size)

    assert fails_of(changed(dive, "attitude", hold)) == {("depth", "depth against pitch and u")}


@pytest.mark.slow
@pytest.mark.parametrize(("column", "symbol"), [(1, "v"), (2, "w")])
def test_wrong_sign_fails_by_slip_in_turns(column, symbol, dive, changed):
    def turn(time, values):
        values[:, column] *= -1.0

    sensors = {name: record for name, record in dive.sensors.items() if name != "depth"}
    assert fails_of(replace(dive, sensors=sensors)) == set()
    assert fails_of(changed(replace(dive, sensors=sensors), "dvl", turn)) == {("dvl", f"{symbol} in a turn")}
