"""Numbers of manoeuvres from signals of which they are known in closed form."""

import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.validation.manoeuvres import manoeuvre_numbers, rudder_holds, turning_times
from auvid_cli.validation.motion_prediction import MeasuredSignal
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

TICK = 0.01
RUDDER = np.deg2rad(20.0)


def inputs_of(rudder):
    values = np.zeros((rudder.size, 4))
    values[:, 0] = rudder
    return InputRecord(TICK * np.arange(rudder.size), values)


def held(*levels_and_lengths):
    return np.concatenate([np.full(round(length / TICK), level) for level, length in levels_and_lengths])


def signals_of(motion):
    time = TICK * np.arange(len(motion))
    return {s: MeasuredSignal(time, motion[:, i], 0.001) for i, s in enumerate(MOTION_SYMBOLS)}


def zigzag(amplitude, rate, brake, legs, course=0.7):
    """Rudder and heading: after each reversal the turn is braked evenly, `rate**2 / (2 brake)` of overshoot."""
    approach, first, leg = 5.0, amplitude / rate, 2.0 * rate / brake + 2.0 * amplitude / rate
    rudder = held((0.0, approach), (RUDDER, first), *((-RUDDER * (-1.0) ** k, leg) for k in range(legs)))
    time = TICK * np.arange(rudder.size)
    since = np.maximum(time - approach - first, 0.0) % leg
    side = (-1.0) ** ((np.maximum(time - approach - first, 0.0)) // leg)
    braking = np.minimum(since, 2.0 * rate / brake)
    turned = amplitude + rate * braking - 0.5 * brake * braking**2 - rate * (since - braking)
    heading = np.where(time < approach + first, rate * np.maximum(time - approach, 0.0), side * turned)
    motion = np.zeros((time.size, 9))
    motion[:, 8] = course + heading
    return rudder, motion


@pytest.mark.parametrize("symbol", ["psi", "r"])
def test_turns_are_told_from_straight_legs(symbol):
    """Legs of 20 s that wander by 0.5 deg/s, and turns of 10 s at 9 deg/s."""
    time = np.arange(0.0, 90.0, 0.1)
    turning = time % 30.0 >= 20.0
    rate = np.where(turning, np.deg2rad(9.0), np.deg2rad(0.5) * np.sin(time))
    values = rate if symbol == "r" else np.cumsum(rate) * 0.1
    found = turning_times({symbol: MeasuredSignal(time, values, 0.001)})
    inside = np.abs(time % 10.0 - 5.0) < 3.9  # without a second at each end, over which the change is computed
    np.testing.assert_array_equal(found.turning[inside], turning[inside])
    assert found.at(25.0)
    assert not found.at(10.0)


def test_wander_is_no_turn_and_without_heading_nothing_is_known():
    time = np.arange(0.0, 60.0, 0.1)
    wander = MeasuredSignal(time, np.deg2rad(0.5) * np.sin(time), 0.001)
    assert not turning_times({"psi": wander}).turning.any()
    assert turning_times({"u": wander}) is None


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_overshoots_of_a_zigzag(noise, rng):
    rudder, motion = zigzag(0.35, 0.2, 0.1, 4)
    measured = motion.copy()
    measured[:, 8] += noise * rng.standard_normal(len(motion))
    run = FreeRun(TICK * np.arange(len(motion)), motion)
    numbers = manoeuvre_numbers(inputs_of(rudder), signals_of(measured), run)
    assert [(n.manoeuvre, n.number) for n in numbers] == [("zigzag 20", f"overshoot {k}") for k in (1, 2, 3, 4)]
    assert [n.time_s for n in numbers] == pytest.approx([6.75 + 7.5 * k for k in range(4)], abs=0.02)
    for number in numbers:
        assert number.predicted == pytest.approx(0.2**2 / 0.2, abs=1e-3)
        assert number.measured == pytest.approx(0.2, abs=1e-3 + noise)


def test_zigzag_without_model_overshoot_has_no_prediction():
    rudder, motion = zigzag(0.35, 0.2, 0.1, 3)
    blown_up = np.where(np.arange(len(motion))[:, None] > 1500, np.nan, motion)
    numbers = manoeuvre_numbers(inputs_of(rudder), signals_of(motion), FreeRun(TICK * np.arange(len(motion)), blown_up))
    assert [n.predicted is None for n in numbers] == [False, True, True]


def test_timed_rudder_steps_are_no_zigzag():
    rudder = held((0.0, 3.0), (RUDDER, 3.0), (-RUDDER, 2.0), (RUDDER, 1.0), (-RUDDER, 1.0), (0.0, 6.0))
    motion = np.zeros((rudder.size, 9))
    motion[:, 8] = 0.5 * TICK * np.cumsum(rudder)
    assert (
        manoeuvre_numbers(inputs_of(rudder), signals_of(motion), FreeRun(TICK * np.arange(len(motion)), motion)) == []
    )


def test_moving_rudder_has_no_hold():
    time = TICK * np.arange(6000)
    assert rudder_holds(inputs_of(RUDDER * np.sin(time))) == []
    assert rudder_holds(inputs_of(np.zeros(6000))) == []


def test_slow_rudder_is_held_after_it_arrives():
    ramp = np.linspace(-RUDDER, RUDDER, 70)
    (first, second) = rudder_holds(inputs_of(np.concatenate([held((-RUDDER, 4.0)), ramp, held((RUDDER, 4.0))])))
    assert (first.begin, second.end) == (0.0, pytest.approx(8.69))
    assert first.end == pytest.approx(4.0, abs=0.05)
    assert second.begin == pytest.approx(4.7, abs=0.05)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_numbers_of_a_turning_circle(side):
    rudder = held((0.0, 12.0), (-side * RUDDER, 60.0))
    time = TICK * np.arange(rudder.size)
    turning = time >= 12.0
    motion = np.zeros((time.size, 9))
    # Pitched nose up by 0.1 rad; along a level path u = V cos(0.1), w = V sin(0.1).
    speed = np.where(turning, 3.0, 4.0)
    motion[:, 0], motion[:, 2], motion[:, 7] = speed * np.cos(0.1), speed * np.sin(0.1), 0.1
    motion[:, 8] = side * 0.25 * np.maximum(time - 12.0, 0.0)
    slower = motion.copy()
    slower[:, 8] *= 0.8
    numbers = manoeuvre_numbers(inputs_of(rudder), signals_of(motion), FreeRun(time, slower))
    assert {n.manoeuvre for n in numbers} == {"turning circle 20"}
    by_name = {n.number: (n.unit, n.measured, n.predicted) for n in numbers}
    assert by_name["turn rate"] == ("rad/s", pytest.approx(side * 0.25), pytest.approx(side * 0.2))
    assert by_name["speed"] == ("m/s", pytest.approx(3.0), pytest.approx(3.0))
    assert by_name["radius"] == ("m", pytest.approx(12.0), pytest.approx(15.0))
    assert by_name["speed lost"] == ("1", pytest.approx(0.25), pytest.approx(0.25))
    # Steady once the heading has changed by half a turn; the corner where it begins is rounded off.
    assert numbers[0].time_s == pytest.approx(12.0 + np.pi / 0.25, abs=0.1)


def test_short_turn_is_not_steady():
    rudder = held((0.0, 12.0), (RUDDER, 20.0))
    motion = np.zeros((rudder.size, 9))
    motion[:, 8] = 0.25 * np.maximum(TICK * np.arange(rudder.size) - 12.0, 0.0)
    assert (
        manoeuvre_numbers(inputs_of(rudder), signals_of(motion), FreeRun(TICK * np.arange(len(motion)), motion)) == []
    )


def test_numbers_need_heading_and_velocity():
    rudder = held((0.0, 12.0), (RUDDER, 60.0))
    motion = np.zeros((rudder.size, 9))
    motion[:, 8] = 0.25 * np.maximum(TICK * np.arange(rudder.size) - 12.0, 0.0)
    run, signals = FreeRun(TICK * np.arange(len(motion)), motion), signals_of(motion)
    only = manoeuvre_numbers(inputs_of(rudder), {"psi": signals["psi"]}, run)
    assert [n.number for n in only] == ["turn rate"]
    assert manoeuvre_numbers(inputs_of(rudder), {"r": signals["r"]}, run) == []


@pytest.mark.parametrize(("untold", "speed"), [((), 3.0 * np.cos(0.2)), (("phi",), 3.0), (("phi", "theta"), 3.0)])
def test_turn_without_roll_and_pitch_is_level(untold, speed):
    rudder = held((0.0, 12.0), (RUDDER, 60.0))
    time = TICK * np.arange(rudder.size)
    motion = np.zeros((time.size, 9))
    motion[:, 0], motion[:, 7] = np.where(time < 12.0, 4.0, 3.0), -0.2
    motion[:, 8] = 0.25 * np.maximum(time - 12.0, 0.0)
    signals = {symbol: signal for symbol, signal in signals_of(motion).items() if symbol not in untold}
    by_name = {n.number: n for n in manoeuvre_numbers(inputs_of(rudder), signals, FreeRun(time, motion))}
    expected = {"turn rate": 0.25, "speed": speed, "radius": speed / 0.25, "speed lost": 0.25}
    assert {name: n.measured for name, n in by_name.items()} == pytest.approx(expected)
    assert {name: n.predicted for name, n in by_name.items()} == pytest.approx(expected)
