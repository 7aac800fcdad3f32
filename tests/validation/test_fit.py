"""Fit in percent and root mean square error against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.validation.results import PredictionFit

PHASE = 2.0 * np.pi * np.arange(1000) / 1000


@pytest.mark.parametrize(("gain", "percent"), [(1.0, 100.0), (0.9, 90.0), (1.25, 75.0), (0.0, 0.0), (-1.0, -100.0)])
def test_a_scaled_sine_fits_by_its_gain(gain, percent):
    fit = PredictionFit.of(5.0 + 2.0 * np.sin(PHASE), 5.0 + gain * 2.0 * np.sin(PHASE))
    assert fit.percent == pytest.approx(percent, abs=1e-9)
    assert fit.rmse == pytest.approx(abs(1.0 - gain) * 2.0 / np.sqrt(2.0), abs=1e-12)


def test_a_late_sine_fits_by_its_delay():
    """The difference of two sines a phase d apart is 2 sin(d/2) times a sine."""
    fit = PredictionFit.of(np.sin(PHASE), np.sin(PHASE - 0.2))
    assert fit.percent == pytest.approx(100.0 * (1.0 - 2.0 * np.sin(0.1)))


def test_an_offset_is_an_error():
    fit = PredictionFit.of(np.array([1.0, 3.0]), np.array([2.0, 4.0]))
    assert (fit.rmse, fit.percent) == (1.0, 0.0)


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=40), st.integers(0, 40), st.floats(-1e6, 1e6))
def test_parts_add_up_to_the_whole(values, cut, level):
    measured = np.array(values) + level
    predicted = np.cos(np.arange(measured.size)) + level
    whole = PredictionFit.of(measured, predicted)
    parts = PredictionFit.of(measured[:cut], predicted[:cut]).plus(PredictionFit.of(measured[cut:], predicted[cut:]))
    assert parts.measurements == whole.measurements
    assert parts.mean == pytest.approx(whole.mean, rel=1e-9, abs=1e-6)
    assert parts.spread == pytest.approx(whole.spread, rel=1e-6, abs=1e-6)
    assert parts.squares == pytest.approx(whole.squares, rel=1e-9)


def test_fit_without_variation_is_none():
    assert (PredictionFit().rmse, PredictionFit().percent) == (None, None)
    constant = PredictionFit.of(np.ones(3), np.zeros(3))
    assert (constant.rmse, constant.percent) == (1.0, None)
    for broken in (np.nan, np.inf, 1e300):
        fit = PredictionFit.of(np.arange(3.0), np.array([0.0, broken, 0.0]))
        assert (fit.rmse, fit.percent) == (None, None)


def test_segment_fits_use_their_own_means():
    some, others = (PredictionFit.of(level + np.sin(PHASE), level + 0.5 * np.sin(PHASE)) for level in (0.0, 100.0))
    both = some.with_segment(others)
    assert (both.measurements, both.mean) == (2000, pytest.approx(50.0))
    assert both.percent == pytest.approx(50.0)
    assert both.rmse == pytest.approx(0.5 / np.sqrt(2.0))
