"""Series over time as figures and pages draw them: units, thinning, gaps and limits of axes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.report.table import unit_text
from auvid_cli.vehicle.parameters import Quantity

_DEGREES = float(np.rad2deg(1.0))
# A line is broken where time advances by more than both of these.
_JUMP = 20.0  # median intervals
_MIN_JUMP = 1.0  # s
_MARGIN = 0.08  # share of the range of the values


class Scale(NamedTuple):
    """A unit, and the number of these units in an SI unit."""

    unit: str
    factor: float


_READABLE = {"rad": Scale("°", _DEGREES), "rad/s": Scale("°/s", _DEGREES), "T": Scale("µT", 1e6)}


def scale_of(quantity: Quantity) -> Scale:
    """Return the unit in which a quantity is shown: angles and rates in degrees."""
    return _READABLE.get(quantity.unit, Scale(unit_text(quantity.unit), 1.0))


def finite(values: Array) -> Array:
    """Return values with NaN instead of infinity; NaN breaks a line."""
    return np.where(np.isfinite(values), values, np.nan)


def thin(time: Array, values: Array, points: int = 2000) -> tuple[Array, Array]:
    """Return about `points` samples: the least and the greatest of each part, so that noise keeps its width.

    Values that are not finite are gaps; a gap that fills a part, and a jump of time, remain gaps.
    """
    time, values = broken(time, finite(values))
    n = values.size
    if n <= points:
        return time, values
    least, greatest = _extremes(values, -(-n // (points // 2)))
    kept = np.unique(np.concatenate([[0], least, greatest, [n - 1]]))
    return time[kept], values[kept]


def envelope(time: Array, values: Array, parts: int) -> tuple[Array, Array]:
    """Return the least and the greatest value of each of equal parts, in their order; see `thin`.

    Times are the beginning and the middle of each part, so that series with the same times share them.
    """
    time, values = broken(time, finite(values))
    n = values.size
    if n <= 2 * parts:
        return time, values
    length = -(-n // parts)
    begin = np.arange(0, n, length)
    middle = np.minimum(begin + length // 2, n - 1)
    in_order = np.sort(np.stack(_extremes(values, length), axis=1), axis=1)
    return time[np.stack([begin, middle], axis=1).ravel()], values[in_order.ravel()]


def _extremes(values: Array, length: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of the least and of the greatest value in each part of `length` samples."""
    parts = -(-values.size // length)
    padded = np.full(parts * length, np.nan)
    padded[: values.size] = values
    block = padded.reshape(parts, length)
    gap = np.isnan(block)
    begin = np.arange(parts) * length
    least, greatest = np.where(gap, np.inf, block).argmin(axis=1), np.where(gap, -np.inf, block).argmax(axis=1)
    return begin + least, begin + greatest


def broken(time: Array, values: Array) -> tuple[Array, Array]:
    """Insert a gap, NaN, wherever time jumps."""
    steps = np.diff(time)
    if not steps.size:
        return time, values
    jumps = np.flatnonzero(steps > max(_JUMP * float(np.median(steps)), _MIN_JUMP)) + 1
    return np.insert(time, jumps, time[jumps]), np.insert(values, jumps, np.nan)


def spaced(n: int, points: int) -> NDArray[np.int64]:
    """Return indices of at most `points` samples evenly spaced, with the first and the last; for smooth series."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, points)).astype(np.int64))


def log_spaced(time: Array, first: float, points: int) -> NDArray[np.int64]:
    """Return indices of at most `points` samples evenly spaced in the logarithm of time from `first`, s, to the end."""
    last = float(time[-1])
    wanted = np.geomspace(min(first, last), last, points) if last > 0.0 else np.zeros(1)
    return np.unique(np.clip(np.searchsorted(time, wanted), 0, time.size - 1))


def unwrapped(angle: Array) -> Array:
    """Return an angle, rad, without jumps of a turn; gaps stay gaps."""
    result = finite(angle)
    is_known = ~np.isnan(result)
    result[is_known] = np.unwrap(result[is_known])
    return result


def value_range(*series: Array) -> tuple[float, float] | None:
    """Return least and greatest finite value, None if there is none."""
    finite = [values[np.isfinite(values)] for values in series]
    present = [values for values in finite if values.size]
    if not present:
        return None
    return min(float(values.min()) for values in present), max(float(values.max()) for values in present)


def with_margin(low: float, high: float) -> tuple[float, float]:
    """Return limits with a margin on both sides, also around a single value."""
    room = _MARGIN * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


def around(reference: tuple[float, float] | None, others: tuple[float, float] | None) -> tuple[float, float]:
    """Return limits around a reference range, extended to other ranges by at most its own height."""
    if reference is None:
        return with_margin(*others) if others is not None else (-1.0, 1.0)
    low, high = reference
    if others is not None:
        height = high - low
        low, high = max(min(low, others[0]), low - height), min(max(high, others[1]), high + height)
    return with_margin(low, high)
