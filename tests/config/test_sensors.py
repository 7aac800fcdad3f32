"""Required and optional sensors."""

import pytest

from auvid_cli.config.loading import parse_experiment
from auvid_cli.errors import ConfigError

DIRECT = "sensors={dvl: {rate: 7 Hz, noise: 1 cm/s}, attitude: {source: direct, rate: 10 Hz}}"


def test_unused_sensors_are_optional(text):
    suite = parse_experiment(text, "x", [DIRECT]).sensors
    assert [*suite.given()] == ["dvl", "attitude"]
    assert suite.ahrs() is None


def test_ahrs_has_its_sensors(text):
    suite = parse_experiment(text, "x").sensors
    ahrs = suite.ahrs()
    assert ahrs is not None
    assert (ahrs.attitude, ahrs.magnetometer) == (suite.attitude, suite.magnetometer)


@pytest.mark.parametrize(
    ("missing", "named"),
    [
        (["magnetometer"], "missing: magnetometer"),
        (["accelerometer", "dvl"], "missing: accelerometer, dvl"),
    ],
)
def test_missing_sensor_of_ahrs_raises(text, missing, named):
    with pytest.raises(ConfigError, match=rf"^x:3:1: sensors: an AHRS .*{named}"):
        parse_experiment(text, "x", [f"sensors.{name}=null" for name in missing])


def test_no_sensor_raises(text):
    with pytest.raises(ConfigError, match="expected at least one sensor of gyroscope, accelerometer"):
        parse_experiment(text, "x", ["sensors={name: none}"])
