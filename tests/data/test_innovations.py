"""Autocorrelation of innovations against a closed form."""

import numpy as np
import pytest

from auvid_cli.data.innovations import N_LAGS, Innovations


def innovations_of(values, variance):
    time = np.arange(len(values)) / 10.0
    return Innovations(time, values, variance, np.nansum(values**2, axis=1), np.ones(values.shape[1]))


def test_moving_average_correlates_at_lag_one(rng):
    noise = rng.standard_normal((20_001, 2))
    values = np.column_stack([noise[1:, 0] + noise[:-1, 0], noise[1:, 1]])
    memory = innovations_of(values, np.ones(values.shape)).autocorrelation
    assert memory.correlation.shape == (2, N_LAGS)
    expected = np.zeros((2, N_LAGS))
    expected[0, 0] = 0.5
    assert np.abs(memory.correlation - expected).max() < 0.04
    assert list(memory.samples) == [20_000, 20_000]


@pytest.mark.parametrize(("n", "n_samples"), [(49, 0), (50, 50)])
def test_few_samples_have_no_autocorrelation(n, n_samples, rng):
    values = rng.standard_normal((n, 1))
    assert list(innovations_of(values, np.ones((n, 1))).autocorrelation.samples) == [n_samples]


def test_zero_variance_is_ignored(rng):
    values, variance = rng.standard_normal((100, 1)), np.ones((100, 1))
    variance[:30], values[40] = 0.0, np.nan
    assert list(innovations_of(values, variance).autocorrelation.samples) == [69]
