"""Limits of an axis that show what matters."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MARGIN = 0.08
# Zero is shown if it is no further away than this share of what is shown anyway.
_NEAR = 0.25


def value_range(*series: Array) -> tuple[float, float] | None:
    """Return least and greatest finite value, None if there is none."""
    finite = [values[np.isfinite(values)] for values in series]
    present = [values for values in finite if values.size]
    if not present:
        return None
    return min(float(values.min()) for values in present), max(float(values.max()) for values in present)


def with_margin(low: float, high: float) -> tuple[float, float]:
    """Leave some room on both sides; a point gets room of its own size."""
    room = _MARGIN * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


def with_near_zero(low: float, high: float) -> tuple[float, float]:
    """Reach to zero if that costs little."""
    near = _NEAR * (high - low)
    return (0.0 if 0.0 < low <= near else low), (0.0 if -near <= high < 0.0 else high)


def around(reference: tuple[float, float] | None, others: tuple[float, float] | None) -> tuple[float, float]:
    """Leave room for the reference, and for the others as far as they stray no further than its own height."""
    if reference is None:
        return with_margin(*others) if others is not None else (-1.0, 1.0)
    low, high = reference
    if others is not None:
        height = high - low
        low, high = max(min(low, others[0]), low - height), min(max(high, others[1]), high + height)
    return with_margin(low, high)
