"""The two building blocks of the square-root filter against plain linear algebra."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.filters.factor import TILE, carlson_update, triangularise

seeds = st.integers(0, 2**32 - 1)


def padded(matrix, rows, width):
    result = np.zeros((rows, width))
    result[: len(matrix), : matrix.shape[1]] = matrix
    return result


@given(seed=seeds, n=st.integers(1, 35), extra=st.integers(0, 20))
def test_triangularise_gives_the_factor_of_numpys_qr(seed, n, extra):
    rows = np.random.default_rng(seed).standard_normal((n, n + extra))
    lower = np.full((n, n), 7.0)
    assert triangularise(rows.copy(), n, lower)
    expected = np.linalg.qr(rows.T, mode="r").T
    expected = expected * np.sign(np.diagonal(expected))
    # The trailing entries of a nearly singular set are as ill-conditioned as the set.
    assert_allclose(lower, expected, atol=1e-12 * np.linalg.cond(rows))
    assert np.all(np.diagonal(lower) > 0.0)
    assert np.all(lower[np.triu_indices(n, 1)] == 0.0)


def test_triangularise_rejects_singular_rows():
    for rows in np.zeros((2, 2)), [[1.0, np.nan], [0.0, 1.0]], [[1.0, np.inf], [0.0, 1.0]], [[1.0, 0.0], [0.0, 1e-160]]:
        assert not triangularise(np.array(rows), 2, np.zeros((2, 2)))


@given(seed=seeds, n=st.integers(1, 35), magnitude=st.floats(-6, 6), gaps=st.booleans())
def test_carlson_update_is_the_covariance_formula(seed, n, magnitude, gaps):
    rng = np.random.default_rng(seed)
    factor = np.tril(rng.standard_normal((n, n)))
    factor[np.diag_indices(n)] = rng.uniform(0.3, 2.0, n)
    h, other, variance = rng.standard_normal(n), rng.standard_normal(n), 10.0**magnitude
    if gaps:
        h[rng.random(n) < 0.7] = 0.0
    # The state, then the measured combination, then one that rides along.
    rows = np.vstack([np.eye(n), h, other]) @ factor
    covariance = rows @ rows.T
    total = covariance[n, n] + variance
    gain = covariance[n]
    # Joseph's form, which keeps its digits where the measurement is very accurate.
    keep = np.eye(n + 2)
    keep[:, n] -= gain / total
    expected = keep @ covariance @ keep.T + variance * np.outer(gain, gain) / total**2

    width = -(-(n + 2) // TILE) * TILE
    columns, returned = padded(rows.T, n, width), np.full(width, 7.0)
    ratio, share = np.full(n + 1, 7.0), np.full(n + 1, 7.0)
    innovation_variance = carlson_update(columns, n, columns[:, n].copy(), variance, returned, ratio, share)
    size = np.abs(covariance).max()
    assert_allclose(innovation_variance, total, rtol=1e-12)
    assert_allclose(returned[: n + 2], gain, rtol=1e-10, atol=1e-12 * size)
    assert_allclose((columns.T @ columns)[: n + 2, : n + 2], expected, atol=1e-11 * size)
    assert np.all(columns[:n, :n][np.tril_indices(n, -1)] == 0.0), "the factor must stay triangular"
    assert np.all(columns[:, n + 2 :] == 0.0), "padding must stay zero"


def test_carlson_update_with_overflow_keeps_factor():
    columns, before = np.zeros((4, TILE)), 1e90 * np.eye(4, TILE)
    columns[:] = before
    total = carlson_update(columns, 4, columns[:, 0].copy(), 1.0, np.zeros(TILE), np.zeros(5), np.zeros(5))
    assert np.isnan(total)
    assert np.array_equal(columns, before)
