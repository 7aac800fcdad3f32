"""Turns between body axes and the earth, against another library."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from auvid_cli.arrays import wrap
from auvid_cli.vehicle.rigid_body import (
    body_rates,
    body_to_earth,
    earth_to_body,
    euler_angles,
    euler_rates,
    rotation_matrix,
)

ANGLES = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))


def scipy_rotation(angles):
    roll, pitch, yaw = np.transpose(angles)
    return Rotation.from_euler("ZYX", np.column_stack((yaw, pitch, roll)))


@given(ANGLES, st.tuples(*[st.floats(-5, 5)] * 3))
def test_earth_to_body_inverts_body_to_earth(angles, velocity):
    theirs = scipy_rotation([angles]).inv().apply(velocity)
    turned = earth_to_body(np.array([angles]), np.array([velocity]))
    assert turned == pytest.approx(theirs, abs=1e-13)
    assert body_to_earth(np.array([angles]), turned) == pytest.approx(np.array([velocity]), abs=1e-13)
    assert rotation_matrix(np.array(angles)) == pytest.approx(scipy_rotation([angles]).as_matrix()[0], abs=1e-13)


@given(ANGLES)
def test_euler_angles_invert_the_rotation_matrix(angles):
    assert euler_angles(scipy_rotation([angles]).as_matrix())[0] == pytest.approx(angles, abs=1e-13)


@given(ANGLES, st.tuples(*[st.floats(-1, 1)] * 3))
def test_euler_rates_are_those_by_which_the_attitude_turns(angles, rates):
    step = 1e-6
    start = scipy_rotation([angles])
    ahead, behind = (start * Rotation.from_rotvec([sign * step * np.array(rates)]) for sign in (1.0, -1.0))
    difference = (ahead.as_euler("ZYX") - behind.as_euler("ZYX"))[0, ::-1] / (2.0 * step)
    found = euler_rates(np.array([rates]), np.array([angles]))[0]
    assert found == pytest.approx(wrap(difference * 2.0 * step) / (2.0 * step), rel=1e-4, abs=1e-4)


def test_rates_of_a_steady_turn_about_a_tilted_axis():
    # A body that turns at constant rates: its attitude by the exponential map, over the jump of the yaw at 180 degrees.
    time, rates = np.arange(0.0, 6.0, 1e-3), np.array([0.2, -0.1, 0.7])
    start = scipy_rotation([[0.1, 0.2, 2.5]])
    yaw, pitch, roll = (start * Rotation.from_rotvec(time[:, None] * rates)).as_euler("ZYX").T
    angles = np.column_stack((roll, pitch, yaw))
    assert np.abs(np.diff(yaw)).max() > 6.0
    assert body_rates(time, angles)[1:-1] == pytest.approx(np.tile(rates, (time.size - 2, 1)), abs=1e-6)
