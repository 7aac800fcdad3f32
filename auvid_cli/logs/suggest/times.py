"""Times of the tables of logs for a suggested map: the best column, its unit, and the offset to a common clock."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.log_columns import factor_if_known, unit_factor
from auvid_cli.logs.clock import DAY, FARTHEST, HOUR, MIN_EPOCH, find_restarts, slashed_date_formats, to_seconds
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, ColumnValues, Log
from auvid_cli.logs.suggest.names import MAX_COLUMNS, TimeColumn, distinct_tables, time_columns
from auvid_cli.text import Flow, Phrase

# Counts of days: days from the epoch to 1970, usual numbers, and program.
_DAY_COUNTS = ((719529, (7.0e5, 7.7e5), "MATLAB"), (25569, (3.0e4, 6.0e4), "Excel"))
_MAX_DAY_STEP = 1e-3  # days between rows
_MIN_INCREASING = 0.8  # share of rows with a later time than the row before
_EVEN = 0.1  # unevenness of a clock that is even enough
_MIN_ROWS = 10  # of a table whose span counts for the common clock
_SENDER = re.compile(r"(?i)(.*\.)?(entity|sender|source|src_ent|frame_id|sensor(_?id)?|device(_?id)?|instance)")
_MAX_SENDERS = 8
_MIN_OVERLAP = 0.5  # share of a span that overlaps that of the common clock
_QUANTILES = (0.02, 0.98)  # of the times of a table, because a clock may be set late


class Times(NamedTuple):
    """Times of a table by one column, and their entry in a map."""

    flow: dict[str, Flow]
    comment: str
    is_increasing: bool
    unevenness: float  # mean deviation of the intervals from their median, divided by it
    seconds: Array
    period: float  # s, after which the clock starts again: of a clock without hours or dates; 0 if it never does
    is_stamp: bool  # whether the name says that it is the time of measurement

    @property
    def span(self) -> tuple[float, float]:
        """Return the begin and end of nearly all times, s."""
        low, high = np.quantile(self.seconds[np.isfinite(self.seconds)], _QUANTILES)
        return float(low), float(high)


def time_of(log: Log, table: str) -> tuple[Flow, str]:
    """Return the time of a table in the form of a map, and a comment; None if no column looks like times."""
    columns = log.tables()[table]
    name = message_clock(log, table)
    if name:
        word = "used because the header stamps never change" if name == LOG_TIME else "same clock as the other sensors?"
        is_only = HEADER_STAMP not in [column.name for column in columns]
        return name, "check: same clock as the other sensors?" if is_only else f"check: {word}"
    times = _best(log, table)
    if times is None:
        some = ", ".join(column.name for column in columns[:8])
        return None, f"required: the column with the times, for example of {some}"
    flow, comment = times.flow, times.comment
    if table in log.clock_offsets:
        offset, reason = log.clock_offsets[table]
        flow = flow | {"offset": None if np.isnan(offset) else Phrase(f"{offset:.10g} s")}
        comment = reason
    if starts := find_restarts(times.seconds).tolist():
        edges = [0, *starts, times.seconds.size]
        runs = ", ".join(f"{k + 1} (rows {edges[k] + 1} to {edges[k + 1]})" for k in range(len(edges) - 1))
        return flow | {"run": None}, f"required: the clock starts again; choose a run: {runs}"
    return flow, comment


def seconds_of(log: Log, table: str) -> Array:
    """Return the times of the rows of a table on the common clock, s; empty if it has none."""
    if name := message_clock(log, table):
        return np.asarray(log.read(table, [name])[name], np.float64)
    times = _best(log, table)
    if times is None:
        return np.empty(0)
    offset, _ = log.clock_offsets.get(table, (0.0, ""))
    return times.seconds if np.isnan(offset) else times.seconds + offset - _own_offset(times)


def one_sender(log: Log, table: str) -> tuple[str, str | float] | None:
    """Return a column and its value in the rows of one of several senders, that of most rows; None for one sender."""
    if table not in log.senders:
        log.senders[table] = None
        for column in log.tables()[table]:
            if _SENDER.fullmatch(column.name):
                senders = log.read(table, [column.name])[column.name]
                values, counts = np.unique(senders, return_counts=True)
                are_senders = 1 < values.size <= _MAX_SENDERS and counts.min() >= _MIN_ROWS
                if are_senders and _send_the_same(log, table, senders):
                    value = values[int(counts.argmax())]
                    log.senders[table] = column.name, str(value) if column.is_text else float(value)
                    break
    return log.senders[table]


def _send_the_same(log: Log, table: str, senders: ColumnValues) -> bool:
    """Whether all columns have numbers of each sender; otherwise the rows are those of different sensors."""
    names = [column.name for column in log.tables()[table] if not column.is_text]
    if len(names) > MAX_COLUMNS:
        return False
    numbers = log.read(table, names).values()
    return all(
        np.isfinite(np.asarray(values, np.float64)[senders == sender]).any()
        for values in numbers
        if np.isfinite(np.asarray(values, np.float64)).any()
        for sender in np.unique(senders)
    )


def rows_of_sender(log: Log, table: str) -> NDArray[np.bool_] | None:
    """Return the rows of the sender that a map takes; None if the table has only one."""
    sender = one_sender(log, table)
    return None if sender is None else log.read(table, [sender[0]])[sender[0]] == sender[1]


def message_clock(log: Log, table: str) -> str:
    """Return the clock of the messages of a log that has one; empty without one."""
    names = [column.name for column in log.tables()[table]]
    if HEADER_STAMP in names and np.unique(log.read(table, [HEADER_STAMP])[HEADER_STAMP]).size > 1:
        return HEADER_STAMP
    return LOG_TIME if LOG_TIME in names else ""


def align_clocks(logs: Mapping[str, Log]) -> None:
    """Set the clock of each table of several text logs: the column, and its offset to the clock of most rows.

    A clock without hours or dates is moved by whole periods. The offset of any other clock without a common time is
    NaN, because the logs do not show it.
    """
    found = {
        (name, table): candidates
        for name, log in logs.items()
        for table in distinct_tables(log.tables())
        if not message_clock(log, table) and (candidates := _candidates(log, table))
    }
    if len(found) < 2:
        return
    common = _common_span(found.values())
    for (name, table), candidates in found.items():
        # A column whose times overlap with those of the other logs.
        chosen = next((times for times in candidates if _overlap(times.span, common) > _MIN_OVERLAP), candidates[0])
        log = logs[name]
        log.clocks[table] = str(chosen.flow["column"])
        begin, end = chosen.span
        if _overlap((begin, end), common) > _MIN_OVERLAP:
            continue
        own = _own_offset(chosen)
        if chosen.period:
            moved = chosen.period * round((common[0] + common[1] - begin - end) / (2.0 * chosen.period))
            if _overlap((begin + moved, end + moved), common) > _MIN_OVERLAP:
                whole = "hours" if chosen.period == HOUR else "days"
                reason = f"check: a clock without {whole}; moved by whole {whole} to the times of the other logs"
                log.clock_offsets[table] = (own + moved, reason)
                continue
        first = min(t.seconds[0] for of in found.values() for t in of if _overlap(t.span, common) > _MIN_OVERLAP)
        together = f"{own + first - chosen.seconds[0]:.3f} s if it begins with the others"
        reason = f"required: this clock has no time in common with those of the other logs; {together}"
        log.clock_offsets[table] = (np.nan, reason)


def _common_span(found: Iterable[Sequence[Times]]) -> tuple[float, float]:
    """Return the span of the clock that most tables have: one of dates, or else of days, if there are several."""
    found = list(found)

    def rank(times: Times) -> tuple[int, float, bool, int]:
        sharing = sum(any(_overlap(other.span, times.span) > _MIN_OVERLAP for other in of) for of in found)
        return sharing, times.period or np.inf, times.span[0] > MIN_EPOCH, times.seconds.size

    best = max((times for of in found for times in of), key=rank)
    spans = [times.span for of in found for times in of if _overlap(times.span, best.span) > _MIN_OVERLAP]
    return min(span[0] for span in spans), max(span[1] for span in spans)


def _overlap(span: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the common part of two spans as a share of the shorter one."""
    shorter = min(span[1] - span[0], other[1] - other[0])
    common = min(span[1], other[1]) - max(span[0], other[0])
    return common / shorter if shorter > 0.0 else float(common >= 0.0)


