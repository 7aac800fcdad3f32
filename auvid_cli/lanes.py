"""How the compiled core lays out many states at once.

A block is a flat vector of rows, one row per quantity and `LANES` states to a row, so that one
instruction works on several states. Vehicle dynamics and filters share this layout and nothing else.
"""

import numpy as np
from numpy.typing import NDArray

LANES = 64
# A cache line, bytes: as long as the longest vectors.
LINE = 64


def zeros_on_lines(*shape: int) -> NDArray[np.float64]:
    """Make an array of zeros that begins at a cache line, so that no vector of it straddles two."""
    size = int(np.prod(shape))
    spare = np.zeros(size + LINE // 8)
    begin = -spare.ctypes.data % LINE // 8
    return spare[begin : begin + size].reshape(shape)
