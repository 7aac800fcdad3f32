"""Clocks of a log: time stamps to seconds, and drift between clocks."""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import ColumnValues

HOUR = 3600.0  # s
DAY = 86400.0  # s
# A leap second is the second 60.
_CLOCK = re.compile(r"\s*(?:(\d{1,2}):)?([0-5]?\d):((?:[0-5]?\d|60)(?:\.\d*)?)\s*", re.ASCII)
_MAX_DATE = 9.2e9  # s since 1970 that fit into nanoseconds: the years 1679 to 2261
_DATE = re.compile(r"\s*\d{4}-\d{2}-\d{2}")
_GERMAN_DATE = re.compile(r"\s*\d{1,2}\.\d{1,2}\.\d{4} ")
_SLASHED_DATE = re.compile(r"\s*(\d{1,2})/(\d{1,2})/\d{4} ")
_FRACTION = re.compile(r"(?<=:\d\d),(?=\d)")  # decimal comma of seconds
_RESTART = 1.0  # s; a clock that falls by more, and goes on from there, was restarted
_CHUNK = 100_000  # dates converted at a time
FARTHEST = 1e20  # more than any time stamp; nanoseconds since 1970 are about 2e18
# A smaller variation of the difference between clocks is ignored.
_MIN_INTERVAL_SHARE = 0.5  # share of the median interval
_MIN_VARIATION = 0.02  # s
_QUANTILES = (0.05, 0.95)
_PLAYBACK_DELAY = 60.0  # s by which a log is later than its messages if it was played back
MIN_EPOCH = 1e8  # s; smaller times do not count from 1970


class Clock(NamedTuple):
    """Times in s (NaN if missing), and the rollovers of a clock without hours or date."""

    seconds: Array
    rollovers: int = 0
    period: float = 0.0  # s, after which it starts again; 0 for numbers and dates


class Order(NamedTuple):
    """Rows in the order of their times, and the numbers of disordered rows."""

    rows: NDArray[np.int64] | slice  # rows that are kept
    without_time: int = 0  # rows without a time
    backward: int = 0  # rows with an earlier time than the row before
    furthest_back: float = 0.0  # largest backward step, s
    duplicates: int = 0  # rows with the time of another row


def to_seconds(values: ColumnValues, factor: float, date_format: str | None = None) -> Clock:
    """Convert a time column to seconds.

    Parameters
    ----------
    values : ndarray
        Numbers, or text: ``mm:ss.s``, ``HH:MM:SS.s``, ``dd.mm.yyyy HH:MM:SS``, or ISO 8601 dates with times (UTC
        without a zone). The seconds may have a decimal point or comma.
    factor : float
        s per unit of numbers.
    date_format : str, optional
        Format of other dates, in the codes of `datetime.strptime`.

    Raises
    ------
    ValueError
        If a text is not a time.
    """
    if values.dtype.kind != "U":
        numbers = np.asarray(values, np.float64)
        if (np.abs(numbers) >= FARTHEST).any():
            numbers = np.where(np.abs(numbers) < FARTHEST, numbers, np.nan)
        return Clock(numbers if factor == 1.0 else numbers * factor)
    first = str(next((text for text in values if text.strip()), ""))
    if "," in first:
        values = np.array([_FRACTION.sub(".", text) for text in values], np.str_)
        first = _FRACTION.sub(".", first)
    if date_format is not None:
        return Clock(_dates(values, date_format.replace("%S,%f", "%S.%f")))
    if _DATE.match(first):
        return Clock(_dates(values, "ISO8601"))
    if _GERMAN_DATE.match(first):
        return Clock(_dates(values, f"%d.%m.%Y %H:%M:%S{'.%f' if '.' in first.partition(':')[2] else ''}"))
    if _SLASHED_DATE.match(first):
        raise ValueError(f"{first!r} may have the day or the month first; state the `format` of the time")
    clock = _CLOCK.fullmatch(first)
    if clock is None:
        raise ValueError(
            f"{first!r} is not a time: expected a number, mm:ss.s, HH:MM:SS.s or a date such as 2025-04-04T22:23:02Z"
        )
    period = DAY if clock[1] else HOUR
    return _unwrapped(np.fromiter((_clock_seconds(text) for text in values), np.float64, values.size), period)


def slashed_date_formats(values: ColumnValues) -> tuple[str, ...]:
    """Return the formats that dates with slashes may have; empty for other texts."""
    texts = [_FRACTION.sub(".", text) for text in values if text.strip()]
    dates = [_SLASHED_DATE.match(text) for text in texts]
    if not texts or not all(dates):
        return ()
    largest = [max(int(date[k]) for date in dates if date is not None) for k in (1, 2)]
    seconds = "%H:%M:%S" + (".%f" if "." in texts[0] else "")
    formats = (f"%d/%m/%Y {seconds}", f"%m/%d/%Y {seconds}")
    return tuple(text for text, size in zip(formats, reversed(largest), strict=True) if size <= 12)


