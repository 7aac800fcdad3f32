"""Lower-triangular factors of covariances: made from rows, and conditioned on a measurement.

The covariance is carried as a factor S and never formed, so it cannot lose definiteness by rounding.
"""

import numpy as np
from numba import types

from auvid_cli.compilation import compiled

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.boolean(_matrix, types.int64, _matrix), reassociate=True)
def triangularise(rows, n_columns, lower):
    """Lower-triangular L with ``L L' = rows rows'``, by modified Gram-Schmidt; overwrites `rows`.

    The triangular factor of modified Gram-Schmidt is as accurate as Householder's (Bjorck 1967).
    False if a row vanishes or is not finite.
    """
    n = rows.shape[0]
    for i in range(n):
        row = rows[i]
        square = 0.0
        for k in range(n_columns):
            square += row[k] * row[k]
        if not (square > 0.0 and square < np.inf):
            return False
        norm = np.sqrt(square)
        lower[i, i] = norm
        for k in range(n_columns):
            row[k] /= norm
        for j in range(i + 1, n):
            other = rows[j]
            dot = 0.0
            for k in range(n_columns):
                dot += other[k] * row[k]
            lower[j, i] = dot
            lower[i, j] = 0.0
            for k in range(n_columns):
                other[k] -= dot * row[k]
    return True


@compiled(types.float64(_matrix, _vector, types.float64, _vector, _vector), reassociate=True)
def carlson_update(columns, projection, variance, gain, scratch):
    """Condition the factor on one scalar measurement.

    Parameters
    ----------
    columns : ndarray, shape (n, n)
        Row j holds column j of the lower-triangular factor S. Updated in place.
    projection : ndarray, shape (n,)
        ``S' h`` of the measurement row h.
    variance : float
        Of the measurement noise.
    gain : ndarray, shape (n,)
        Filled with ``S S' h``; divide by the returned value for the Kalman gain.
    scratch : ndarray, shape (n,)
        Overwritten.

    Returns
    -------
    float
        Variance of the innovation.

    Notes
    -----
    ``I - f f' / (variance + f' f)`` has the lower-triangular root L with, for ``a_j = variance +
    sum_{k >= j} f_k^2``, ``L_jj = sqrt(a_{j+1} / a_j)`` and ``L_ij = -f_i f_j / sqrt(a_j a_{j+1})``;
    S L is built column by column from the last (Carlson, AIAA J. 11(9), 1973).
    """
    n = projection.size
    total = variance
    for i in range(n):
        gain[i] = 0.0
    for step in range(n):
        j = n - 1 - step
        f = projection[j]
        if f == 0.0:
            continue
        below = total
        total += f * f
        ratio = np.sqrt(below / total)
        share = f / (total * ratio)
        column = columns[j]
        for i in range(j, n):
            scratch[i] = column[i]
        for i in range(j, n):
            column[i] = ratio * scratch[i] - share * gain[i]
            gain[i] += f * scratch[i]
    return total
