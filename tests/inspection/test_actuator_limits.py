import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord
from auvid_cli.inspection.excitation import actuator_checks
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.vehicle.parameters import Actuator, Actuators

TIME = np.arange(100.0)


def check_of(values, actuator):
    inputs = InputRecord(TIME, np.column_stack([values, *np.zeros((3, TIME.size))]))
    (check,) = actuator_checks(inputs, Actuators(rudder=actuator))
    return check


@pytest.mark.parametrize(
    ("actuator", "said"),
    [
        (Actuator(saturation=0.2), "20.0% of the time beyond the saturation"),
        (Actuator(dead_band=0.1), "80.0% of the time within the dead band"),
        (Actuator(rate_limit=0.1), "2.0% of the time faster than the rate limit"),
        (Actuator(stall=0.2), "20.0% of the time beyond the stall"),
    ],
)
def test_actuator_limits_state_the_share_of_time(actuator, said):
    values = np.where((TIME >= 40.0) & (TIME < 60.0), 0.3, 0.05)
    check = check_of(values, actuator)
    assert (check.subject, check.check, check.passed, check.statistic) == ("rudder", "actuator limits", None, said)


def test_commands_within_all_limits_pass():
    check = check_of(0.1 * np.sin(TIME), Actuator(saturation=0.2, time_constant=0.1))
    assert (check.passed, check.statistic) == (True, "never reached")


def test_ideal_actuators_have_no_check(simulated_with):
    run = simulated_with("manoeuvre.duration=5 s")
    assert not [check for check in inspect_dataset(run).checks if check.check == "actuator limits"]


def test_inspection_uses_the_actual_fin_angles(simulated_with):
    """Commands at twice the saturation do not look like fins of half the strength."""
    run = simulated_with("vehicle.actuators.fins={dead_band: 6 deg, saturation: 14 deg}", "manoeuvre.duration=60 s")
    checks = {(check.subject, check.check): check for check in inspect_dataset(run).checks}
    assert checks["rudder", "actuator limits"].passed is None
    assert not [check for check in checks.values() if check.passed is False]
