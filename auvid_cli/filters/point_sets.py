"""Sigma points of the cubature, transformed unscented and scaled unscented filters.

All three are antipodal: every direction ``delta`` comes with ``-delta``. So one half is enough, and
a set is that half, one weight and, for the unscented filter, a point at the centre.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PointSet(NamedTuple):
    """Half of an antipodal set for a standard normal vector.

    Attributes
    ----------
    directions : ndarray, shape (n, n)
        Column k is ``delta_k``; the points are +delta_k and -delta_k.
    weight : float
        Of each of the 2 n points; ``2 weight directions @ directions.T == I``.
    centred : bool
        Whether the mean of the points themselves is the reference (cubature) or the point at the
        centre (unscented).
    curvature : float
        Weight, in the covariance, of the squared shift of the mean from the centre: ``beta -
        alpha^2`` of the scaled unscented transformation; not used by centred sets.
    """

    directions: Array
    weight: float
    centred: bool
    curvature: float


def cubature(n: int) -> PointSet:
    """Return the points of the third-degree spherical-radial rule: ``+-sqrt(n) e_i`` (Arasaratnam and Haykin 2009)."""
    return PointSet(np.sqrt(n) * np.eye(n), 0.5 / n, True, 0.0)


def transformed(n: int) -> PointSet:
    """Turn the cubature set so that no coordinate exceeds sqrt 2.

    Sabet et al. 2018, eq. (34); Chang, Hu, Li and Chang, IEEE TAC 58(1), 2013. Of the paper's 2 n
    points, the k-th and the (n + k)-th are antipodal.
    """
    k = np.arange(1, n + 1)
    directions = np.zeros((n, n))
    for j in range(1, n // 2 + 1):
        angle = (2 * j - 1) * k * np.pi / n
        directions[2 * j - 2] = np.sqrt(2.0) * np.cos(angle)
        directions[2 * j - 1] = np.sqrt(2.0) * np.sin(angle)
    if n % 2:
        directions[n - 1] = (-1.0) ** k
    return PointSet(directions, 0.5 / n, True, 0.0)


def unscented(n: int, alpha: float, beta: float, kappa: float) -> PointSet:
    """Return the points of the scaled unscented transformation (Julier 2002; van der Merwe 2004).

    With e the even part of the propagated points about the centre and mu its mean, the covariance
    is ``odd + 2 w sum e e' + (beta - alpha^2) mu mu'``: a sum of squares for every ``beta >=
    alpha^2``, although the weight of the centre may be negative.
    """
    spread = alpha**2 * (n + kappa)
    return PointSet(np.sqrt(spread) * np.eye(n), 0.5 / spread, False, beta - alpha**2)
