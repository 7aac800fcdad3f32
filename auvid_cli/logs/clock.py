"""Times of a log: numbers, clocks as text or dates to seconds, and rows into their order."""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.formats.log import ColumnValues

Array = NDArray[np.float64]

_HOUR, _DAY = 3600.0, 86400.0
_CLOCK = re.compile(r"\s*(?:(\d{1,2}):)?(\d{1,2}):(\d{1,2}(?:\.\d*)?)\s*", re.ASCII)
_DATE = re.compile(r"\s*\d{4}-\d{2}-\d{2}")
_CHUNK = 100_000
# No clock counts so far: nanoseconds since 1970 are some 2e18.
FARTHEST = 1e20


class Clock(NamedTuple):
    """Times in seconds, NaN where there is none.

    Attributes
    ----------
    seconds : ndarray
    rollovers : int
        How often a clock without hours, or without a date, began anew.
    """

    seconds: Array
    rollovers: int = 0


class Order(NamedTuple):
    """Rows that remain, in the order of their times, and why others do not.

    Attributes
    ----------
    rows : ndarray of int, or a slice of all
    without_time : int
        Rows whose time is missing.
    backward : int
        Rows whose time is before that of the row before.
    furthest_back : float
        s, of the largest such step.
    duplicates : int
        Rows at the time of an earlier row.
    """

    rows: NDArray[np.int64] | slice
    without_time: int = 0
    backward: int = 0
    furthest_back: float = 0.0
    duplicates: int = 0


def to_seconds(values: ColumnValues, factor: float) -> Clock:
    """Convert a time column to seconds.

    Parameters
    ----------
    values : ndarray
        Numbers, or text: ``mm:ss.s``, ``HH:MM:SS.s``, or dates with times by ISO 8601 (UTC where they state no zone).
    factor : float
        s per unit of numbers.

    Raises
    ------
    ValueError
        If a text is no time; the message shows it.
    """
    if values.dtype.kind != "U":
        numbers = np.asarray(values, np.float64)
        if (np.abs(numbers) >= FARTHEST).any():
            numbers = np.where(np.abs(numbers) < FARTHEST, numbers, np.nan)
        return Clock(numbers if factor == 1.0 else numbers * factor)
    first = str(next((text for text in values if text.strip()), ""))
    if _DATE.match(first):
        return Clock(_dates(values))
    clock = _CLOCK.fullmatch(first)
    if clock is None:
        raise ValueError(
            f"{first!r} is not a time: expected a number, mm:ss.s, HH:MM:SS.s or a date such as 2025-04-04T22:23:02Z"
        )
    period = _DAY if clock[1] else _HOUR
    return _unwrapped(np.fromiter((_clock_seconds(text) for text in values), np.float64, values.size), period)


def order_rows(seconds: Array) -> Order:
    """Find the order in which times increase strictly; of rows at one time the first counts."""
    known = np.isfinite(seconds)
    without_time = int(seconds.size - np.count_nonzero(known))
    steps = np.diff(seconds[known] if without_time else seconds)
    backward = int(np.count_nonzero(steps < 0.0))
    if not without_time and (steps > 0.0).all():
        return Order(slice(None))
    furthest_back = -float(min(steps.min(initial=0.0), 0.0))
    rows = np.flatnonzero(known)
    rows = rows[np.argsort(seconds[rows], kind="stable")]
    is_new = np.diff(seconds[rows], prepend=-np.inf) > 0.0
    return Order(rows[is_new], without_time, backward, furthest_back, int(np.count_nonzero(~is_new)))


def _clock_seconds(text: str) -> float:
    if not text.strip():
        return np.nan
    match = _CLOCK.fullmatch(text)
    if match is None:
        raise ValueError(f"{str(text)!r} is not a time like those before it")
    hours, minutes, seconds = match.groups()
    return 3600.0 * float(hours or 0.0) + 60.0 * float(minutes) + float(seconds)


def _unwrapped(seconds: Array, period: float) -> Clock:
    """Let a clock go on where it begins anew: where it falls by more than half of its period."""
    known = np.flatnonzero(np.isfinite(seconds))
    turns = np.cumsum(np.diff(seconds[known], prepend=seconds[known[:1]]) < -0.5 * period)
    unwrapped = seconds.copy()
    unwrapped[known] += period * turns
    return Clock(unwrapped, int(turns[-1]) if turns.size else 0)


def _dates(values: ColumnValues) -> Array:
    import pandas as pd

    seconds = np.empty(values.size)
    for begin in range(0, values.size, _CHUNK):
        part = pd.Series(values[begin : begin + _CHUNK]).str.strip()
        dates = pd.to_datetime(part.where(part != "", None), utc=True, format="ISO8601")
        nanoseconds = dates.dt.tz_localize(None).to_numpy().astype("datetime64[ns]")
        seconds[begin : begin + _CHUNK] = np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype(np.int64) * 1e-9)
    return seconds
