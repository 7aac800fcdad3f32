"""Type of arrays of doubles."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
