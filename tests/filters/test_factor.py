"""The two building blocks of the square-root filter against plain linear algebra."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.filters.factor import carlson_update, triangularise

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, n=st.integers(1, 35), extra=st.integers(0, 20))
def test_triangularise_gives_the_factor_of_numpys_qr(seed, n, extra):
    rows = np.random.default_rng(seed).standard_normal((n, n + extra))
    lower = np.full((n, n), 7.0)
    assert triangularise(rows.copy(), n + extra, lower)
    expected = np.linalg.qr(rows.T, mode="r").T
    expected = expected * np.sign(np.diagonal(expected))
    # The trailing entries of a nearly singular set are as ill-conditioned as the set.
    assert_allclose(lower, expected, atol=1e-12 * np.linalg.cond(rows))
    assert np.all(np.diagonal(lower) > 0.0)
    assert np.all(lower[np.triu_indices(n, 1)] == 0.0)


def test_triangularise_refuses_what_has_no_factor():
    lower = np.zeros((2, 2))
    assert not triangularise(np.zeros((2, 3)), 3, lower)
    assert not triangularise(np.array([[1.0, np.nan], [0.0, 1.0]]), 2, lower)
    assert not triangularise(np.array([[1.0, np.inf], [0.0, 1.0]]), 2, lower)


@given(seed=seeds, n=st.integers(1, 35), magnitude=st.floats(-6, 6), gaps=st.booleans())
def test_carlson_update_is_the_covariance_formula(seed, n, magnitude, gaps):
    rng = np.random.default_rng(seed)
    factor = np.tril(rng.standard_normal((n, n)))
    factor[np.diag_indices(n)] = rng.uniform(0.3, 2.0, n)
    h, variance = rng.standard_normal(n), 10.0**magnitude
    if gaps:
        h[rng.random(n) < 0.7] = 0.0
    covariance = factor @ factor.T
    total = h @ covariance @ h + variance
    gain = covariance @ h
    # Joseph's form, which keeps its digits where the measurement is very accurate.
    keep = np.eye(n) - np.outer(gain, h) / total
    expected = keep @ covariance @ keep.T + variance * np.outer(gain, gain) / total**2

    columns, returned = np.ascontiguousarray(factor.T), np.zeros(n)
    innovation_variance = carlson_update(columns, factor.T @ h, variance, returned, np.zeros(n))
    assert_allclose(innovation_variance, total, rtol=1e-12)
    assert_allclose(returned, gain, rtol=1e-10, atol=1e-12 * np.abs(covariance).max())
    assert_allclose(columns.T @ columns, expected, atol=1e-11 * np.abs(covariance).max())
    assert np.all(columns[np.tril_indices(n, -1)] == 0.0), "the factor must stay triangular"