def _own_offset(times: Times) -> float:
    """Return the offset that the map already adds to the times of a column, s."""
    offset = times.flow.get("offset")
    return float(str(offset).removesuffix(" day")) * DAY if offset is not None else 0.0


def _candidates(log: Log, table: str) -> list[Times]:
    """Return the usable times of a table, the best first."""
    found = [times for one in time_columns(log.tables()[table]) if (times := _times_by(log, table, one)) is not None]
    usable = [times for times in found if times.is_increasing and times.seconds.size >= _MIN_ROWS]
    return sorted(usable, key=_rank)


def _best(log: Log, table: str) -> Times | None:
    """Return the times of a table by the best of its columns: the chosen one, else increasing, a stamp, and even."""
    found = [times for one in time_columns(log.tables()[table]) if (times := _times_by(log, table, one)) is not None]
    chosen = log.clocks.get(table)
    return min(found, key=lambda times: (times.flow["column"] != chosen, *_rank(times)), default=None)


def _rank(times: Times) -> tuple[bool, bool, bool]:
    # Names decide between clocks that are about even.
    return not times.is_increasing, not times.is_stamp, times.unevenness > _EVEN


def _times_by(log: Log, table: str, time: TimeColumn) -> Times | None:
    """Return the times by one column; None if it has none."""
    column = time.column
    raw, chosen = log.read(table, [column.name])[column.name], rows_of_sender(log, table)
    flow: dict[str, Flow] = {"column": column.name}
    comment, date_format = "", None
    factor, offset = 1.0, 0.0
    if column.is_text:
        comment = "check: text, mm:ss.s, HH:MM:SS or dates"
        if formats := slashed_date_formats(np.asarray(raw, np.str_)):
            date_format = formats[0]
            flow["format"] = date_format if len(formats) == 1 else None
            comment = "check: format of the dates" if len(formats) == 1 else f"required: {' or '.join(formats)}"
    elif column.unit and (size := factor_if_known(column.unit, "s")) is not None:
        factor = size
    elif time.nanoseconds is not None:
        flow["nanoseconds"] = time.nanoseconds.name
    else:
        numbers = np.asarray(raw, np.float64)
        unit, epoch, comment = _unit_of_time(numbers if chosen is None else numbers[chosen], column.unit)
        flow["unit"], factor = unit, unit_factor(unit, "s")
        if epoch:
            flow["offset"], offset = Phrase(f"-{epoch} day"), -epoch * DAY
    try:
        clock = to_seconds(raw, factor, date_format)
    except ValueError as error:
        # The import names the text that is not a time.
        words = f"check: {error}"
        return Times(flow, words, False, np.inf, np.empty(0), 0.0, time.is_stamp) if column.is_text else None
    seconds = clock.seconds + offset
    if time.nanoseconds is not None:
        name = time.nanoseconds.name
        seconds = seconds + 1e-9 * np.asarray(log.read(table, [name])[name], np.float64)
    steps = np.diff(seconds[np.isfinite(seconds) & (True if chosen is None else chosen)])
    is_increasing = bool(steps.size) and float(np.mean(steps > 0.0)) > _MIN_INCREASING
    median = float(np.median(steps)) if steps.size else 0.0
    unevenness = float(np.mean(np.abs(steps - median))) / median if median > 0.0 else np.inf
    if steps.size and not is_increasing:
        comment = "; ".join(filter(None, (comment, "check: many rows share a time stamp, or it goes back")))
    return Times(flow, comment, is_increasing, unevenness, seconds, clock.period, time.is_stamp)


def _unit_of_time(numbers: Array, stated: str) -> tuple[str, int, str]:
    """Return the unit of times, the days from its epoch to 1970 (0 if not counted in days), and a comment."""
    known = numbers[np.abs(numbers) < FARTHEST]
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    middle = float(np.median(known)) if known.size else 0.0
    for epoch, (low, high), program in _DAY_COUNTS:
        if low < middle < high and step < _MAX_DAY_STEP:
            return "day", epoch, f"check: days by the count of {program}, from 1970"
    unit = "s" if step < 50.0 else "ms" if step < 5e3 else "us" if step < 5e6 else "ns"
    words = f"the log states the unit {stated!r}; " if stated else ""
    return unit, 0, f"check: {words}unit by the median step of {step:.4g}"
