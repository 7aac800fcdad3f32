"""Angles that are known modulo a turn."""

from typing import Any, overload

import numpy as np
from numpy.typing import NDArray


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: NDArray[np.float64]) -> NDArray[np.float64]: ...
def wrap(angle: Any) -> Any:
    """Bring angles or differences of angles, rad, to [-pi, pi); compiled code compiles it for itself."""
    return angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5)