def find_restarts(seconds: Array) -> NDArray[np.int64]:
    """Return the rows at which a clock starts again: it falls by more than 1 s, and goes on from there."""
    timed = np.flatnonzero(np.isfinite(seconds))
    time = seconds[timed]
    falls = np.flatnonzero(np.diff(time) < -_RESTART)
    # A single late row is followed by a row that is not late.
    return timed[[k + 1 for k in falls if k + 2 < time.size and time[k + 2] < time[k]]].astype(np.int64)


def order_rows(seconds: Array) -> Order:
    """Return the order in which times increase strictly; the first of several rows at one time is kept."""
    timed = np.isfinite(seconds)
    without_time = int(seconds.size - np.count_nonzero(timed))
    steps = np.diff(seconds[timed] if without_time else seconds)
    backward = int(np.count_nonzero(steps < 0.0))
    if not without_time and (steps > 0.0).all():
        return Order(slice(None))
    furthest_back = -float(min(steps.min(initial=0.0), 0.0))
    rows = np.flatnonzero(timed)
    rows = rows[np.argsort(seconds[rows], kind="stable")]
    is_new = np.diff(seconds[rows], prepend=-np.inf) > 0.0
    return Order(rows[is_new], without_time, backward, furthest_back, int(np.count_nonzero(~is_new)))


def _clock_seconds(text: str) -> float:
    if not text.strip():
        return np.nan
    match = _CLOCK.fullmatch(text)
    if match is None:
        raise ValueError(f"{str(text)!r} is not a time; expected the form of the rows before it")
    hours, minutes, seconds = match.groups()
    return 3600.0 * float(hours or 0.0) + 60.0 * float(minutes) + float(seconds)


def _unwrapped(seconds: Array, period: float) -> Clock:
    """Add a period after each rollover, at which the clock falls by more than half of its period."""
    timed = np.flatnonzero(np.isfinite(seconds))
    rollovers = np.cumsum(np.diff(seconds[timed], prepend=seconds[timed[:1]]) < -0.5 * period)
    unwrapped = seconds.copy()
    unwrapped[timed] += period * rollovers
    return Clock(unwrapped, int(rollovers[-1]) if rollovers.size else 0, period)


def _dates(values: ColumnValues, date_format: str) -> Array:
    import pandas as pd

    seconds = np.empty(values.size)
    for begin in range(0, values.size, _CHUNK):
        part = pd.Series(values[begin : begin + _CHUNK]).str.strip()
        dates = pd.to_datetime(part.where(part != "", None), utc=True, format=date_format, errors="coerce")
        if (wrong := part[dates.isna() & (part != "")]).size:
            form = "such as 2025-04-04T22:23:02Z" if date_format == "ISO8601" else f"of the form {date_format}"
            raise ValueError(f"{str(wrong.iloc[0])!r} is not a date {form}, from 1679 to 2261")
        dates = dates.dt.tz_localize(None).to_numpy()
        # A conversion to nanoseconds wraps without a warning.
        far = np.abs(dates.astype("datetime64[s]").astype(np.int64)) > _MAX_DATE
        if (far & ~np.isnat(dates)).any():
            raise ValueError(f"{str(part[far & ~np.isnat(dates)].iloc[0])!r} is not a date from 1679 to 2261")
        nanoseconds = dates.astype("datetime64[ns]")
        seconds[begin : begin + _CHUNK] = np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype(np.int64) * 1e-9)
    return seconds


class ClockDrift(NamedTuple):
    """Difference between two clocks of the same messages."""

    clock: str
    other: str
    unsteady: bool  # whether `clock` has the less even intervals
    later: float  # median of the difference, s; 0 if the epochs differ
    spread: float  # difference between the clocks: 95 % quantile minus 5 % quantile, s
    furthest: float  # largest deviation of the difference from its median, s


def find_clock_drift(taken: Array, other: Array, names: tuple[str, str]) -> ClockDrift | None:
    """Compare two clocks of the same messages, s, shape (n,); NaN or 0 if a clock was not set.

    Transmission adds jitter to the intervals, so the clock with more even intervals is better.

    Returns
    -------
    ClockDrift or None
        None if the first clock is even enough and not late, or if the other one was hardly ever set.
    """
    is_set = np.isfinite(taken) & np.isfinite(other) & (taken != 0.0) & (other != 0.0)
    taken, other = taken[is_set], other[is_set]
    if 2 * taken.size < is_set.size or taken.size < 3 or not np.ptp(other) > 0.0:
        return None
    difference = taken - other
    later = float(np.median(difference))
    difference -= later
    is_epoch = min(np.median(taken), np.median(other)) > MIN_EPOCH
    furthest = float(np.abs(difference).max())
    interval = float(np.median(np.abs(np.diff(other))))
    is_less_even = _unevenness(taken) > _unevenness(other)
    unsteady = is_less_even and furthest > min(_MIN_INTERVAL_SHARE * interval, _MIN_VARIATION)
    if not unsteady and not (is_epoch and later > _PLAYBACK_DELAY):
        return None
    low, high = np.quantile(difference, _QUANTILES)
    return ClockDrift(*names, unsteady, later if is_epoch else 0.0, float(high - low), furthest)


def _unevenness(time: Array) -> float:
    """Return the mean deviation of intervals from their median, s."""
    intervals = np.diff(time)
    return float(np.abs(intervals - np.median(intervals)).mean())
