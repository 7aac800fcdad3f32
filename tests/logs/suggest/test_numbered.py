"""Fins, quaternions and axes without telling names, against the motion that they were made from."""

import os
from pathlib import Path

import numpy as np
import pytest
import yaml

from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.frames import quaternion_of_euler
from auvid_cli.logs.suggest.numbered import exchanged_axes, fin_roles, quaternion_order
from auvid_cli.logs.suggest.relations import Track
from auvid_cli.logs.suggest.suggest import suggest
from auvid_cli.vehicle.rigid_body import body_rates

CASES = Path(os.environ.get("AUVID_SHARED", Path(__file__).parents[3] / "../shared")) / "cases"
STEP = 0.1
TIME = STEP * np.arange(1500)
PHI, THETA, PSI = 0.1 * np.sin(1.1 * TIME), 0.2 * np.sin(0.37 * TIME), 0.8 * np.sin(0.21 * TIME)
ANGLES = np.column_stack((PHI, THETA, PSI))
RATES = [Track(TIME, rate) for rate in body_rates(TIME, ANGLES).T]


@pytest.mark.parametrize(("axes", "columns"), [("wxyz", [0, 1, 2, 3]), ("xyzw", [1, 2, 3, 0])])
def test_quaternion_order_is_that_which_agrees_with_the_gyroscope(axes, columns):
    found = quaternion_order(TIME, quaternion_of_euler(ANGLES)[:, columns], RATES)
    assert found is not None
    assert found.axes == axes


def test_quaternion_order_without_gyroscope_is_a_question():
    found = quaternion_order(TIME, quaternion_of_euler(ANGLES), [])
    assert found is not None
    assert found.reason.startswith("check:")
    assert quaternion_order(TIME, np.ones((TIME.size, 4)), RATES) is None


def fins_and_rates():
    """Rudder and elevator by steps, and the turn rates that answer them with a lag."""
    rng = np.random.default_rng(3)
    rudder, elevator = (np.repeat(0.2 * rng.uniform(-1, 1, 50), 30) for _ in range(2))
    r, q = np.zeros((2, TIME.size))
    for k in range(TIME.size - 1):
        r[k + 1] = r[k] + STEP * (-r[k] / 1.5 - 0.6 * rudder[k])
        q[k + 1] = q[k] + STEP * (-q[k] - 0.5 * elevator[k])
    return rudder, elevator, Track(TIME, r), Track(TIME, q)


def test_fins_of_x_tail_are_found_by_their_pairs_and_responses():
    rudder, elevator, r, q = fins_and_rates()
    fins = [
        Track(TIME, values) for values in (rudder - elevator, rudder + elevator, elevator - rudder, rudder + elevator)
    ]
    roles = fin_roles(fins, r, q)
    # Deflection of a fin: sign times (rudder - elevator) for upper_right, and so on.
    assert [(role.name, role.sign) for role in roles] == [
        ("upper_right", 1),
        ("lower_right", 1),
        ("lower_left", -1),
        ("upper_left", 1),
    ]


def test_fins_of_cross_are_found_by_their_responses():
    rudder, elevator, r, q = fins_and_rates()
    roles = fin_roles([Track(TIME, values) for values in (-elevator, rudder, elevator, rudder)], r, q)
    assert [(role.name, role.sign) for role in roles] == [("right", -1), ("top", 1), ("left", 1), ("bottom", 1)]


def test_fins_without_response_have_no_place():
    rudder, elevator, r, _ = fins_and_rates()
    assert fin_roles([Track(TIME, rudder), Track(TIME, elevator)], r, None) == []
    still = Track(TIME, np.zeros(TIME.size))
    assert fin_roles([Track(TIME, rudder), Track(TIME, elevator)], still, still) == []


def test_exchanged_axes_of_dvl_and_gyroscope_are_found():
    p, q, _ = RATES
    ahead, aside = Track(TIME, 1.5 + 0.1 * np.sin(TIME)), Track(TIME, 0.1 * np.sin(TIME))
    angles = {"phi": Track(TIME, PHI), "theta": Track(TIME, THETA)}
    assert exchanged_axes({"u": ahead, "v": aside, "p": p, "q": q} | angles, False) == {}
    assert {*exchanged_axes({"u": aside, "v": ahead, "p": q, "q": p} | angles, False)} == {"dvl", "gyroscope"}
    assert exchanged_axes({"u": aside, "v": ahead}, True) == {}


@pytest.mark.recorded
@pytest.mark.skipif(not CASES.is_dir(), reason="the logs are not here")
class TestCases:
    def suggested(self, *files):
        return yaml.safe_load(suggest([open_log(CASES / file) for file in files], Path()))

    def test_fins_of_an_x_tail_are_found_by_number(self):
        fins = self.suggested("x_tail/log.csv")["inputs"]["fins"]
        assert {name: fin["column"] for name, fin in fins.items()} == {
            "upper_right": "fin1_deg",
            "lower_right": "fin2_deg",
            "lower_left": "fin3_deg",
            "upper_left": "fin4_deg",
        }

    @pytest.mark.parametrize(("order", "w"), [("wxyz", "q0"), ("xyzw", "q3")])
    def test_order_of_a_numbered_quaternion_is_found_from_its_numbers(self, order, w):
        folder = f"quat_numbered_{order}"
        files = (f"{folder}/{name}.csv" for name in ("imu", "gyro", "depth"))
        assert self.suggested(*files)["sensors"]["attitude"]["quaternion"]["w"] == w

    def test_exchanged_axes_of_a_dvl_are_put_right(self):
        sensors = self.suggested(*(f"dvl_rfu/{name}.csv" for name in ("dvl", "imu", "depth", "fins")))["sensors"]
        assert sensors["dvl"]["columns"]["u"] == "velocity.y"
        assert sensors["dvl"]["columns"]["w"] == {"column": "velocity.z", "sign": -1}
        assert sensors["gyroscope"]["columns"]["r"] == {"column": "angular_velocity.z", "sign": -1}

    def test_pulses_of_servos_become_fins_and_thrust(self):
        inputs = self.suggested("pwm_fins/log.csv")["inputs"]
        assert (inputs["rudder"]["column"], inputs["rudder"]["centre"]) == ("servo_rudder_pwm", 1500)
        assert inputs["thrust"]["share"]["column"] == "thruster_pwm"
