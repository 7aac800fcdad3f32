"""Which sensors must be there."""

import pytest

from auvid_cli.config.loading import parse_experiment
from auvid_cli.errors import ConfigError

DIRECT = "sensors={dvl: {rate: 7 Hz, noise: 1 cm/s}, attitude: {source: direct, rate: 10 Hz}}"


def test_what_nothing_uses_need_not_be_there(text):
    suite = parse_experiment(text, "x", [DIRECT]).sensors
    assert [*suite.given()] == ["dvl", "attitude"]
    assert suite.ahrs() is None


def test_an_ahrs_is_there_with_its_sensors(text):
    suite = parse_experiment(text, "x").sensors
    ahrs = suite.ahrs()
    assert ahrs is not None
    assert (ahrs.attitude, ahrs.magnetometer) == (suite.attitude, suite.magnetometer)


@pytest.mark.parametrize(
    ("missing", "named"),
    [
        (["magnetometer"], "there is no magnetometer"),
        (["accelerometer", "dvl"], "there is no accelerometer and no dvl"),
    ],
)
def test_what_an_ahrs_computes_from_must_be_there(text, missing, named):
    with pytest.raises(ConfigError, match=rf"^x:3:1: sensors: an AHRS .*{named}; state what is missing, or take"):
        parse_experiment(text, "x", [f"sensors.{name}=null" for name in missing])


def test_no_sensor_at_all_is_refused(text):
    with pytest.raises(ConfigError, match="expected at least one sensor of gyroscope, accelerometer"):
        parse_experiment(text, "x", ["sensors={name: none}"])
