"""Spikes, noise floor and quantisation of series whose answer is known."""

import numpy as np
import pytest

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.inspection.single_sensor import level_distance, noise_floor, range_check, spike_sizes

TIME = 0.1 * np.arange(3000)


def test_noise_floor_ignores_smooth_motion(rng):
    smooth = 30.0 * np.sin(0.8 * TIME) + 0.01 * TIME**2
    assert noise_floor(smooth + 0.02 * rng.standard_normal(TIME.size)) == pytest.approx(0.02, rel=0.1)
    assert noise_floor(smooth) < 1e-4


@pytest.mark.parametrize("step", [0.001, 0.1])
def test_quantisation_step_with_few_measurements_per_level(step, rng):
    values = step * np.round((3.0 * np.sin(TIME) + rng.standard_normal(TIME.size)) / step)
    assert level_distance(values) == pytest.approx(step, rel=1e-6)


def test_continuous_signal_has_no_quantisation_step(rng):
    assert level_distance(rng.standard_normal(2000)) == 0.0
    assert level_distance(np.ones(2000)) == 0.0


def test_constant_with_spike_has_no_quantisation_step():
    values = np.zeros(100)
    values[40] = 1.0
    assert level_distance(values) == 0.0
    assert spike_sizes(TIME[:100], values, 0.01).argmax() == 40


@pytest.mark.parametrize("at", [2, 700, 2997])
def test_only_the_spike_is_large(at, rng):
    values = np.sin(TIME) + 0.01 * rng.standard_normal(TIME.size)
    sound = spike_sizes(TIME, values, 0.01)
    assert sound.max() < 7.0
    values[at] += 1.0
    sizes = spike_sizes(TIME, values, 0.01)
    # The cubic through four others has a noise of sqrt(1 + (16 + 16 + 1 + 1) / 36) of one.
    assert sizes[at] == pytest.approx(1.0 / (0.01 * np.sqrt(70.0 / 36.0)), rel=0.15)
    assert (np.delete(sizes, at) < 7.0).all()


def test_step_is_no_spike(rng):
    values = 0.01 * rng.standard_normal(TIME.size)
    values[1000:] += 1.0
    assert spike_sizes(TIME, values, 0.01).max() < 7.0


def test_no_spike_next_to_a_gap(rng):
    time = TIME + np.where(TIME > 100.0, 20.0, 0.0)
    values = 5.0 * np.sin(0.3 * time) + 0.001 * rng.standard_normal(time.size)
    assert spike_sizes(time, values, 0.001).max() < 7.0


def test_sharp_extreme_is_no_spike(rng):
    """A heading that a zigzag turns back, measured once a second: beside it the heading changes as much."""
    time = np.arange(120.0)
    heading = np.abs((0.3 * time) % 4.0 - 2.0) + 1e-3 * rng.standard_normal(time.size)
    assert spike_sizes(time, heading, 1e-3).max() < 15.0
    heading[60] += 1.0
    sizes = spike_sizes(time, heading, 1e-3)
    assert sizes.argmax() == 60
    assert sizes[60] > 15.0


RANGES = [("gyroscope", 17.0, False), ("gyroscope", 2.0, True), ("dvl", 30.0, False), ("dvl", 4.0, True)]


@pytest.mark.parametrize(("name", "reached", "passed"), RANGES)
def test_rates_and_speeds_that_no_vehicle_has_fail(name, reached, passed):
    record = SensorRecord(np.arange(100.0), np.full((100, 3), reached), np.ones(3))
    check = range_check(name, record)
    assert check is not None
    assert check.passed is passed
