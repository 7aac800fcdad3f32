"""Lower-triangular factors of covariances: made from rows, and conditioned on a measurement.

The covariance is carried as a factor S and never formed, so it cannot lose definiteness by rounding.
"""

import numpy as np
from numba import types

from auvid_cli.compilation import compiled

# Rows of a factor are padded with zeros to whole tiles, and worked on from a tile's edge on.
TILE = 16
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.boolean(_matrix, types.int64, _matrix), reassociate=True)
def triangularise(rows, n, lower):
    """Find the lower-triangular L with ``L L' = rows rows'`` for the first n rows, by modified Gram-Schmidt.

    The triangular factor of modified Gram-Schmidt is as accurate as Householder's (Bjorck 1967). Overwrites
    `rows`. False if a row vanishes or is not finite.
    """
    n_columns = rows.shape[1]
    for i in range(n):
        row = rows[i]
        square = 0.0
        for k in range(n_columns):
            square += row[k] * row[k]
        if not (square > 0.0 and square < np.inf):
            return False
        norm = np.sqrt(square)
        lower[i, i] = norm
        for j in range(i + 1, n, 2):
            other0, other1 = rows[j], rows[j + 1]
            dot0, dot1 = 0.0, 0.0
            for k in range(n_columns):
                dot0 += other0[k] * row[k]
                dot1 += other1[k] * row[k]
            lower[i, j], lower[i, j + 1] = 0.0, 0.0
            lower[j, i], lower[j + 1, i] = dot0 / norm, dot1 / norm
            share0, share1 = dot0 / square, dot1 / square
            for k in range(n_columns):
                other0[k] -= share0 * row[k]
                other1[k] -= share1 * row[k]
    return True


@compiled(
    types.float64(_matrix, types.int64, types.int64, types.float64, _vector, _vector, _vector),
    reassociate=True,
)
def carlson_update(columns, n, measured, variance, gain, ratio, share):
    """Condition a factor, and whatever rides along with it, on one of its rows measured with noise.

    Parameters
    ----------
    columns : ndarray, shape (at least n rounded up to even, width)
        Row j holds column j of the lower-triangular factor S, then, from n on, entry j of further rows that
        depend on the state linearly. Zero elsewhere; width is a multiple of `TILE`. Updated in place.
    n : int
        Dimension of the state.
    measured : int
        Which row of the factor, as an index along `width`.
    variance : float
        Of the measurement noise.
    gain : ndarray, shape (width,)
        Filled with the covariance of every row with the measured one; divide by the returned value.
    ratio, share : ndarray, shape (at least n rounded up to even, )
        Overwritten.

    Returns
    -------
    float
        Variance of the innovation.

    Notes
    -----
    With f the measured row, ``I - f f' / (variance + f' f)`` has the lower-triangular root L with, for
    ``a_j = variance + sum_{k >= j} f_k^2``, ``L_jj = sqrt(a_{j+1} / a_j)`` and ``L_ij = -f_i f_j / sqrt(a_j
    a_{j+1})``; S L is built column by column from the last (Carlson, AIAA J. 11(9), 1973). Two columns at a
    time load and store the gain half as often; a padding column of zeros makes their number even.
    """
    width = columns.shape[1]
    n_even = n + n % 2
    total = variance
    for j in range(n_even):
        share[j] = columns[j, measured]
    for step in range(n_even):
        j = n_even - 1 - step
        total += share[j] * share[j]
        ratio[j] = total
    for j in range(n_even):
        ratio[j] = np.sqrt(ratio[j])
    last = np.sqrt(variance)
    share[n_even - 1] /= ratio[n_even - 1] * last
    for j in range(n_even - 1):
        share[j] /= ratio[j] * ratio[j + 1]
    for j in range(n_even - 1):
        ratio[j] = ratio[j + 1] / ratio[j]
    ratio[n_even - 1] = last / ratio[n_even - 1]

    for i in range(width):
        gain[i] = 0.0
    for step in range(0, n_even, 2):
        j = n_even - 1 - step
        f0, keep0, give0 = columns[j, measured], ratio[j], share[j]
        f1, keep1, give1 = columns[j - 1, measured], ratio[j - 1], share[j - 1]
        edge = (j - 1) // TILE * TILE
        column0, column1, covariance = columns[j][edge:], columns[j - 1][edge:], gain[edge:]
        for i in range(width - edge):
            old0, old1, g = column0[i], column1[i], covariance[i]
            column0[i] = keep0 * old0 - give0 * g
            g += f0 * old0
            column1[i] = keep1 * old1 - give1 * g
            covariance[i] = g + f1 * old1
    return total
