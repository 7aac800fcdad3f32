"""Square-root information against normal equations and least squares in NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.filters.least_squares import Information
from auvid_cli.filters.problem import Gaussian

seeds = st.integers(0, 2**32 - 1)


def rows_of(rng, m, n):
    """Whitened rows whose columns differ by orders of magnitude, and a residual."""
    return rng.standard_normal((m, n + 1)) * 10.0 ** rng.uniform(-4, 4, n + 1)


def from_rows(rows):
    return Information.empty(rows.shape[1] - 1).with_rows(rows, len(rows))


@given(seed=seeds, n=st.integers(1, 35), m=st.integers(0, 400))
def test_the_triangle_is_that_of_numpys_qr(seed, n, m):
    rows = rows_of(np.random.default_rng(seed), m, n)
    found = from_rows(rows)
    triangle = np.zeros((n + 1, n + 1))
    triangle[: min(m, n + 1)] = np.linalg.qr(rows, mode="r")
    size = np.linalg.norm(rows, axis=0) if m else np.ones(n + 1)
    if m > n:
        triangle *= np.where(np.diagonal(triangle) < 0.0, -1.0, 1.0)[:, None]
        scaled = np.column_stack([found.factor, found.projected]) / size
        # The trailing entries are as ill-conditioned as the rows.
        tolerance = 1e-13 * np.linalg.cond(rows / size)
        assert_allclose(scaled, triangle[:n] / size, atol=tolerance)
        assert_allclose(found.remaining / size[-1], triangle[n, n] / size[-1], atol=tolerance)
    assert_allclose(
        found.factor.T @ found.factor / np.outer(size, size)[:n, :n],
        (rows.T @ rows / np.outer(size, size))[:n, :n],
        atol=1e-13,
    )
    assert np.all(found.factor[np.tril_indices(n, -1)] == 0.0)
    assert found.n_measurements == m


@given(seed=seeds, n=st.integers(1, 20), m=st.integers(1, 300))
def test_the_sum_of_squares_and_its_gradient_are_those_of_all_rows(seed, n, m):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((m, n + 1))
    found = from_rows(rows)
    for step in (np.zeros(n), rng.standard_normal(n)):
        error, compressed = rows[:, :-1] @ step - rows[:, -1], found.factor @ step - found.projected
        assert_allclose(compressed @ compressed + found.remaining**2, error @ error, rtol=1e-12)
        assert_allclose(found.factor.T @ compressed, rows[:, :-1].T @ error, atol=1e-11 * m)


@given(seed=seeds, n=st.integers(1, 20), parts=st.lists(st.integers(0, 150), min_size=1, max_size=5))
def test_joining_parts_in_any_way_is_the_same_as_all_rows_at_once(seed, n, parts):
    rng = np.random.default_rng(seed)
    blocks = [rng.standard_normal((m, n + 1)) for m in parts]
    at_once = from_rows(np.vstack(blocks))
    one_by_one = joined = Information.empty(n)
    for block in blocks:
        one_by_one = one_by_one.with_rows(block, len(block))
        joined = from_rows(block).join(joined)
    for other in (one_by_one, joined):
        assert other.n_measurements == at_once.n_measurements
        assert_allclose(other.factor.T @ other.factor, at_once.factor.T @ at_once.factor, atol=1e-11)
        assert_allclose(other.factor.T @ other.projected, at_once.factor.T @ at_once.projected, atol=1e-11)
        total = at_once.projected @ at_once.projected + at_once.remaining**2
        assert_allclose(other.projected @ other.projected + other.remaining**2, total, rtol=1e-12)


@given(seed=seeds, n=st.integers(1, 20))
def test_the_uncertainty_is_the_inverse_of_the_normal_matrix(seed, n):
    rng = np.random.default_rng(seed)
    rows = rows_of(rng, 3 * n + 5, n)
    size = np.linalg.norm(rows, axis=0)[:n]
    normal = (rows.T @ rows)[:n, :n] / np.outer(size, size)
    expected = np.linalg.inv(normal)
    uncertainty = from_rows(rows).uncertainty()
    assert uncertainty.unobserved.shape == (n, 0)
    tolerance = 1e-12 * np.linalg.cond(normal) * np.abs(expected).max()
    assert_allclose(uncertainty.covariance(np.diag(size)), expected, atol=tolerance)
    combinations = rng.standard_normal((4, 3, n))
    variance = np.einsum("kci,ij,kcj->kc", combinations, expected, combinations)
    assert_allclose(uncertainty.deviation(combinations * size) ** 2, variance, rtol=1e-7)


def test_unobserved_states_alone_have_infinite_variance(rng):
    """The second state is not observed at all; of the third and fourth only the sum."""
    observed = rng.standard_normal((50, 3))
    rows = np.column_stack(
        [observed[:, 0], np.zeros(50), observed[:, 1], observed[:, 1], observed[:, 2], rng.standard_normal(50)]
    )
    found = from_rows(rows)
    uncertainty = found.uncertainty()
    expected = np.linalg.inv(observed.T @ observed)
    assert_allclose(uncertainty.deviation(np.eye(5)), np.sqrt([expected[0, 0], np.inf, np.inf, np.inf, expected[2, 2]]))
    assert_allclose(uncertainty.deviation(np.array([0.0, 0.0, 1.0, 1.0, 0.0])), np.sqrt(expected[1, 1]))
    covariance = uncertainty.covariance(np.eye(5))
    assert_allclose(covariance[np.ix_([0, 4], [0, 4])], expected[np.ix_([0, 2], [0, 2])])
    assert covariance[1, 1] == covariance[2, 2] == covariance[3, 3] == np.inf
    assert covariance[2, 3] == -np.inf
    assert np.isfinite(covariance[0, 1:4]).all()
    assert np.array_equal(covariance, covariance.T)


def test_unobserved_directions_complete_the_rank(rng):
    rows = np.column_stack([rng.standard_normal((50, 2)), np.zeros(50), rng.standard_normal(50)])
    rows = np.insert(rows, 0, 1e5 * rows[:, 1], axis=1)
    found = from_rows(rows)
    unobserved = found.unobserved()
    assert unobserved.shape == (2, 4)
    size = np.linalg.norm(rows[:, :4], axis=0)
    size[size == 0.0] = 1.0
    assert np.linalg.cond(np.vstack([found.factor, unobserved]) / size) < 20.0
    # A step along what is observed has no part in them.
    step = (rows[:, :4] / size**2)[7]
    assert_allclose(unobserved @ step, 0.0, atol=1e-12 * np.abs(unobserved).max() * np.abs(step).max())


def test_no_measurements_give_no_information():
    uncertainty = Information.empty(3).uncertainty()
    assert np.all(uncertainty.deviation(np.eye(3)) == np.inf)
    assert np.all(np.diagonal(uncertainty.covariance(np.eye(3))) == np.inf)
    assert Information.empty(3).n_measurements == 0


def test_missing_measurements_add_no_information(rng):
    rows = rng.standard_normal((40, 4))
    holed = np.insert(rows, [0, 7, 40], 0.0, axis=0)
    assert_allclose(from_rows(holed).factor, from_rows(rows).factor, rtol=1e-12)


@pytest.mark.parametrize("n", [1, 6])
def test_a_gaussian_is_the_information_of_its_covariance(n, rng):
    factor = np.tril(rng.standard_normal((n, n))) + 2.0 * np.eye(n)
    mean, state = rng.standard_normal(n), rng.standard_normal(n)
    found = Information.of_gaussian(Gaussian(mean, factor), state)
    assert_allclose(found.uncertainty().covariance(np.eye(n)), factor @ factor.T, rtol=1e-9, atol=1e-12)
    assert_allclose(np.linalg.solve(found.factor, found.projected), mean - state, rtol=1e-9, atol=1e-12)
    assert found.n_measurements == 0
    assert found.remaining == pytest.approx(0.0, abs=1e-12)
