"""True motion against an independent integrator, and manoeuvres against their settings."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli import arrays
from auvid_cli.errors import SimulationError
from auvid_cli.numerics import LANES
from auvid_cli.simulation import motion
from auvid_cli.simulation import simulate as simulation
from auvid_cli.simulation.motion import sample_motion
from auvid_cli.simulation.simulate import draw_disturbance
from auvid_cli.vehicle.equations import motion_derivative
from auvid_cli.vehicle.rigid_body import mass_matrix

STRAIGHT = "{type: multisine, duration: 60 s, speed: 2 m/s, initial_speed: 1 m/s}"
ZIGZAG = "{type: zigzag, duration: 60 s, speed: 2 m/s, rudder: 10 deg, heading: 20 deg, approach: 5 s}"
CIRCLE = "{type: turning_circle, duration: 180 s, speed: 2 m/s, rudder: -8 deg, approach: 5 s}"


def slope(time, state, truth, inputs, push):
    """Return the derivatives of motion and position, the latter by elementary rotation matrices."""
    block, rate = np.zeros(9 * LANES), np.zeros(9 * LANES)
    coefficients = np.zeros(truth.coefficients.size * LANES)
    block[::LANES], coefficients[::LANES] = state[:9], truth.coefficients
    motion_derivative(block, coefficients, inputs, truth.constants, 1, rate)
    cosine, sine = np.cos(state[6:9]), np.sin(state[6:9])
    x, y, z = state[:3]
    y, z = cosine[0] * y - sine[0] * z, sine[0] * y + cosine[0] * z
    x, z = cosine[1] * x + sine[1] * z, -sine[1] * x + cosine[1] * z
    x, y = cosine[2] * x - sine[2] * y, sine[2] * x + cosine[2] * y
    rate[: 6 * LANES : LANES] += push
    return np.concatenate([rate[::LANES], [x, y, z]])


@pytest.mark.slow
@pytest.mark.parametrize(("disturbance", "tolerance"), [("{}", 1.0), ("{force: {standard_deviation: 5 N}}", 10.0)])
def test_motion_and_position_agree_with_independent_integrator(disturbance, tolerance, fly, experiment_with):
    whole = "manoeuvre.duration=30 s", "manoeuvre.input_rate=10 Hz", f"manoeuvre.disturbance={disturbance}"
    truth = fly(None, *whole, longest_step=0.00625)
    experiment = experiment_with(*whole)
    force = draw_disturbance(experiment.manoeuvre.disturbance, truth.time, experiment.seed)
    push = np.linalg.inv(mass_matrix(experiment.vehicle.known_parameters())) @ force.T
    state = np.concatenate([truth.motion[0], truth.position[0]])
    for tick in range(truth.time.size - 1):
        span = truth.time[tick], truth.time[tick + 1]
        held = truth, truth.inputs[tick], push[:, tick]
        solution = solve_ivp(slope, span, state, "DOP853", args=held, rtol=1e-10, atol=1e-11)
        state = solution.y[:, -1]
    assert np.abs(truth.position[-1]).min() > 1.0, "the test should move the vehicle along every axis"
    assert_allclose(truth.motion[-1], state[:9], rtol=tolerance * 1e-6, atol=tolerance * 1e-8)
    assert_allclose(truth.position[-1], state[9:], rtol=tolerance * 1e-7)


def test_blocks_in_files_give_same_data(experiment_with, monkeypatch):
    experiment = experiment_with("manoeuvre.duration=10 s", "vehicle.actuators.fins.time_constant=0.1 s")
    whole = simulation.simulate(experiment)
    monkeypatch.setattr(arrays, "MAX_IN_MEMORY", 0)
    monkeypatch.setattr(motion, "BLOCK", 99)
    monkeypatch.setattr(simulation, "BLOCK", 98)
    parts = simulation.simulate(experiment)
    assert np.array_equal(parts.inputs.values, whole.inputs.values)
    assert np.array_equal(parts.truth.motion, whole.truth.motion)
    assert np.array_equal(parts.truth.position, whole.truth.position)
    for name, record in whole.sensors.items():
        assert np.array_equal(parts.sensors[name].values, record.values, equal_nan=True), name


def test_half_the_step_gives_same_motion(fly):
    default = fly(None, "manoeuvre.duration=60 s")
    halved = fly(None, "manoeuvre.duration=60 s", longest_step=0.00125)
    assert_allclose(default.motion, halved.motion, atol=1e-9)
    assert_allclose(default.position, halved.position, atol=1e-8)


@pytest.mark.parametrize(("sea", "tolerance"), [("{}", 1e-6), ("{moment: {standard_deviation: 0.5 N*m}}", 2e-5)])
def test_motion_between_ticks_leads_to_next_tick(sea, tolerance, fly):
    truth = fly(None, "manoeuvre.duration=20 s", f"manoeuvre.disturbance={sea}")
    just_before = truth.time[1:] - 1e-9
    motion, _ = sample_motion(truth, just_before)
    assert_allclose(motion, truth.motion[1:], atol=1e-7)

    middle = 0.5 * (truth.time[1:] + truth.time[:-1])
    _, rate = sample_motion(truth, middle)
    step = 1e-4
    change = sample_motion(truth, middle + step)[0] - sample_motion(truth, middle - step)[0]
    assert_allclose(rate, change / (2 * step), atol=tolerance)


def test_fins_keep_limits_of_angle_and_rate(fly):
    angle, rate = np.deg2rad(6.0), np.deg2rad(20.0)
    truth = fly(
        None, "manoeuvre.duration=60 s", "manoeuvre.limits.fin_angle=6 deg", "manoeuvre.limits.fin_rate=20 deg/s"
    )
    fins, tick = truth.inputs[:, :2], truth.time[1]
    assert np.abs(fins).max() == pytest.approx(angle, rel=1e-12)
    assert np.abs(np.diff(fins, axis=0)).max() == pytest.approx(rate * tick, rel=1e-9)


def test_fins_of_x_tail_keep_limits_of_angle_and_rate(fly):
    angle, rate = np.deg2rad(20.0), np.deg2rad(40.0)
    limits = "manoeuvre.limits.fin_angle=20 deg", "manoeuvre.limits.fin_rate=40 deg/s"
    truth = fly(None, "vehicle.geometry.fins.tail=x", "manoeuvre.duration=60 s", *limits)
    rudder, elevator = truth.inputs[:, :2].T
    fins, tick = np.array([rudder - elevator, rudder + elevator]), truth.time[1]
    assert np.abs(fins).max(axis=1) == pytest.approx([angle, angle], rel=1e-12)
    assert np.abs(np.diff(fins)).max() == pytest.approx(rate * tick, rel=1e-9)


def test_thrust_keeps_limit(fly):
    truth = fly(STRAIGHT, "manoeuvre.limits.surge_force=12 N")
    assert np.abs(truth.inputs[:, 2]).max() == 12.0


def test_spiral_has_pitch_and_turn_rate_of_settings(fly):
    truth = fly(None)
    after = truth.time > 60.0
    whole_turns = truth.motion[after, 8]
    mean_rate = (whole_turns[-1] - whole_turns[0]) / np.ptp(truth.time[after])
    assert np.rad2deg(mean_rate) == pytest.approx(8.0, rel=0.05)
    assert np.rad2deg(truth.motion[after, 7].mean()) == pytest.approx(-10.0, abs=2.0)
    assert truth.motion[after, 0].mean() == pytest.approx(3.9, rel=0.05)
    sinking = (truth.position[-1, 2] - truth.position[after, 2][0]) / np.ptp(truth.time[after])
    assert sinking == pytest.approx(3.9 * np.sin(np.deg2rad(10.0)), rel=0.25)
    north_and_east = truth.position[after, :2]
    assert np.ptp(north_and_east, axis=0).max() < 4 * 3.9 / np.deg2rad(8.0), "it should stay on its helix"


def test_thrust_of_steady_run_equals_drag(fly, experiment_with):
    truth = fly(STRAIGHT)
    drag = -experiment_with().vehicle.all_coefficients()["X_u|u|"]
    u = truth.motion[-1, 0]
    assert u == pytest.approx(2.0, rel=1e-3)
    assert truth.inputs[-1, 2] == pytest.approx(drag * u**2, rel=1e-3)
    assert_allclose(truth.motion[-1, 1:6], 0.0, atol=1e-6)


def test_speed_at_constant_thrust_is_hyperbolic_tangent(fly, experiment_with):
    truth = fly(STRAIGHT, "manoeuvre.autopilot.speed=false", "manoeuvre.initial_speed=0 m/s")
    vehicle = experiment_with().vehicle
    drag, known = -vehicle.all_coefficients()["X_u|u|"], vehicle.known_parameters()
    thrust, inertia = drag * 2.0**2, known["m"] - known["X_udot"]
    assert_allclose(truth.inputs[:, 2], thrust, rtol=1e-12)
    # 2 tanh(rate t) solves inertia du/dt = thrust - drag u^2, except for a small pitch from the low zG.
    rate = np.sqrt(thrust * drag) / inertia
    assert_allclose(truth.motion[:, 0], 2.0 * np.tanh(rate * truth.time), atol=0.01)


def test_propeller_torque_is_proportional_to_thrust(fly):
    torque = "vehicle.parameters.K_prop=-0.5 N*m"
    truth = fly(STRAIGHT, torque, "vehicle.parameters.X_prop=4 N")
    assert_allclose(truth.inputs[:, 3], truth.inputs[:, 2] * -0.5 / 4.0, rtol=1e-12)


def test_zigzag_reverses_at_heading_and_overshoots(fly):
    truth = fly(ZIGZAG)
    rudder, heading, time = truth.inputs[:, 0], truth.motion[:, 8], truth.time
    before = time < 5.0 - 1e-9
    assert_allclose(rudder[before], 0.0, atol=1e-12)
    assert_allclose(heading[before], 0.0, atol=1e-9)
    assert np.abs(rudder).max() == pytest.approx(np.deg2rad(10.0))
    turns = np.flatnonzero(np.sign(rudder[1:]) * np.sign(rudder[:-1]) < 0)
    assert turns.size >= 3
    for turn in turns:
        # The heading changes further while the fin returns to zero at its rate limit.
        assert abs(heading[turn]) >= np.deg2rad(20.0)
    peaks = [np.abs(heading[a:b]).max() for a, b in pairwise(turns)]
    assert min(peaks) > np.deg2rad(21.0)
    sides = [np.sign(heading[turn]) for turn in turns]
    assert sides == [sides[0] * (-1) ** i for i in range(turns.size)]
    assert sides[0] > 0, "starboard first"


def test_turning_circle_converges_to_constant_rate(fly):
    truth = fly(CIRCLE)
    late = truth.time > 90.0
    rate = truth.motion[late, 5]
    assert abs(rate.mean()) > np.deg2rad(1.0)
    assert np.ptp(rate) < 1e-3 * abs(rate.mean())
    # Radius of a steady turn: horizontal speed over the rate of the heading.
    heading, (north, east) = truth.motion[late, 8], truth.position[late, :2].T
    heading_rate = (heading[-1] - heading[0]) / np.ptp(truth.time[late])
    speed = np.hypot(np.gradient(north, truth.time[late]), np.gradient(east, truth.time[late])).mean()
    turn = abs(2 * np.pi / heading_rate)
    one = truth.time[late] < 90.0 + turn
    assert turn < 85.0
    assert np.ptp(north[one]) == pytest.approx(2 * speed / abs(heading_rate), rel=0.01)


@pytest.mark.parametrize("manoeuvre", [CIRCLE, ZIGZAG], ids=["circle", "zigzag"])
def test_other_autopilot_settings_leave_rudder_free(manoeuvre, fly):
    whole = fly(manoeuvre, "manoeuvre.autopilot={bandwidth: 0.5, vertical: depth, horizontal: none}")
    alone = fly(manoeuvre, "manoeuvre.autopilot.bandwidth=0.5")
    assert_allclose(alone.motion[-1], whole.motion[-1])


def test_depth_is_constant_in_turn(fly):
    truth = fly(CIRCLE)
    assert np.abs(truth.position[:, 2]).max() < 2.0


@pytest.mark.parametrize(
    ("overrides", "reason"),
    [
        (("manoeuvre.excitation={roll_moment: {amplitude: 60 N*m, lowest: 0.1 Hz, lines: 1}}",), "capsized"),
        (("manoeuvre.initial_pitch=84 deg", "manoeuvre.autopilot.vertical=none"), "vertical"),
        (
            (
                "manoeuvre.excitation={surge_force: {amplitude: 1e9 N, lowest: 0.1 Hz, lines: 1}}",
                "manoeuvre.limits.surge_force=1e9 N",
            ),
            "diverged",
        ),
    ],
)
def test_invalid_motion_raises_with_time(overrides, reason, fly):
    moment = "manoeuvre.excitation={elevator: {amplitude: 20 deg, lowest: 0.05 Hz, lines: 1}}"
    with pytest.raises(SimulationError, match=reason) as caught:
        fly(STRAIGHT, *((moment,) if reason == "vertical" else ()), *overrides)
    assert "t = " in str(caught.value)
    assert "\n" not in str(caught.value)
