"""Type of the arrays of most functions."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
