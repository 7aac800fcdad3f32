"""Of how many independent errors a series says as much: errors of predictions from one start after the other."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def independent_errors(errors: Array) -> float:
    """Return how many independent errors are worth as much as these, in their order; at most their number.

    Their mean square is not zero if they are all the same: an error that lasts, or that every start has, counts as
    correlated. Correlations are summed in pairs of lags as long as these are positive (C. J. Geyer, "Practical Markov
    chain Monte Carlo", Statistical Science 7(4), 1992).

    Parameters
    ----------
    errors : ndarray, shape (n,)
        By their standard deviations; n of at least 1.
    """
    n = errors.size
    square = float(errors @ errors)
    if square == 0.0:
        return 1.0
    by_lag = np.correlate(errors, errors, "full")[n - 1 :] / square
    pairs = by_lag[: n - n % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    together = 2.0 * float(pairs[: ends[0] if ends.size else pairs.size].sum()) - 1.0
    return n / max(together, 1.0)
