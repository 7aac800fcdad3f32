"""Antipodal sigma points: draw them from the factor, map them, and collect what a map does to the Gaussian.

What a map does to a pair of points ``+delta, -delta`` splits into an odd part (what a linear map does) and an
even part (curvature). In the basis of the factor S the odd part is the matrix ``O = 2 w sum o_k delta_k'``;
because the directions are an orthogonal basis, ``O O'`` is all of the odd covariance. O says how the result
moves with each column of S, so it is a set of further rows of the factor; the even part is what those
columns do not explain. The process and nonlinear measurements are both collected so.
"""

import numpy as np
from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.basis import BASIS, PAIRS
from auvid_cli.filters.square_root_state import STATE
from auvid_cli.filters.workspace import WORKSPACE
from auvid_cli.lanes import LANES

_ROW = np.uint64(PAIRS)
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(
    types.void(_vector, types.int64, types.int64, types.int64, types.int64, _vector, _vector),
    reassociate=True,
    inline=True,
)
def two_products(left, first, second, stride, n_terms, right, out):
    """Fill `out` with two rows of a matrix product, each `PAIRS` long: ``sum_j left_j right_j``.

    Two rows and four terms at a time load and store half as often as one by one; `n_terms` is rounded up to a
    multiple of four. The rows of `left` begin at `first` and `second`, their terms lie `stride` apart.
    """
    for k in range(2 * PAIRS):
        out[k] = 0.0
    for j in range(0, n_terms, 4):
        a, b = first + j * stride, second + j * stride
        a0, a1, a2, a3 = left[a], left[a + stride], left[a + 2 * stride], left[a + 3 * stride]
        b0, b1, b2, b3 = left[b], left[b + stride], left[b + 2 * stride], left[b + 3 * stride]
        terms = right[j * PAIRS : (j + 4) * PAIRS]
        for k in range(_ROW):
            t0, t1, t2, t3 = terms[k], terms[k + _ROW], terms[k + 2 * _ROW], terms[k + 3 * _ROW]
            out[k] += a0 * t0 + a1 * t1 + a2 * t2 + a3 * t3
            out[k + _ROW] += b0 * t0 + b1 * t1 + b2 * t2 + b3 * t3


@compiled(types.void(BASIS, STATE, types.int64, WORKSPACE), reassociate=True, inline=True)
def draw_points(basis, state, n_moving, work):
    """Fill blocks with the points ``mean +- S delta_k``, one block to a tile, and the centre behind them.

    +delta lies in the lower half of the lanes and -delta in the upper; lanes without a direction hold the
    mean. Moving rows come first in a block, then the parameters.
    """
    n, mean, columns, points, scratch = state.n, state.mean, state.columns, work.points, work.product
    n_parameters, n_tiles = n - n_moving, basis.directions.shape[0]
    width = columns.shape[1]
    factor = columns.reshape(-1)
    for i in range(n):
        points[n_tiles, (i - n_parameters if i >= n_parameters else i + n_moving) * LANES] = mean[i]
    for tile in range(n_tiles):
        for i in range(0, n, 2):
            two_products(factor, i, i + 1, width, i + 2, basis.directions[tile], scratch)
            for r in range(min(2, n - i)):
                lane = i + r - n_parameters if i + r >= n_parameters else i + r + n_moving
                row = points[tile, lane * LANES : (lane + 1) * LANES]
                deviation = scratch[r * PAIRS : (r + 1) * PAIRS]
                centre = mean[i + r]
                for k in range(_ROW):
                    row[k] = centre + deviation[k]
                    row[k + _ROW] = centre - deviation[k]


@compiled(types.boolean(types.int64, _vector), reassociate=True, inline=True)
def all_finite(n, values):
    """Say whether the first n values are finite; a sum is one branch instead of n."""
    total = 0.0
    for i in range(n):
        total += values[i]
    return np.isfinite(total)


@compiled(
    types.void(_matrix, BASIS, types.int64, types.int64, _vector, WORKSPACE),
    reassociate=True,
    inline=True,
)
def collect_points(images, basis, n_images, first_even, image_mean, work):
    """Collect mean, odd and even part of what a map made of the points.

    Parameters
    ----------
    images : ndarray, shape (n_tiles + 1, at least n_images * LANES)
        Mapped points, block by block; the first lane of the last block is the centre's.
    basis : Basis
    n_images : int
        Number of rows that the map yields.
    first_even : int
        Where in ``work.spread`` to begin.
    image_mean : ndarray, shape (n_images,)
        Filled in.
    work : Workspace
        ``regression`` is filled with the odd part in the basis of the factor: row i of the result moves by entry j
        with column j of S. ``spread`` is filled, from `first_even` on, with rows whose Gram matrix is the covariance
        left to the even part.
    """
    odd, regression, spread, scratch = work.odd, work.regression, work.spread, work.product
    n_tiles, m = basis.directions.shape[0], basis.present.size
    root, present = np.sqrt(2.0 * basis.weight), basis.present
    for i in range(n_images):
        middle, difference = spread[i, first_even : first_even + m], odd[i]
        total = 0.0
        for tile in range(n_tiles):
            points = images[tile, i * LANES : (i + 1) * LANES]
            first = np.uint64(tile * PAIRS)
            for k in range(_ROW):
                middle[first + k] = 0.5 * (points[k] + points[k + _ROW])
                difference[first + k] = basis.weight * (points[k] - points[k + _ROW])
                total += middle[first + k] * present[first + k]
        centre = 2.0 * basis.weight * total if basis.centred else images[n_tiles, i * LANES]
        shift = 0.0
        for k in range(m):
            value = (middle[k] - centre) * present[k]
            shift += value
            middle[k] = root * value
        shift *= 2.0 * basis.weight
        image_mean[i] = centre if basis.centred else centre + shift
        spread[i, first_even + m] = 0.0 if basis.centred else np.sqrt(basis.curvature) * shift
    differences = odd.reshape(-1)
    for i in range(0, n_images, 2):
        for tile in range(n_tiles):
            two_products(differences, i * m, (i + 1) * m, 1, m, basis.transposed[tile], scratch)
            for r in range(2):
                target = regression[i + r, tile * PAIRS : (tile + 1) * PAIRS]
                source = scratch[r * PAIRS : (r + 1) * PAIRS]
                for k in range(_ROW):
                    target[k] = source[k]
