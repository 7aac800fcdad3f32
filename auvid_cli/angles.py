"""Angles modulo one turn."""

from typing import Any, overload

import numpy as np
from numpy.typing import NDArray


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: NDArray[np.float64]) -> NDArray[np.float64]: ...
def wrap(angle: Any) -> Any:
    """Return angles or differences of angles, rad, in [-pi, pi); also used in compiled code."""
    return angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5)
