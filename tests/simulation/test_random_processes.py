"""Autocorrelated noise against closed forms."""

import numpy as np
from numpy.testing import assert_allclose

from auvid_cli.simulation.simulate import gauss_markov, stream


def test_gauss_markov_process_has_variance_and_autocorrelation():
    time, time_constant, n = np.array([0.0, 0.01, 0.5, 2.0, 9.0]), 2.0, 10_000
    numbers = stream(1, "test")
    drawn = np.array([gauss_markov(time, time_constant, numbers) for _ in range(n)])
    expected = np.exp(-np.abs(time[:, None] - time) / time_constant)
    # Variance of a sample covariance of normal numbers: (1 + correlation^2) / n.
    chance = 5.0 * np.sqrt((1.0 + expected**2) / n)
    assert (np.abs(drawn.T @ drawn / n - expected) < chance).all()
    assert np.abs(drawn.mean(axis=0)).max() < 5.0 / np.sqrt(n)


def test_decay_between_samples_is_exact():
    time = np.arange(2000) * 0.01
    values, white = gauss_markov(time, 0.5, stream(3, "test")), stream(3, "test").standard_normal(time.size)
    left = np.exp(-0.02)
    assert values[0] == white[0]
    assert_allclose(values[1:] - left * values[:-1], np.sqrt(1.0 - left**2) * white[1:], atol=1e-12)


def test_streams_differ_by_name_and_seed():
    drawn = [stream(*names).random() for names in ((1, "a"), (1, "b"), (2, "a"), (1, "a", "b"))]
    assert len({*drawn}) == 4
    assert stream(1, "a").random() == drawn[0]
