"""The value object of a free run, apart from the compiled code that makes one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class FreeRun(NamedTuple):
    """Motion predicted from the inputs alone.

    Attributes
    ----------
    time : ndarray, shape (n,)
    motion : ndarray, shape (n, 9)
        Not finite from where the model blew up, if it did.
    """

    time: Array
    motion: Array
