"""When a sensor is silent for long."""

import numpy as np
from numpy.typing import NDArray

# s, and times the usual interval.
_LONGEST, _INTERVALS = 1.0, 10.0


def gap_limit(intervals: NDArray[np.float64]) -> float:
    """Return the longest interval between measurements that is not a gap, s.

    Parameters
    ----------
    intervals : ndarray, shape (n,)
        Those between all measurements, s; at least one.
    """
    return max(_LONGEST, _INTERVALS * float(np.median(intervals)))
