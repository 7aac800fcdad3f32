"""Corrected standard deviations against the covariance of least squares, known in closed form where noise is known."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from auvid_cli.filters.autocorrelation import ResidualRows, cached, corrected_deviation

SPACING, EVENTS, CHANNELS = 0.1, 2000, 2


class Regression:
    """Slow regressors on two channels, measured in turn, and the influence of each measurement."""

    def __init__(self):
        time = np.repeat(SPACING * np.arange(EVENTS), CHANNELS)
        rates, phases = np.random.default_rng(3).uniform(0.02, 0.5, (2, CHANNELS, 4))
        self.time, self.channel = time, np.tile(np.arange(CHANNELS), EVENTS)
        self.design = np.sin(rates[self.channel] * time[:, None] + 7.0 * phases[self.channel])
        self.covariance = np.linalg.inv(self.design.T @ self.design)
        self.rows = self.design @ self.covariance
        self.nominal = np.sqrt(np.diagonal(self.covariance))

    def noise(self, rng, coloured, time_constant):
        """Draw it: of variance one, of which a share is coloured."""
        left = np.exp(-SPACING / time_constant)
        driving = np.sqrt(coloured * (1.0 - left**2)) * rng.standard_normal((EVENTS + 500, CHANNELS))
        fading = lfilter([1.0], [1.0, -left], driving, axis=0)[500:]
        return (fading + np.sqrt(1.0 - coloured) * rng.standard_normal((EVENTS, CHANNELS))).ravel()

    def exact(self, coloured, time_constant):
        """Return the standard deviations of least squares with such noise."""
        apart = np.abs(np.subtract.outer(self.time[::CHANNELS], self.time[::CHANNELS]))
        autocovariance = coloured * np.exp(-apart / time_constant) + (1.0 - coloured) * np.eye(EVENTS)
        of_channels = (self.rows[c::CHANNELS] for c in range(CHANNELS))
        return np.sqrt(sum(np.diagonal(rows.T @ autocovariance @ rows) for rows in of_channels))

    def influences(self, noise, cuts=()):
        """Influences of least-squares residuals, in chunks."""
        residual = noise - self.design @ (self.rows.T @ noise)
        whole = self.time, self.channel, residual, self.rows
        return [ResidualRows(*(part[first:last] for part in whole)) for first, last in pairwise((0, *cuts, noise.size))]


@pytest.fixture(scope="module")
def regression():
    return Regression()


class Counted:
    """Influences, and how often they were gone through."""

    def __init__(self, influences):
        self.influences, self.times = influences, 0

    def __iter__(self):
        self.times += 1
        return iter(self.influences)


@pytest.mark.parametrize(("room", "times"), [(10**9, 1), (1000, 2)])
def test_cached_influences_are_computed_once(regression, monkeypatch, room, times):
    influences = regression.influences(regression.noise(np.random.default_rng(2), 0.5, 1.0), (300, 1000))
    kept = corrected_deviation(regression.nominal, [influences], CHANNELS)
    monkeypatch.setattr("auvid_cli.filters.autocorrelation.CACHE_SIZE", room)
    counted = Counted(influences)
    np.testing.assert_array_equal(corrected_deviation(regression.nominal, cached([counted], [3]), CHANNELS), kept)
    assert counted.times == times


def test_white_residuals_keep_nominal_deviations(regression):
    rng, nominal = np.random.default_rng(1), regression.nominal
    ratios = [
        corrected_deviation(nominal, [regression.influences(rng.standard_normal(regression.time.size))], CHANNELS)
        / nominal
        for _ in range(20)
    ]
    assert 1.0 <= np.mean(ratios) < 1.06
    assert np.min(ratios) >= 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("coloured", "time_constant"), [(0.5, 1.0), (0.9, 3.0)])
def test_correlated_noise_gives_exact_least_squares_deviations(regression, coloured, time_constant):
    """On average the correction is that of the closed form, and of the errors themselves."""
    rng, corrected, errors = np.random.default_rng(2), [], []
    for _ in range(30):
        noise = regression.noise(rng, coloured, time_constant)
        corrected.append(corrected_deviation(regression.nominal, [regression.influences(noise)], CHANNELS))
        errors.append(regression.rows.T @ noise)
    exact = regression.exact(coloured, time_constant)
    assert (exact > 1.5 * regression.nominal).all()
    assert_allclose(np.sqrt(np.mean(np.square(corrected), axis=0)), exact, rtol=0.15)
    assert_allclose(np.sqrt(np.mean(np.square(errors), axis=0)), exact, rtol=0.3)
    assert 0.85 < np.mean(np.abs(errors) < 2.0 * np.array(corrected)) < 0.99


@given(st.lists(st.integers(0, CHANNELS * EVENTS), max_size=5), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
@settings(max_examples=5, deadline=None)
def test_chunks_change_nothing_and_deviations_are_at_least_nominal(cuts, coloured, seed):
    regression = Regression()
    noise = regression.noise(np.random.default_rng(seed), coloured, 2.0)
    whole = corrected_deviation(regression.nominal, [regression.influences(noise)], CHANNELS)
    in_chunks = corrected_deviation(regression.nominal, [regression.influences(noise, sorted(cuts))], CHANNELS)
    assert (whole >= regression.nominal).all()
    assert_allclose(in_chunks, whole, rtol=1e-9)


def test_segments_are_independent(regression):
    """The same data twice, as segments of one estimate, leave twice the variance wherever in time they are.

    But for what windows see that are somewhat longer where there are more data.
    """
    noise = regression.noise(np.random.default_rng(4), 0.8, 2.0)
    once = regression.influences(noise)
    later = [chunk._replace(time=chunk.time + 1e5) for chunk in once]
    alone = corrected_deviation(regression.nominal, [once], CHANNELS)
    both = corrected_deviation(np.sqrt(2.0) * regression.nominal, [once, later], CHANNELS)
    assert (alone > 1.5 * regression.nominal).all()
    assert_allclose(both, np.sqrt(2.0) * alone, rtol=0.05)


def test_slow_sensor_is_corrected(regression):
    """A sensor slower than the lag at which its autocovariance is read, after a silence of ten minutes."""
    noise = regression.noise(np.random.default_rng(5), 0.9, 3.0)
    (dense,) = regression.influences(noise)
    slower = dense._replace(time=20.0 * dense.time + 600.0 * (dense.time > 100.0))
    corrected = corrected_deviation(regression.nominal, [[slower]], CHANNELS)
    assert (corrected > 1.5 * regression.nominal).all()


def test_prior_contribution_is_not_corrected(regression):
    """The prior's part of the variance does not change."""
    noise = regression.noise(np.random.default_rng(6), 0.8, 2.0)
    segments = [regression.influences(noise)]
    alone = corrected_deviation(regression.nominal, segments, CHANNELS)
    with_rest = corrected_deviation(np.hypot(regression.nominal, 1.0), segments, CHANNELS)
    assert_allclose(with_rest, np.hypot(alone, 1.0))


