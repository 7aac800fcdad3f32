"""Considered errors: draws, conditional covariance and contributors, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.data.faults import ConsideredErrors, Fault
from auvid_cli.errors import InvalidDataError

FAULTS = tuple(Fault.parse(text) for text in ("Iyy", "scale of the DVL", "delay of the DVL"))
# Of units that differ by orders of magnitude.
SCALE = np.array([1e3, 1e-3, 1e-6])
EFFECT = np.array([[1e-3, 2e3, 0.0], [0.0, 1e3, 1e6]])


def considered(correlation):
    return ConsideredErrors(FAULTS, ("kg*m^2", "1", "s"), SCALE[:, None] * correlation * SCALE, EFFECT, np.ones(2))


@pytest.mark.parametrize(
    "correlation", [np.diag([1.0, 0.0, 4.0]), np.ones((3, 3)), np.array([[1, 0.5, 0], [0.5, 1, 0.2], [0, 0.2, 1]])]
)
def test_draws_have_the_covariance(correlation, rng):
    drawn = considered(correlation).draw(100_000, rng) / SCALE
    assert_allclose(drawn.T @ drawn / len(drawn), correlation, atol=0.05)


@pytest.mark.parametrize(
    ("correlation", "word"),
    [
        ([[1, 0.9, 0.9], [0.9, 1, -0.9], [0.9, -0.9, 1]], "semidefinite"),
        ([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], "symmetric"),
        ([[1, 0, 0], [0, 0, 0.5], [0, 0.5, 1]], "without variances"),
        ([[-1, 0, 0], [0, 1, 0], [0, 0, 1]], "negative"),
    ],
)
def test_impossible_covariance_is_refused(correlation, word, rng):
    wrong = considered(np.array(correlation, dtype=np.float64))
    with pytest.raises(InvalidDataError, match=f"/considered/covariance.*{word}"):
        wrong.check(2)
    with pytest.raises(InvalidDataError, match=word):
        wrong.draw(1, rng)


def test_covariance_given_one_error_is_conditional():
    """By the inverse of the precision matrix without its row."""
    correlation = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 1.0]])
    left = considered(correlation).given(1)
    expected = np.zeros((3, 3))
    expected[np.ix_([0, 2], [0, 2])] = np.linalg.inv(np.linalg.inv(correlation)[np.ix_([0, 2], [0, 2])])
    assert_allclose(left.covariance, SCALE[:, None] * expected * SCALE)
    left.check(2)


def test_contributors_are_the_errors_of_largest_effect():
    found = considered(np.eye(3)).contributors(0)
    assert [(str(each.fault), each.deviation) for each in found] == [("scale of the DVL", 2.0), ("Iyy", 1.0)]


def test_contributors_with_cancelling_effects_are_sorted_by_size():
    """Errors that nearly cancel: each alone reduces little, and the second one more once the first is known."""
    correlation = np.array([[1.0, -0.9, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    errors = considered(correlation)._replace(effect=np.array([[1e-3, 1e3, 0.0], [0.0, 1e3, 1e6]]))
    first, second = errors.contributors(0)
    assert {str(first.fault), str(second.fault)} == {"scale of the DVL", "Iyy"}
    assert_allclose([first.deviation, second.deviation], [np.sqrt(0.19), 0.1])
