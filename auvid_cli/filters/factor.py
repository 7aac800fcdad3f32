"""Lower-triangular factors of covariances: from rows by Gram-Schmidt, and Carlson's update with a measurement.

Filters store the factor S of the covariance ``S S'``, which stays positive definite in spite of rounding.
"""

import numpy as np

from auvid_cli.numerics import compiled, types

# Rows of a factor are padded with zeros to a multiple of this, a cache line.
TILE = 8
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
LEAST = float(np.finfo(np.float64).tiny)


@compiled(reassociate=True)
def orthogonalise(rows, i, n, square, lower):
    """Make rows i + 1 to n - 1 orthogonal to row i, whose square is given; fill in row and column i of `lower`."""
    row, norm = rows[i], np.sqrt(square)
    lower[i, i] = norm
    for j in range(i + 1, n):
        other, dot = rows[j], 0.0
        for k in range(row.size):
            dot += other[k] * row[k]
        lower[i, j] = 0.0
        lower[j, i] = dot / norm
        share = dot / square
        for k in range(row.size):
            other[k] -= share * row[k]


@compiled(types.boolean(_matrix, types.int64, _matrix), reassociate=True)
def triangularise(rows, n, lower):
    """Find the lower-triangular L with ``L L' = rows rows'`` for the first n rows, by modified Gram-Schmidt.

    The triangular factor of modified Gram-Schmidt is as accurate as Householder's (Bjorck 1967). Overwrites `rows`.
    False if a row vanishes or is not finite.
    """
    for i in range(n):
        row, square = rows[i], 0.0
        for k in range(row.size):
            square += row[k] * row[k]
        # A smaller number has no reciprocal.
        if not (square >= LEAST and square < np.inf):
            return False
        orthogonalise(rows, i, n, square, lower)
    return True


@compiled(types.float64(_matrix, types.int64, _vector, types.float64, *[_vector] * 3), reassociate=True)
def carlson_update(columns, n, measured, variance, gain, ratio, share):
    """Update a factor, and further rows that depend on the state, with a noisy measurement of a combination of rows.

    Parameters
    ----------
    columns : ndarray, shape (at least n, width)
        Row j holds column j of the lower-triangular factor S, then, from n on, entry j of further rows that
        depend on the state linearly. Zero elsewhere; width is a multiple of `TILE`. Updated in place.
    n : int
        Dimension of the state.
    measured : ndarray, shape (at least n,)
        The combination in the basis of the factor: with h the row of the measurement matrix, ``f = h S``.
    variance : float
        Variance of the measurement noise.
    gain : ndarray, shape (width,)
        Filled with the covariance of every row with the measured one; divide by the returned value.
    ratio, share : ndarray, shape (at least n + 1,)
        Overwritten.

    Returns
    -------
    float
        Variance of the innovation; NaN, with the factor unchanged, where its square overflows.

    Notes
    -----
    Carlson, AIAA J. 11(9), 1973. ``I - f f' / (variance + f' f)`` has the lower-triangular root L with, for
    ``a_j = variance + sum_{k >= j} f_k^2``, ``L_jj = sqrt(a_{j+1} / a_j)`` and ``L_ij = -f_i f_j / sqrt(a_j
    a_{j+1})``. S L is built column by column from the last.
    """
    width, total = columns.shape[1], variance
    ratio[n] = variance
    for j in range(n - 1, -1, -1):
        total += measured[j] * measured[j]
        ratio[j] = total
    if not total * total < np.inf:
        return np.nan
    for j in range(n):
        root = 1.0 / np.sqrt(ratio[j] * ratio[j + 1])
        share[j] = measured[j] * root
        ratio[j] = ratio[j + 1] * root

    for i in range(width):
        gain[i] = 0.0
    for j in range(n - 1, -1, -1):
        column, f, keep, give = columns[j], measured[j], ratio[j], share[j]
        # Unsigned: an index that may be negative keeps the loop scalar.
        for i in range(np.uint64(j // TILE * TILE), np.uint64(width)):
            old = column[i]
            column[i] = keep * old - give * gain[i]
            gain[i] += f * old
    return total