def test_no_measurements_keep_nominal_deviations(regression):
    nothing = ResidualRows(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 4)))
    assert_allclose(corrected_deviation(np.ones(4), [[], [nothing]], CHANNELS), 1.0)


@pytest.mark.slow
def test_error_at_the_beginning_is_corrected():
    """A sensor that settles: over the whole run the autocovariance is small, and scores of both channels cancel."""
    rng, fading = np.random.default_rng(7), np.exp(-SPACING * np.arange(EVENTS) / 10.0)
    time, channel = np.repeat(SPACING * np.arange(EVENTS), CHANNELS), np.tile(np.arange(CHANNELS), EVENTS)
    design = np.stack([fading, 3.0 * fading], axis=1).reshape(-1, 1)
    rows = design / (design.T @ design)
    nominal, errors, corrected = np.sqrt((rows**2).sum(axis=0)), [], []
    for size in np.linspace(-2.0, 2.0, 30):
        noise = rng.standard_normal(time.size)
        noise[::CHANNELS] = 0.2 * noise[::CHANNELS] + size * np.exp(-SPACING * np.arange(EVENTS) / 15.0)
        errors.append(rows.T @ noise)
        influence = ResidualRows(time, channel, noise - design @ errors[-1], rows)
        corrected.append(corrected_deviation(nominal, [[influence]], CHANNELS))
    ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(corrected)))
    assert 0.8 < ratio < 1.5
    assert (np.abs(errors) < 2.0 * np.array(corrected)).mean() > 0.9


def test_effect_of_a_fault_is_removed_from_the_residuals_of_its_size(regression):
    """A large fault would else look like autocorrelated noise, with a standard deviation as large as itself."""
    noise, rows = regression.noise(np.random.default_rng(8), 0.5, 1.0), regression.rows
    information = 1.0 / (rows[:, 0] @ rows[:, 0])
    (honest,) = regression.influences(noise)
    (faulty,) = regression.influences(noise)
    size = 100.0 * regression.nominal[0]
    # The signature of a fault that no parameter compensates, and the size that its score test finds.
    signature = information * rows[:, 0]
    faulty = faulty._replace(residual=honest.residual + size * signature)
    score = np.zeros(rows.shape[1])
    score[0] = signature @ faulty.residual
    corrected = corrected_deviation(regression.nominal, [[faulty]], CHANNELS, score)
    left = honest._replace(residual=faulty.residual - score[0] / information * signature)
    expected = corrected_deviation(regression.nominal, [[left]], CHANNELS)
    as_noise = corrected_deviation(regression.nominal, [[faulty]], CHANNELS)
    assert_allclose(corrected[0], expected[0], rtol=1e-9)
    assert_allclose(corrected[1:], as_noise[1:], rtol=1e-9)
    assert as_noise[0] > 10.0 * corrected[0]
