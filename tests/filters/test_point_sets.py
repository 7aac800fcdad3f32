"""Sigma points against the moments of the standard normal distribution."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.filters.workspace import cubature, transformed, unscented

DIMENSIONS = range(1, 41)
SETS = {
    "cubature": cubature,
    "transformed": transformed,
    "unscented": lambda n: unscented(n, 0.7, 2.0, 0.0),
    "unscented, close": lambda n: unscented(n, 1e-3, 2.0, 1.0),
}


def points_and_weights(point_set):
    """The whole set, spelled out: a centre, which takes the weight that is left, and both halves."""
    n, half = point_set.directions.shape
    points = np.vstack([np.zeros(n), point_set.directions.T, -point_set.directions.T])
    weights = np.full(2 * half + 1, point_set.weight)
    weights[0] = 1.0 - 2 * half * point_set.weight
    return points, weights


@pytest.mark.parametrize("make", SETS.values(), ids=SETS)
@pytest.mark.parametrize("n", DIMENSIONS)
def test_all_monomials_up_to_degree_three_are_integrated_exactly(n, make):
    point_set = make(n)
    points, weights = points_and_weights(point_set)
    size = np.abs(weights).sum()
    assert_allclose(weights.sum(), 1.0, atol=1e-12 * size)
    assert_allclose(weights @ points, 0.0, atol=1e-12 * size)
    assert_allclose((points.T * weights) @ points, np.eye(n), atol=1e-10)
    # E[x_i x_j x_k] = 0 for all i, j, k.
    third = np.einsum("a,ai,aj->aij", weights, points, points).reshape(len(points), -1).T @ points
    assert_allclose(third, 0.0, atol=1e-10)


@pytest.mark.parametrize("make", [cubature, transformed], ids=["cubature", "transformed"])
@pytest.mark.parametrize("n", DIMENSIONS)
def test_centred_sets_leave_nothing_for_a_point_at_the_centre(n, make):
    _, weights = points_and_weights(make(n))
    assert weights[0] == pytest.approx(0.0, abs=1e-13)
    assert make(n).centred


@pytest.mark.parametrize("n", DIMENSIONS)
def test_transformed_points_are_those_of_equation_34(n):
    expected = np.zeros((n, 2 * n))
    for i in range(1, 2 * n + 1):
        for j in range(1, n // 2 + 1):
            expected[2 * j - 2, i - 1] = np.sqrt(2) * np.cos((2 * j - 1) * i * np.pi / n)
            expected[2 * j - 1, i - 1] = np.sqrt(2) * np.sin((2 * j - 1) * i * np.pi / n)
        if n % 2:
            expected[n - 1, i - 1] = (-1) ** i
    points, _ = points_and_weights(transformed(n))
    sort = lambda table: table[np.lexsort(np.round(table, 9).T)]  # noqa: E731
    assert_allclose(sort(points[1:]), sort(expected.T), atol=1e-9)


@pytest.mark.parametrize("n", DIMENSIONS)
def test_transformed_points_stay_near_in_every_coordinate_and_as_far_as_the_cubature_points(n):
    points = transformed(n).directions
    assert np.abs(points).max() <= np.sqrt(2.0) * (1 + 1e-12)
    assert_allclose(np.linalg.norm(points, axis=0), np.sqrt(n), rtol=1e-12)


@pytest.mark.parametrize(
    ("alpha", "beta", "kappa"), [(1.0, 2.0, 0.0), (0.1, 2.0, 0.0), (1.0, 1.0, 3.0), (0.5, 0.3, 1.0)]
)
def test_unscented_weights_are_those_of_the_scaled_transformation(alpha, beta, kappa):
    n = 5
    point_set = unscented(n, alpha, beta, kappa)
    spread = alpha**2 * (n + kappa)
    assert_allclose(point_set.directions, np.sqrt(spread) * np.eye(n))
    # lambda = alpha^2 (n + kappa) - n: the mean's weight of the centre is lambda / (n + lambda).
    scaled = spread - n
    _, weights = points_and_weights(point_set)
    assert weights[0] == pytest.approx(scaled / (n + scaled))
    assert weights[1] == pytest.approx(0.5 / (n + scaled))


def test_fourth_moments_differ_between_sets():
    """Beyond degree three they differ, else the comparison of the filters would be empty."""
    n = 6
    fourth = {}
    for name, make in SETS.items():
        points, weights = points_and_weights(make(n))
        pairs = combinations_with_replacement(range(n), 2)
        fourth[name] = np.array([weights @ (points[:, i] ** 2 * points[:, j] ** 2) for i, j in pairs])
    assert not np.allclose(fourth["cubature"], fourth["transformed"])
    assert not np.allclose(fourth["cubature"], fourth["unscented"])
