"""Noise of signals whose noise is known: drawn, or rounded away."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.data.signals import estimate_noise, is_smoothed, quantisation_step

TIME = np.arange(2000) * 0.02
SLOW = np.sin(0.3 * TIME)


@given(st.integers(-2, 2), st.sampled_from([1.0, np.pi / 180.0, 0.514444]), st.floats(-10.0, 10.0))
def test_signal_rounded_to_steps_has_the_noise_of_rounding(exponent, unit, offset):
    step = 2.0**exponent / 8.0
    found = estimate_noise(np.rint((SLOW + offset) / step) * step * unit)
    # Rounding leaves an error that is uniform over a step.
    rounding = np.random.default_rng(1).uniform(-0.5, 0.5, 200_000).std() * step * unit
    assert found.step == pytest.approx(step * unit, rel=1e-6)
    assert found.standard_deviation == pytest.approx(rounding, rel=5e-3)


def test_values_off_the_grid_do_not_hide_the_step():
    values = np.round(SLOW, 1)
    values[[100, 700]] = 0.0372, 55.51
    assert quantisation_step(values) == pytest.approx(0.1)
    assert estimate_noise(values).standard_deviation == pytest.approx(0.028867513)


@given(st.integers(0, 1000), st.integers(50, 2000))
def test_noise_without_steps_follows_from_differences(seed, samples):
    noise = 0.01 * np.random.default_rng(seed).standard_normal(samples)
    found = estimate_noise(SLOW[:samples] + noise)
    assert found.step == 0.0
    assert found.standard_deviation == pytest.approx(0.01, rel=0.8)


def test_noise_above_the_step_follows_from_differences():
    noisy = np.round(SLOW + 0.05 * np.random.default_rng(2).standard_normal(TIME.size), 3)
    found = estimate_noise(noisy)
    assert found.step == 0.0
    assert found.standard_deviation == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize(
    "values",
    [np.zeros(50), np.full(50, np.nan), np.repeat(SLOW[::50], 50)],
    ids=["constant", "missing", "held for fifty samples"],
)
def test_signal_without_noise_and_steps_is_nan(values):
    assert np.isnan(estimate_noise(values).standard_deviation)


@pytest.mark.parametrize("is_angle", [False, True])
def test_filtered_signal_is_smoothed(is_angle):
    noise = 0.01 * np.random.default_rng(1).standard_normal(TIME.size)
    filtered = np.zeros(TIME.size)
    for k in range(1, TIME.size):
        filtered[k] = 0.8 * filtered[k - 1] + 0.2 * noise[k]
    assert not is_smoothed(SLOW + noise, is_angle)
    assert is_smoothed(SLOW + filtered, is_angle)
    assert is_smoothed(SLOW, is_angle)


def test_fast_motion_is_not_smoothed():
    """Half a hertz at ten samples a second, thirty times as large as the noise."""
    time = 0.1 * np.arange(600)
    noise = 1e-3 * np.random.default_rng(3).standard_normal(time.size)
    assert not is_smoothed(0.03 * np.sin(np.pi * time) + noise)


def test_few_samples_are_not_smoothed():
    assert not is_smoothed(SLOW[:100])
    assert not is_smoothed(np.full(1000, np.nan))
