import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.data.signals import noise_standard_deviation
from auvid_cli.logs.convert import Channel, hold, mix, propeller_thrust, thruster_force
from auvid_cli.logs.frames import interpolate, velocity_at_origin

DEFLECTION = st.floats(-0.5, 0.5)
# Place of a fin's middle, (y, z) seen from behind, and the direction in which a positive one pushes: to starboard,
# or up (negative z) where it cannot push sideways.
PLACES = {
    "top": ((0, -1), (1, 0)),
    "bottom": ((0, 1), (1, 0)),
    "right": ((1, 0), (0, -1)),
    "left": ((-1, 0), (0, -1)),
    "upper_right": ((1, -1), (1, 1)),
    "lower_right": ((1, 1), (1, -1)),
    "lower_left": ((-1, 1), (1, 1)),
    "upper_left": ((-1, -1), (1, -1)),
}
TAILS = (
    ("top", "right", "left"),
    ("top", "bottom", "right", "left"),
    ("upper_right", "lower_right", "lower_left", "upper_left"),
)


@pytest.mark.parametrize("tail", TAILS)
@given(st.data())
def test_mixed_rudder_and_elevator_have_force_of_fins(tail, data):
    fins = {name: data.draw(DEFLECTION) for name in tail}
    mixed = mix({name: np.array([angle]) for name, angle in fins.items()})
    for name in tail:
        place, push = np.array(PLACES[name][0]), np.array(PLACES[name][1])
        assert place @ push == 0  # A fin pushes across its span.
        assert push[0] > 0 or (push[0] == 0 and push[1] < 0)
    # Fins that push alike: the sideways push of all is that of the rudder on each, the push up that of the elevator.
    sideways = sum(angle * np.sign(PLACES[name][1][0]) for name, angle in fins.items())
    upwards = sum(-angle * np.sign(PLACES[name][1][1]) for name, angle in fins.items())
    by_rudder = sum(np.sign(PLACES[name][1][0]) ** 2 for name in tail)
    by_elevator = sum(np.sign(PLACES[name][1][1]) ** 2 for name in tail)
    assert mixed.rudder[0] * by_rudder == pytest.approx(sideways, abs=1e-14)
    assert mixed.elevator[0] * by_elevator == pytest.approx(upwards, abs=1e-14)


def test_differential_fins_are_neither_rudder_nor_elevator():
    mixed = mix({"top": np.array([0.1]), "right": np.array([0.2]), "left": np.array([-0.2])})
    assert (mixed.rudder[0], mixed.elevator[0]) == pytest.approx((0.1, 0.0), abs=1e-15)
    assert mixed.rest == pytest.approx(0.2 * np.sqrt(2 / 3))


def test_channels_hold_until_next_value():
    rudder = Channel(np.array([0.0, 1.0, 3.0]), np.array([1.0, 2.0, 3.0]))
    thrust = Channel(np.array([0.5, 2.0]), np.array([10.0, 20.0]))
    time, held = hold({"rudder": rudder, "thrust": thrust})
    assert time.tolist() == [0.5, 1.0, 2.0, 3.0]
    assert held["rudder"].tolist() == [1.0, 2.0, 2.0, 3.0]
    assert held["thrust"].tolist() == [10.0, 10.0, 20.0, 20.0]


def test_thrust_by_hand():
    n = np.array([10.0, -10.0])
    assert propeller_thrust(n, np.array([2.0, 2.0]), 0.05, -0.1).tolist() == [5.0 - 2.0, -5.0 - 2.0]
    assert thruster_force(np.array([50.0, -100.0]), 12.0).tolist() == [3.0, -12.0]


def test_lever_arm_by_hand():
    # Yawing at 0.5 rad/s, a sensor 2 m ahead moves 1 m/s to starboard; pitching up, it rises.
    assert velocity_at_origin(np.array([[3.0, 1.0, 0.0]]), np.array([[0.0, 0.0, 0.5]]), np.array([2.0, 0.0, 0.0])) == (
        pytest.approx(np.array([[3.0, 0.0, 0.0]]))
    )
    assert velocity_at_origin(np.array([[3.0, 0.0, -1.0]]), np.array([[0.0, 0.5, 0.0]]), np.array([2.0, 0.0, 0.0])) == (
        pytest.approx(np.array([[3.0, 0.0, 0.0]]))
    )


def test_interpolation_handles_angle_jumps_and_gaps():
    time = np.array([0.0, 1.0, 2.0, 3.0, 20.0, 20.5])
    angle = np.array([[3.1], [-3.1], [-3.1], [-3.1], [0.0], [np.nan]])
    found = interpolate(time, angle, np.array([-0.1, 0.5, 1.0, 10.0, 20.0, 20.2]), is_angle=True)[:, 0]
    assert np.isnan(found[[0, 3, 5]]).all()
    assert np.cos(found[1]) == pytest.approx(-1.0)
    assert np.mod(found[2], 2 * np.pi) == pytest.approx(2 * np.pi - 3.1)


def test_noise_of_a_signal_with_spikes_and_turns(rng):
    time = np.arange(20_000) * 0.01
    signal = 8.0 * time + 0.02 * rng.standard_normal(time.size)
    signal[::500] += 1.0
    wrapped = np.mod(signal, 2 * np.pi)
    assert noise_standard_deviation(signal) == pytest.approx(0.02, rel=0.05)
    assert noise_standard_deviation(wrapped, is_angle=True) == pytest.approx(0.02, rel=0.05)
    assert np.isnan(noise_standard_deviation(np.array([1.0, np.nan, 2.0])))
