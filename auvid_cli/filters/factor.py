"""Lower-triangular factors of covariances: from rows by Gram-Schmidt, and Carlson's update with a measurement.

Filters store the factor S of the covariance ``S S'``, which stays positive definite in spite of rounding.
"""

import numpy as np
from numba import types

from auvid_cli.compilation import compiled

# Rows of a factor are padded with zeros to whole tiles; loops start at the edge of a tile.
TILE = 8
_0, _1, _2, _3, _4, _TILE = (np.uint64(number) for number in (0, 1, 2, 3, 4, TILE))
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_four = types.UniTuple(types.float64, 4)
LEAST = float(np.finfo(np.float64).tiny)
# Rows after the last that `orthogonalise` writes to, because it takes four rows at a time.
SPARE_ROWS = 3


@compiled(types.void(_vector, _four, *[_vector] * 4), reassociate=True, internal=True)
def _take_away(row, shares, other0, other1, other2, other3):
    """Subtract multiples of a row from four others.

    Separate arguments do not overlap, so that the compiler vectorises the loop without checks.
    """
    share0, share1, share2, share3 = shares
    for k in range(row.size):
        value = row[k]
        other0[k] -= share0 * value
        other1[k] -= share1 * value
        other2[k] -= share2 * value
        other3[k] -= share3 * value


@compiled(types.void(_matrix, types.int64, types.int64, types.float64, _matrix), reassociate=True, internal=True)
def orthogonalise(rows, i, n, square, lower):
    """Make the rows after row i orthogonal to it, given its `square`; fill in that row and column of `lower`.

    Four rows at a time save loads of row i. `rows` and `lower` have `SPARE_ROWS` more than n rows (and columns).
    """
    row = rows[i]
    norm, inverse = np.sqrt(square), 1.0 / square
    scale = norm * inverse
    lower[i, i] = norm
    for j in range(i + 1, n, 4):
        other0, other1, other2, other3 = rows[j], rows[j + 1], rows[j + 2], rows[j + 3]
        dot0, dot1, dot2, dot3 = 0.0, 0.0, 0.0, 0.0
        for k in range(row.size):
            dot0 += other0[k] * row[k]
            dot1 += other1[k] * row[k]
            dot2 += other2[k] * row[k]
            dot3 += other3[k] * row[k]
        lower[i, j], lower[i, j + 1], lower[i, j + 2], lower[i, j + 3] = 0.0, 0.0, 0.0, 0.0
        lower[j, i], lower[j + 1, i] = dot0 * scale, dot1 * scale
        lower[j + 2, i], lower[j + 3, i] = dot2 * scale, dot3 * scale
        shares = dot0 * inverse, dot1 * inverse, dot2 * inverse, dot3 * inverse
        _take_away(row, shares, other0, other1, other2, other3)


@compiled(types.boolean(_matrix, types.int64, _matrix), reassociate=True)
def triangularise(rows, n, lower):
    """Find the lower-triangular L with ``L L' = rows rows'`` for the first n rows, by modified Gram-Schmidt.

    The triangular factor is as accurate as Householder's (Bjorck 1967). Overwrites `rows`, see `orthogonalise`. False
    if a row is zero or not finite.
    """
    for i in range(n):
        row, square = rows[i], 0.0
        for k in range(row.size):
            square += row[k] * row[k]
        # The reciprocal of a smaller number overflows.
        if not (square >= LEAST and square < np.inf):
            return False
        orthogonalise(rows, i, n, square, lower)
    return True


@compiled(types.void(*[_vector] * 5, types.uint64, *[_four] * 3), reassociate=True, internal=True)
def _condition_four(column0, column1, column2, column3, gain, edge, measured, keep, give):
    """Update four columns of a factor, the last one first, see `carlson_update`."""
    f0, f1, f2, f3 = measured
    keep0, keep1, keep2, keep3 = keep
    give0, give1, give2, give3 = give
    for i in range(edge, np.uint64(gain.size)):
        old0, old1, old2, old3 = column0[i], column1[i], column2[i], column3[i]
        g = gain[i]
        column3[i] = keep3 * old3 - give3 * g
        g += f3 * old3
        column2[i] = keep2 * old2 - give2 * g
        g += f2 * old2
        column1[i] = keep1 * old1 - give1 * g
        g += f1 * old1
        column0[i] = keep0 * old0 - give0 * g
        gain[i] = g + f0 * old0


@compiled(types.float64(_matrix, types.int64, _vector, types.float64, *[_vector] * 3), reassociate=True)
def carlson_update(columns, n, measured, variance, gain, ratio, share):
    """Update a factor with a scalar measurement (Carlson, AIAA J. 11(9), 1973).

    Parameters
    ----------
    columns : ndarray, shape (at least n rounded up to a multiple of four, width)
        Row j holds column j of the lower-triangular factor S, then, from n on, entry j of additional rows that are
        linear in the state. Zero elsewhere; width is a multiple of `TILE`. Updated in place.
    n : int
        Dimension of the state.
    measured : ndarray, shape (at least n rounded up to a multiple of four,)
        ``h S`` with h the row of the measurement matrix. Zero from n on.
    variance : float
        Variance of the measurement noise.
    gain : ndarray, shape (width,)
        Filled in: covariance of the state with the innovation; the Kalman gain times the returned value.
    ratio, share : ndarray, shape (one more than `measured`,)
        Scratch.

    Returns
    -------
    float
        Variance of the innovation; NaN, and the factor unchanged, if its square overflows.

    Notes
    -----
    With f = `measured`, ``I - f f' / (variance + f' f)`` has the lower-triangular root L with, for
    ``a_j = variance + sum_{k >= j} f_k^2``, ``L_jj = sqrt(a_{j+1} / a_j)`` and ``L_ij = -f_i f_j / sqrt(a_j
    a_{j+1})``; S L is built column by column from the last. Four columns at a time save loads and stores of the gain;
    padding columns of zeros fill up the last four. Unsigned indices are not tested for counting from the end.
    """
    width, last = np.uint64(columns.shape[1]), (np.uint64(n) + _3) // _4 * _4
    total = variance
    ratio[last] = variance
    for step in range(_0, last, _4):
        j = last - _4 - step
        f0, f1, f2, f3 = measured[j], measured[j + _1], measured[j + _2], measured[j + _3]
        # Partial sums over four columns shorten the chain of dependent additions.
        sum3 = f3 * f3
        sum2 = sum3 + f2 * f2
        sum1 = sum2 + f1 * f1
        sum0 = sum1 + f0 * f0
        ratio[j], ratio[j + _1], ratio[j + _2], ratio[j + _3] = total + sum0, total + sum1, total + sum2, total + sum3
        total += sum0
    if not total * total < np.inf:
        return np.nan
    for j in range(last):
        root = 1.0 / np.sqrt(ratio[j] * ratio[j + _1])
        share[j] = measured[j] * root
        ratio[j] = ratio[j + _1] * root

    for i in range(width):
        gain[i] = 0.0
    for step in range(_0, last, _4):
        j = last - _4 - step
        _condition_four(
            *(columns[j], columns[j + _1], columns[j + _2], columns[j + _3], gain, j // _TILE * _TILE),
            (measured[j], measured[j + _1], measured[j + _2], measured[j + _3]),
            (ratio[j], ratio[j + _1], ratio[j + _2], ratio[j + _3]),
            (share[j], share[j + _1], share[j + _2], share[j + _3]),
        )
    return total
