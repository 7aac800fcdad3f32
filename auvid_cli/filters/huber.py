"""Huber's weights: a residual beyond some standard deviations counts by its size, and no longer by its square.

With the residual r in standard deviations and the threshold k a fit makes ``sum rho(r)`` small,

    rho(r) = r^2 up to k, and 2 k |r| - k^2 beyond,

by least squares with the weights ``w = min(1, k / |r|)`` about each answer, over and over. ``rho = w (2 - w) r^2``,
and the weighted sum of squares, with ``rho - w r^2 = w (1 - w) r^2`` added, is nowhere less than the sum of rho and
touches it at the answer about which it is taken: a step that lowers the one lowers the other (P. J. Huber, Robust
Statistics, 1981, section 7.8).
"""

from typing import Any

import numpy as np

# Standard deviations: clean data lose 1 % of their information.
THRESHOLD = 2.0
# A component that counts less than this is one that was set aside: of Gaussian noise none in ten thousand.
SET_ASIDE = 0.5


def weight(square: Any, threshold: float) -> Any:
    """Return weights of squared residuals, r^2; compiled code compiles it for itself."""
    return 1.0 / np.sqrt(np.maximum(square / threshold**2, 1.0))
