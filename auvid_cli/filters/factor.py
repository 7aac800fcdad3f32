"""Lower-triangular factors of covariances: made from rows, and conditioned on a measurement.

The covariance is carried as a factor S and never formed, so it cannot lose definiteness by rounding.
"""

import numpy as np
from numba import types

from auvid_cli.compilation import compiled

# Rows of a factor are padded with zeros to whole tiles, and worked on from a tile's edge on.
TILE = 8
_0, _1, _2, _3, _4, _TILE = (np.uint64(number) for number in (0, 1, 2, 3, 4, TILE))
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_four = types.UniTuple(types.float64, 4)
LEAST = float(np.finfo(np.float64).tiny)
# `orthogonalise` takes four rows at a time from any on, and so touches as many behind the last.
SPARE_ROWS = 3


@compiled(types.void(_vector, _four, *[_vector] * 4), reassociate=True, internal=True)
def _take_away(row, shares, other0, other1, other2, other3):
    """Take shares of a row from four others.

    As arguments they do not overlap: the compiler makes one loop of vectors of it, and does not look whether they do.
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
    """Make the rows behind row i, whose square is given, orthogonal to it; fill in that row and column of `lower`.

    Four rows at a time read the one that they are made orthogonal to a quarter as often; of `rows`, and of rows and
    columns of `lower`, there are `SPARE_ROWS` more than n.
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

    The triangular factor of modified Gram-Schmidt is as accurate as Householder's (Bjorck 1967). Overwrites
    `rows`, of which there are as many as `orthogonalise` needs. False if a row vanishes or is not finite.
    """
    for i in range(n):
        row, square = rows[i], 0.0
        for k in range(row.size):
            square += row[k] * row[k]
        # Of a smaller one there is no reciprocal.
        if not (square >= LEAST and square < np.inf):
            return False
        orthogonalise(rows, i, n, square, lower)
    return True


@compiled(types.void(*[_vector] * 5, types.uint64, *[_four] * 3), reassociate=True, internal=True)
def _condition_four(column0, column1, column2, column3, gain, edge, measured, keep, give):
    """Condition four columns of a factor, the last first, see `carlson_update`; as arguments they do not overlap."""
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
    """Condition a factor, and whatever rides along with it, on a combination of its rows measured with noise.

    Parameters
    ----------
    columns : ndarray, shape (at least n rounded up to a multiple of four, width)
        Row j holds column j of the lower-triangular factor S, then, from n on, entry j of further rows that
        depend on the state linearly. Zero elsewhere; width is a multiple of `TILE`. Updated in place.
    n : int
        Dimension of the state.
    measured : ndarray, shape (at least n rounded up to a multiple of four,)
        The combination in the basis of the factor: with h the row of the measurement matrix, ``h S``. Zero from n on.
    variance : float
        Of the measurement noise.
    gain : ndarray, shape (width,)
        Filled with the covariance of every row with the measured one; divide by the returned value.
    ratio, share : ndarray, shape (one more than `measured` needs,)
        Overwritten.

    Returns
    -------
    float
        Variance of the innovation; NaN, and the factor as it was, where its square is no number any more.

    Notes
    -----
    With f the measured row, ``I - f f' / (variance + f' f)`` has the lower-triangular root L with, for
    ``a_j = variance + sum_{k >= j} f_k^2``, ``L_jj = sqrt(a_{j+1} / a_j)`` and ``L_ij = -f_i f_j / sqrt(a_j
    a_{j+1})``; S L is built column by column from the last (Carlson, AIAA J. 11(9), 1973). Four columns at a
    time load and store the gain a quarter as often; padding columns of zeros fill up the last four. Indices are
    unsigned, so that none is looked at for counting from the end.
    """
    width, last = np.uint64(columns.shape[1]), (np.uint64(n) + _3) // _4 * _4
    total = variance
    ratio[last] = variance
    for step in range(_0, last, _4):
        j = last - _4 - step
        f0, f1, f2, f3 = measured[j], measured[j + _1], measured[j + _2], measured[j + _3]
        # The sum over four is made apart, so that one waits only for every fourth of them.
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
