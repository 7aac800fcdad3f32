"""Spikes, noise floor and quantisation of series whose answer is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.evaluation.inspection.readings import noise_floor, quantisation_step, spike_sizes

TIME = 0.1 * np.arange(3000)


def test_the_noise_floor_is_that_of_white_noise_on_any_smooth_course(rng):
    smooth = 30.0 * np.sin(0.8 * TIME) + 0.01 * TIME**2
    assert noise_floor(smooth + 0.02 * rng.standard_normal(TIME.size)) == pytest.approx(0.02, rel=0.1)
    assert noise_floor(smooth) < 1e-4


@given(st.floats(1e-4, 10.0), st.floats(-100.0, 100.0))
def test_a_quantisation_step_is_found_wherever_the_levels_lie(step, offset):
    rng = np.random.default_rng(0)
    values = offset + step * np.round(5.0 * rng.standard_normal(2000))
    assert quantisation_step(values) == pytest.approx(step, rel=1e-6)


def test_what_is_not_quantised_shows_no_step(rng):
    assert quantisation_step(rng.standard_normal(2000)) is None
    assert quantisation_step(np.ones(2000)) is None


@pytest.mark.parametrize("at", [2, 700, 2997])
def test_a_spike_stands_out_alone(at, rng):
    values = np.sin(TIME) + 0.01 * rng.standard_normal(TIME.size)
    sound = spike_sizes(TIME, values, 0.01)
    assert sound.max() < 7.0
    values[at] += 1.0
    sizes = spike_sizes(TIME, values, 0.01)
    # The cubic through four others has a noise of sqrt(1 + (16 + 16 + 1 + 1) / 36) of one.
    assert sizes[at] == pytest.approx(1.0 / (0.01 * np.sqrt(70.0 / 36.0)), rel=0.15)
    assert (np.delete(sizes, at) < 7.0).all()


def test_a_step_is_no_spike(rng):
    values = 0.01 * rng.standard_normal(TIME.size)
    values[1000:] += 1.0
    assert spike_sizes(TIME, values, 0.01).max() < 7.0


def test_beside_a_gap_nothing_is_a_spike(rng):
    time = TIME + np.where(TIME > 100.0, 20.0, 0.0)
    values = 5.0 * np.sin(0.3 * time) + 0.001 * rng.standard_normal(time.size)
    assert spike_sizes(time, values, 0.001).max() < 7.0
