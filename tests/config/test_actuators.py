"""Fins and propeller in a vehicle file: units, contradictions, and the lag in old files."""

import numpy as np
import pytest

from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.parameters import IDEAL, Actuator

FINS = (
    "{dead_band: 0.5 deg, saturation: 20 deg, rate_limit: 60 deg/s, time_constant: 80 ms, "
    "stall: {angle: 15 deg, slope: -0.5}}"
)
LAG = "identification.fin_time_constant=0.1 s"


def test_actuators_are_converted_to_si(experiment_with):
    vehicle = experiment_with(
        f"vehicle.actuators.fins={FINS}",
        "vehicle.actuators.propeller={dead_band: 2 N, saturation: 0.1 kN, rate_limit: 50 N/s, time_constant: 0.2 s}",
    ).vehicle
    rudder, elevator, thrust = vehicle.actuators.actuators()
    angles = np.deg2rad([0.5, 20.0, 60.0, 15.0])
    assert rudder == elevator == pytest.approx((*angles[:3], 0.08, angles[3], -0.5))
    assert thrust == pytest.approx(Actuator(2.0, 100.0, 50.0, 0.2))


def test_missing_actuators_are_ideal(experiment_with):
    experiment = experiment_with()
    assert set(experiment.vehicle.actuators.actuators()) == {IDEAL}
    assert "actuators" not in dump_experiment(experiment)


def test_actuators_survive_dump(experiment_with):
    experiment = experiment_with(f"vehicle.actuators.fins={FINS}")
    assert parse_experiment(dump_experiment(experiment), "test") == experiment


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("fins={rate_limit: 0}", "rate_limit: must be greater than 0"),
        ("fins={rate_limit: 3 rad}", "rate_limit: expected an angular rate"),
        (
            "fins={dead_band: 20 deg, saturation: 15 deg}",
            "less than saturation",
        ),
        ("fins={time_constant: -1 s}", "time_constant: must be greater than 0"),
        ("fins={stall: {slope: 0.5}}", "missing key 'angle'"),
        ("fins={stall: {angle: 20 deg, slope: 2}}", "slope: must be less than 1"),
        ("propeller={stall: {angle: 20 deg}}", "unknown key 'stall'"),
        ("propeller={saturation: 20 deg}", "saturation: expected a force"),
        ("propeller={rate_limit: 0 N/s}", "rate_limit: must be greater than 0"),
    ],
)
def test_invalid_actuator_gives_one_line_message(experiment_with, setting, message):
    with pytest.raises(ConfigError) as error:
        experiment_with(f"vehicle.actuators.{setting}")
    assert message in str(error.value)
    assert str(error.value).count("\n") == 0


def test_old_lag_moves_to_fins(experiment_with):
    experiment = experiment_with(LAG)
    assert experiment == experiment_with("vehicle.actuators.fins.time_constant=0.1 s")
    before = dump_experiment(experiment_with()).replace("identification:", "identification:\n  fin_time_constant: 0.0")
    assert parse_experiment(before, "test") == experiment_with()


def test_two_lags_raise(experiment_with):
    with pytest.raises(ConfigError, match="fin_time_constant: the lag is already"):
        experiment_with(LAG, "vehicle.actuators.fins.time_constant=0.1 s")
