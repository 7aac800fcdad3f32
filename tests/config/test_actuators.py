"""What a vehicle file says of its fins and propeller: units, contradictions, and where the lag stood before."""

import numpy as np
import pytest

from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.actuators import IDEAL, Actuator

FINS = (
    "{dead_band: 0.5 deg, saturation: 20 deg, rate_limit: 60 deg/s, time_constant: 80 ms, "
    "stall: {angle: 15 deg, slope: -0.5}}"
)
LAG = "identification.fin_time_constant=0.1 s"


def test_they_are_read_with_their_units(experiment_with):
    vehicle = experiment_with(
        f"vehicle.actuators.fins={FINS}",
        "vehicle.actuators.propeller={dead_band: 2 N, saturation: 0.1 kN, rate_limit: 50 N/s, time_constant: 0.2 s}",
    ).vehicle
    rudder, elevator, thrust = vehicle.actuators.actuators()
    angles = np.deg2rad([0.5, 20.0, 60.0, 15.0])
    assert rudder == elevator == pytest.approx((*angles[:3], 0.08, angles[3], -0.5))
    assert thrust == pytest.approx(Actuator(2.0, 100.0, 50.0, 0.2))


def test_a_vehicle_that_says_nothing_has_ideal_ones(experiment_with):
    experiment = experiment_with()
    assert set(experiment.vehicle.actuators.actuators()) == {IDEAL}
    assert "actuators" not in dump_experiment(experiment)


def test_they_are_kept_in_data_files(experiment_with):
    experiment = experiment_with(f"vehicle.actuators.fins={FINS}")
    assert parse_experiment(dump_experiment(experiment), "test") == experiment


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("fins={rate_limit: 0}", "rate_limit: must be greater than 0"),
        ("fins={rate_limit: 3 rad}", "rate_limit: expected an angular rate"),
        (
            "fins={dead_band: 20 deg, saturation: 15 deg}",
            "(0.3491 rad) is not less than saturation (0.2618 rad): no com",
        ),
        ("fins={time_constant: -1 s}", "time_constant: must be greater than 0"),
        ("fins={stall: {slope: 0.5}}", "missing key 'angle'"),
        ("fins={stall: {angle: 20 deg, slope: 2}}", "slope: must be less than 1"),
        ("propeller={stall: {angle: 20 deg}}", "unknown key 'stall'"),
        ("propeller={saturation: 20 deg}", "saturation: expected a force"),
        ("propeller={rate_limit: 0 N/s}", "rate_limit: must be greater than 0"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(experiment_with, setting, said):
    with pytest.raises(ConfigError) as error:
        experiment_with(f"vehicle.actuators.{setting}")
    assert said in str(error.value)
    assert str(error.value).count("\n") == 0


def test_the_lag_where_it_stood_before_is_that_of_the_fins(experiment_with):
    experiment = experiment_with(LAG)
    assert experiment == experiment_with("vehicle.actuators.fins.time_constant=0.1 s")
    before = dump_experiment(experiment_with()).replace("identification:", "identification:\n  fin_time_constant: 0.0")
    assert parse_experiment(before, "test") == experiment_with()


def test_two_lags_are_refused(experiment_with):
    with pytest.raises(ConfigError, match="both state a lag: leave out the first"):
        experiment_with(LAG, "vehicle.actuators.fins.time_constant=0.1 s")
