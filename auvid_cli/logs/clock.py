"""Clocks of a log: time stamps to seconds, and drift between clocks."""

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
# Of the median interval, and s: differences that vary by less hardly matter.
_PART_OF_INTERVAL, _LEAST = 0.5, 0.02
_QUANTILES = (0.05, 0.95)
# s; a log that was made so much later than its messages was played back. Smaller times are counted from when something
# was switched on.
_LATER, _LEAST_EPOCH = 60.0, 1e8


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


class ClockDrift(NamedTuple):
    """How a clock differs from another one of the same messages.

    Attributes
    ----------
    clock, other : str
    unsteady : bool
        Whether it is the less even one, by more than hardly matters.
    later : float
        s, median of the difference; 0 if not both are counted from the same epoch.
    spread, furthest : float
        s, of the difference about its median: from the 5 % to the 95 % quantile, and at most.
    """

    clock: str
    other: str
    unsteady: bool
    later: float
    spread: float
    furthest: float


def find_clock_drift(taken: Array, other: Array, names: tuple[str, str]) -> ClockDrift | None:
    """Compare the clock that is taken with the other one of the same messages.

    Jitter that is not in the messages themselves makes intervals uneven, so the more even clock is the better one. What
    matters less than half of an interval or 20 ms does not count, nor does being late by less than a minute, or early.

    Parameters
    ----------
    taken, other : ndarray, shape (n,)
        s; NaN or zero where a clock was not set.
    names : tuple of str
        Of the two clocks.

    Returns
    -------
    ClockDrift or None
        None if there is nothing to say, or if the other one was hardly ever set.
    """
    known = np.isfinite(taken) & np.isfinite(other) & (taken != 0.0) & (other != 0.0)
    taken, other = taken[known], other[known]
    if 2 * taken.size < known.size or taken.size < 3 or not np.ptp(other) > 0.0:
        return None
    difference = taken - other
    later = float(np.median(difference))
    difference -= later
    is_epoch = min(np.median(taken), np.median(other)) > _LEAST_EPOCH
    furthest = float(np.abs(difference).max())
    interval = float(np.median(np.abs(np.diff(other))))
    unsteady = furthest > min(_PART_OF_INTERVAL * interval, _LEAST) and _unevenness(taken) > _unevenness(other)
    if not unsteady and not (is_epoch and later > _LATER):
        return None
    low, high = np.quantile(difference, _QUANTILES)
    return ClockDrift(*names, unsteady, later if is_epoch else 0.0, float(high - low), furthest)


def _unevenness(time: Array) -> float:
    """Return the mean size, s, of what intervals differ from their median by."""
    intervals = np.diff(time)
    return float(np.abs(intervals - np.median(intervals)).mean())
