"""Motion ahead of a start against closed forms and another integrator."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli.filters.problem import Timeline
from auvid_cli.validation.motion_prediction import Disturbance, move_side_by_side, unchanged_motion
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import PARAMETER_SYMBOLS

# Neutral, balanced, without any coupling: in surge it only coasts.
PLAIN = dict.fromkeys(PARAMETER_SYMBOLS, 0.0) | {
    **{"m": 60.0, "W": 600.0, "B": 600.0, "Ixx": 1.0, "Iyy": 20.0, "Izz": 20.0, "X_udot": -4.0},
    **{"Y_vdot": -50.0, "Z_wdot": -50.0, "K_pdot": -0.1, "M_qdot": -10.0, "N_rdot": -10.0},
}


def coasting(first, last, before):
    """A part of the timeline: an event each 0.1 s, reached in five substeps, without any input."""
    events = np.arange(first, last)
    substeps = 5 * (events.size if before else events.size - 1)
    offset = 5 * np.arange(events.size + 1) if before else np.append(0, 5 * np.arange(events.size))
    still = np.zeros(events.size, dtype=np.int64)
    nothing = np.zeros(events.size + 1, dtype=np.int64), np.zeros(0, dtype=np.int8), np.zeros((0, 3))
    durations, held = np.full(substeps, 0.02), np.zeros(substeps, dtype=np.int64)
    return Timeline(0.1 * events, offset, durations, held, np.zeros((1, 4)), still, *nothing)


def with_drag(*drags):
    table = np.zeros((len(drags), len(SYMBOLS)))
    table[:, SYMBOLS.index("X_u|u|")] = drags
    return table


def test_coasting_speed_falls_with_inverse_time():
    parts = [coasting(0, 30, before=False), coasting(30, 101, before=True)]
    drags, wanted = np.array([-3.2, -6.4, 0.0]), np.array([0.0, 0.1, 2.9, 3.0, 7.7, 10.0])
    motion = np.zeros((3, 10))
    motion[:, 0] = 2.0
    moved = move_side_by_side(parts, motion, with_drag(*drags), [PLAIN], wanted)
    assert moved.shape == (6, 3, 10)
    # (m - X_udot) u' = X u^2
    assert_allclose(moved[:, :, 0], 2.0 / (1.0 - drags / 64.0 * 2.0 * wanted[:, None]), rtol=1e-9)
    assert_allclose(moved[:, :, 1:], 0.0, atol=1e-12)


def test_disturbance_decays_and_is_random_in_drawn_models():
    """A mass without drag; the error falls with the square of the step."""
    n, time_constant, wanted = 60, 2.0, np.array([0.0, 1.0, 10.0])
    force = np.zeros((6, n))
    force[0] = 8.0
    inverse = np.diag([1.0 / 64.0, *[1.0 / 110.0] * 2, *[1.0 / 30.0] * 3])
    deviation, times = np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]), np.full(6, time_constant)
    disturbance = Disturbance(slice(10, n), force, deviation, times, inverse, np.random.default_rng(2))
    parts, table = [coasting(0, 101, before=False)], with_drag(*[0.0] * n)
    moved = move_side_by_side(parts, np.zeros((n, 10)), table, [PLAIN], wanted, disturbance=disturbance)
    expected = 8.0 * time_constant / 64.0 * (1.0 - np.exp(-wanted / time_constant))
    assert_allclose(moved[:, :10, 0], np.repeat(expected[:, None], 10, axis=1), rtol=1e-4)
    assert_allclose(disturbance.force[0, :10], 8.0 * np.exp(-10.0 / time_constant))
    assert disturbance.force[0, 10:].std() == pytest.approx(3.0, rel=0.25)
    # The integral of a stationary process, Var = 2 s^2 T (t - T (1 - exp(-t / T))), of which the start is known here.
    settled = 1.0 - np.exp(-10.0 / time_constant)
    variance = 2.0 * time_constant * (10.0 - time_constant * settled) - (time_constant * settled) ** 2
    assert moved[2, 10:, 0].std() == pytest.approx(3.0 * np.sqrt(variance) / 64.0, rel=0.25)
    assert_allclose(moved[..., 1:], 0.0, atol=1e-12)


def test_diverging_model_leaves_others_unchanged():
    motion = np.zeros((3, 10))
    motion[:, 0] = 2.0
    table = with_drag(-3.2, 1e3, -3.2)
    moved = move_side_by_side([coasting(0, 51, before=False)], motion, table, [PLAIN], np.array([5.0]))
    assert not np.isfinite(moved[0, 1, 0])
    assert_allclose(moved[0, [0, 2], 0], 2.0 / (1.0 + 3.2 / 64.0 * 2.0 * 5.0), rtol=1e-9)


def test_times_after_the_timeline_are_left_out():
    moved = move_side_by_side(
        [coasting(0, 11, before=False)], np.zeros((1, 10)), with_drag(0.0), [PLAIN], np.array([0.5, 4.0])
    )
    assert len(moved) == 1


def test_constant_yaw_rate_unwraps_heading():
    elapsed = np.linspace(0.0, 60.0, 601)
    motion = np.array([3.0, 0.1, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 20.0, 7.0])
    moved = unchanged_motion(elapsed, motion)
    assert_allclose(moved[:, 8], 20.0 + 0.5 * elapsed)
    assert_allclose(moved[:, :8], np.tile(motion[:8], (601, 1)), atol=1e-12)
    assert_allclose(moved[:, 9], 7.0)
    later = unchanged_motion(elapsed[300:], motion, moved[299, 6:9])
    assert_allclose(later, moved[300:])


def test_unchanged_motion_solves_attitude_and_depth_equations():
    u, v, w, p, q, r = 2.0, -0.3, 0.4, 0.1, -0.07, 0.2

    def rates(_, state):
        phi, theta, *_ = state
        turning = q * np.sin(phi) + r * np.cos(phi)
        sinking = np.cos(theta) * (v * np.sin(phi) + w * np.cos(phi)) - u * np.sin(theta)
        return [p + np.tan(theta) * turning, q * np.cos(phi) - r * np.sin(phi), turning / np.cos(theta), sinking]

    begin, elapsed = [0.3, -0.4, 2.0, 5.0], np.linspace(0.0, 6.0, 61)
    expected = solve_ivp(rates, (0.0, 6.0), begin, t_eval=elapsed, rtol=1e-10, atol=1e-12).y.T
    moved = unchanged_motion(elapsed, np.array([u, v, w, p, q, r, *begin]))
    assert_allclose(moved[:, 6:], expected, atol=1e-8)


def test_unchanged_motion_without_rates_is_straight():
    motion = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1, -0.2, 9.0, 3.0])
    moved = unchanged_motion(np.array([0.0, 50.0]), motion)
    assert moved[:, :9] == pytest.approx(np.tile(motion[:9], (2, 1)))
    assert moved[:, 9] == pytest.approx([3.0, 3.0 + 50.0 * np.sin(0.2)])


def test_coasting_downwards_gains_depth():
    """A balanced body: its path is the integral of inverse time, a logarithm."""
    drag, pitch, wanted = -3.2, -0.4, np.array([0.0, 3.0, 10.0])
    motion = np.zeros((2, 10))
    motion[:, [0, 7, 9]] = 2.0, pitch, 4.0
    moved = move_side_by_side([coasting(0, 101, before=False)], motion, with_drag(drag, 0.0), [PLAIN], wanted)
    slowing = -drag / 64.0 * 2.0
    assert_allclose(moved[:, 0, 9], 4.0 - np.sin(pitch) * 2.0 * np.log1p(slowing * wanted) / slowing, rtol=1e-6)
    assert_allclose(moved[:, 1, 9], 4.0 - np.sin(pitch) * 2.0 * wanted, rtol=1e-12)
