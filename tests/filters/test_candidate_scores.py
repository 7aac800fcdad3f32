"""Gains, sizes and shares of candidates against least squares on the same columns."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.fault_scores import correlation, fraction_explained, gains, sizes
from auvid_cli.filters.problem import FaultScores

N, N_PARAMETERS, N_CANDIDATES = 300, 3, 6


@pytest.fixture
def regression(rng):
    """Columns of parameters and of candidates, of which two are in the data; the last is the first once more."""
    known, candidates = rng.standard_normal((N, N_PARAMETERS)), rng.standard_normal((N, N_CANDIDATES))
    candidates += 0.5 * known[:, [0]]
    candidates[:, -1] = 2.0 * candidates[:, 0]
    measured = known @ [1.0, -2.0, 0.5] + 0.8 * candidates[:, 1] - 0.5 * candidates[:, 4] + rng.standard_normal(N)
    return known, candidates, measured


def left_of(known, columns):
    return columns - known @ np.linalg.lstsq(known, columns, rcond=None)[0]


@pytest.fixture
def scores(regression):
    known, candidates, measured = regression
    candidates_left, measured_left = left_of(known, candidates), left_of(known, measured)
    effect = np.linalg.lstsq(known, candidates, rcond=None)[0]
    names = tuple("abcdef")
    return FaultScores(names, candidates_left.T @ measured_left, candidates_left.T @ candidates_left, effect)


def squares_left(known, columns, measured):
    return float(np.sum(left_of(np.hstack([known, columns]), measured) ** 2))


def test_gain_is_half_of_the_decrease_of_squares(regression, scores):
    known, candidates, measured = regression
    before = squares_left(known, candidates[:, []], measured)
    for candidate in range(N_CANDIDATES):
        after = squares_left(known, candidates[:, [candidate]], measured)
        assert gains(scores)[candidate] == pytest.approx((before - after) / 2.0, abs=1e-8)


def test_sizes_are_those_of_least_squares(regression, scores):
    known, candidates, measured = regression
    size, deviation = sizes(scores)
    for candidate in range(N_CANDIDATES):
        columns = np.hstack([known, candidates[:, [candidate]]])
        assert_allclose(size[candidate], np.linalg.lstsq(columns, measured, rcond=None)[0][-1])
        assert_allclose(deviation[candidate], np.sqrt(np.linalg.inv(columns.T @ columns)[-1, -1]))


def test_identical_candidates_have_correlation_one(scores):
    assert correlation(scores, 0)[-1] == pytest.approx(1.0)


def test_unobservable_candidate_has_no_gain(scores):
    unseen = scores._replace(score=0.0 * scores.score, information=0.0 * scores.information)
    assert (gains(unseen) == 0.0).all()
    assert (sizes(unseen)[1] == np.inf).all()
    assert (correlation(unseen, 0) == 0.0).all()


def test_fraction_explained_is_that_of_the_squares(regression, scores):
    known, candidates, _ = regression
    covariance = np.linalg.inv(known.T @ known)
    expected = 1.0 - np.sum(left_of(known, candidates) ** 2, axis=0) / np.sum(candidates**2, axis=0)
    assert_allclose(fraction_explained(scores, covariance), expected)
