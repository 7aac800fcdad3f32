"""Angles that jump, on records made by hand."""

import numpy as np
import pytest

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.inspection.single_sensor import angle_steps, gimbal_check, step_check

TIME = 0.1 * np.arange(600)
RATE = 0.4


def attitude(psi, theta=0.0):
    wrapped = (psi + np.pi) % (2.0 * np.pi) - np.pi
    return SensorRecord(TIME, np.stack([0.0 * TIME, theta + 0.0 * TIME, wrapped], axis=1), np.full(3, 0.01))


def gyroscope(r):
    return SensorRecord(TIME, np.stack([0.0 * TIME, 0.0 * TIME, r + 0.0 * TIME], axis=1), np.full(3, 0.01))


def test_full_turn_is_no_step():
    sensors = {"attitude": attitude(RATE * TIME), "gyroscope": gyroscope(RATE)}
    before, _, _ = angle_steps(sensors, "attitude", 2)
    assert before.size == 0


def test_fast_turn_with_matching_rates_is_no_step():
    r = np.where(np.abs(TIME - 30.0) < 0.55, 1.5, 0.0)
    psi = np.append(0.0, np.cumsum(0.05 * (r[1:] + r[:-1])))
    verdict = step_check("attitude", "psi", *angle_steps({"attitude": attitude(psi)}, "attitude", 2)[::2])
    assert not verdict.passed
    sensors = {"attitude": attitude(psi), "gyroscope": gyroscope(r)}
    assert angle_steps(sensors, "attitude", 2)[0].size == 0


def test_yaw_rate_of_pitched_vehicle_is_converted():
    # psi_dot = r / cos(theta), Fossen (2011), eq. (2.26) at zero roll: 60 deg of pitch double it.
    theta, r = np.deg2rad(60.0), 3.0
    sensors = {"attitude": attitude(2.0 * r * TIME, theta), "gyroscope": gyroscope(r)}
    assert angle_steps(sensors, "attitude", 2)[0].size == 0


def test_excursion_across_north_is_one_excursion():
    psi = np.deg2rad(175.0) + np.where((TIME > 20.05) & (TIME < 21.05), np.deg2rad(13.0), 0.0)
    before, after, size = angle_steps({"attitude": attitude(psi), "gyroscope": gyroscope(0.0)}, "attitude", 2)
    assert before == pytest.approx([20.0, 21.0])
    assert after == pytest.approx([20.1, 21.1])
    assert np.rad2deg(size) == pytest.approx([13.0, -13.0])
    check = step_check("attitude", "psi", before, size)
    assert check.statistic == "1 times away by 13 deg and back after 1 s: t = 20 s"


def test_permanent_step_fails_with_its_size():
    psi = np.where(TIME > 20.05, np.deg2rad(-40.0), 0.0)
    before, _, size = angle_steps({"attitude": attitude(psi), "gyroscope": gyroscope(0.0)}, "attitude", 2)
    assert step_check("attitude", "psi", before, size).statistic == "1; largest -40 deg at t = 20 s"


@pytest.mark.parametrize(("degrees", "passed"), [(30.0, True), (-80.0, None), (89.0, False)])
def test_pitch_near_90_degrees_fails(degrees, passed):
    assert gimbal_check(attitude(0.0 * TIME, np.deg2rad(degrees))).passed is passed
