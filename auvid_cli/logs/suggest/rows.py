"""Columns of a log with units and times for a suggested map, and YAML with comments."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.log_columns import unit_factor
from auvid_cli.config.units import magnitude_of
from auvid_cli.logs.clock import FARTHEST, find_restarts, order_rows, slashed_date_formats, to_seconds
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, Log, LogColumn
from auvid_cli.logs.frames import euler_of_quaternion
from auvid_cli.logs.no_value import find_codes, has_rows_of_zeros, is_code, rows_of_zeros
from auvid_cli.logs.suggest.names import QUATERNION_NAMES, Match, TimeColumn, named_unit, time_columns
from auvid_cli.logs.suggest.relations import Track
from auvid_cli.text import printable
from auvid_cli.vehicle.parameters import SENSORS

_WORDS_OF_YAML = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")
_PLAIN = re.compile(r"[A-Za-z_/][\w./-]*", re.ASCII)
Flow: TypeAlias = "str | int | Mapping[str, Flow] | tuple[Flow, ...] | None"
Value: TypeAlias = "Flow | list[Line] | list[YamlEntry]"

_DAY = 86400.0  # s
# Counts of days: days from the epoch to 1970, usual numbers, and program.
_DAY_COUNTS = ((719529, (7.0e5, 7.7e5), "MATLAB"), (25569, (3.0e4, 6.0e4), "Excel"))
_MAX_DAY_STEP = 1e-3  # days between rows
_MIN_INCREASING = 0.8  # share of rows with a later time than the row before


class Phrase(str):
    """Text with blanks that is written without quotes, such as a number with its unit."""

    __slots__ = ()


class Comment(NamedTuple):
    """A line with a comment only."""

    text: str


class YamlEntry(NamedTuple):
    """A key, its value (a list of lines is written as a block of its own) and a comment after it."""

    key: str
    value: "Value"
    comment: str = ""


Line: TypeAlias = YamlEntry | Comment


def commented_text(lines: Iterable[Line]) -> str:
    """Return lines as the YAML text of a mapping."""
    return "".join(f"{printable(line)}\n" for line in _block(lines, ""))


def quoted(name: str) -> str:
    """Return a name in the quotes that YAML needs for it."""
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS_OF_YAML:
        return name
    if not name.isprintable():
        escaped = name.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{printable(escaped)}"'
    return "'" + name.replace("'", "''") + "'"


def _block(lines: Iterable[Line], indent: str) -> Iterator[str]:
    for line in lines:
        if isinstance(line, Comment):
            yield f"{indent}# {line.text}"
            continue
        comment = f" # {line.comment}" if line.comment else ""
        if isinstance(line.value, list):
            yield f"{indent}{line.key}:{comment}"
            yield from _block(line.value, f"{indent}  ")
        else:
            yield f"{indent}{line.key}: {_flow(line.value)}{comment}"


def _flow(value: Flow) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case int() | Phrase():
            return str(value)
        case str():
            return quoted(value)
        case tuple():
            return f"[{', '.join(map(_flow, value))}]"
    return f"{{{', '.join(f'{key}: {_flow(item)}' for key, item in value.items())}}}"


def row_entries(logs: Mapping[str, Log], name: str, table: str, delay: float = 0.0) -> Iterator[YamlEntry]:
    """Yield log, table and time of columns; `delay` is how late their times are, s."""
    if len(logs) > 1:
        yield YamlEntry("log", name)
    if table:
        yield YamlEntry("table", table)
    time, comment = time_of(logs[name], table)
    if delay and time is not None:
        time = dict(time) if isinstance(time, Mapping) else {"column": time}
        time["offset"] = Phrase(f"{-delay:.2f} s")
        direction = "later" if delay > 0.0 else "earlier"
        comment = f"check: its changes are {abs(delay):.2f} s {direction} than those of related signals"
    yield YamlEntry("time", time, comment)


def place_of(logs: Mapping[str, Log], name: str, table: str) -> dict[str, Flow] | None:
    """Return log, table and time of a single column in another table; None if that has no times."""
    time, _ = time_of(logs[name], table)
    if time is None:
        return None
    place: dict[str, Flow] = {"log": name} if len(logs) > 1 else {}
    return place | ({"table": table} if table else {}) | {"time": time}


class _Times(NamedTuple):
    """Times of a table by one column, and their entry in a map."""

    flow: dict[str, Flow]
    comment: str
    is_increasing: bool
    unevenness: float  # mean deviation of the intervals from their median, divided by it
    seconds: Array


def time_of(log: Log, table: str) -> tuple[Flow, str]:
    """Return the time of a table in the form of a map, and a comment; None if no column looks like times."""
    columns = log.tables()[table]
    candidates = time_columns(columns)
    names = [one.column.name for one in candidates]
    if HEADER_STAMP in names or LOG_TIME in names:
        name = names[0]
        if name == HEADER_STAMP and not np.unique(log.read(table, [HEADER_STAMP])[HEADER_STAMP]).size > 1:
            return LOG_TIME, "check: used because the header stamps never change"
        return name, "check: same clock as the other sensors?"
    times = _best_times(log, table)
    if times is None:
        some = ", ".join(column.name for column in columns[:8])
        return None, f"required: the column with the times, for example of {some}"
    flow, comment = times.flow, times.comment
    if starts := find_restarts(times.seconds).tolist():
        edges = [0, *starts, times.seconds.size]
        runs = ", ".join(f"{k + 1} (rows {edges[k] + 1} to {edges[k + 1]})" for k in range(len(edges) - 1))
        return flow | {"run": None}, f"required: the clock starts again; choose a run: {runs}"
    return flow, comment


def _best_times(log: Log, table: str) -> _Times | None:
    """Return the times of a table by the best of its columns: increasing, a stamp by its name, and even."""
    found = [times for one in time_columns(log.tables()[table]) if (times := _times_by(log, table, one)) is not None]
    stamps = [one.is_stamp for one in time_columns(log.tables()[table])]
    if not found:
        return None
    order = range(len(found))
    return found[min(order, key=lambda k: (not found[k].is_increasing, not (len(stamps) == len(found) and stamps[k])))]


def _times_by(log: Log, table: str, time: TimeColumn) -> _Times | None:
    """Return the times by one column; None if it has none."""
    column = time.column
    raw = log.read(table, [column.name])[column.name]
    flow: dict[str, Flow] = {"column": column.name}
    comment, date_format = "", None
    factor, offset = 1.0, 0.0
    if column.is_text:
        comment = "check: text, mm:ss.s, HH:MM:SS or dates"
        if formats := slashed_date_formats(np.asarray(raw, np.str_)):
            date_format = formats[0]
            flow["format"] = date_format if len(formats) == 1 else None
            comment = "check: format of the dates" if len(formats) == 1 else f"required: {' or '.join(formats)}"
    elif column.unit and _is_unit_of(column.unit, "s"):
        factor = unit_factor(column.unit, "s")
    elif time.nanoseconds is not None:
        flow["nanoseconds"] = time.nanoseconds.name
    else:
        unit, epoch, comment = _unit_of_time(np.asarray(raw, np.float64), column.unit)
        flow["unit"], factor = unit, unit_factor(unit, "s")
        if epoch:
            flow["offset"], offset = Phrase(f"-{epoch} day"), -epoch * _DAY
    try:
        seconds = to_seconds(raw, factor, date_format).seconds + offset
    except ValueError:
        # The import names the text that is not a time.
        return _Times(flow, comment, False, np.inf, np.empty(0)) if column.is_text else None
    if time.nanoseconds is not None:
        name = time.nanoseconds.name
        seconds = seconds + 1e-9 * np.asarray(log.read(table, [name])[name], np.float64)
    steps = np.diff(seconds[np.isfinite(seconds)])
    is_increasing = bool(steps.size) and float(np.mean(steps > 0.0)) > _MIN_INCREASING
    median = float(np.median(steps)) if steps.size else 0.0
    unevenness = float(np.mean(np.abs(steps - median))) / median if median > 0.0 else np.inf
    if steps.size and not is_increasing:
        comment = "; ".join(filter(None, (comment, "check: many rows share a time stamp, or it goes back")))
    return _Times(flow, comment, is_increasing, unevenness, seconds)


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


def _is_unit_of(unit: str, si: str) -> bool:
    try:
        unit_factor(unit, si)
    except ValueError:
        return False
    return True


class Found(NamedTuple):
    """Columns with the names of a sensor."""

    sensor: str
    log: str
    match: Match
    numbers: dict[str, Array]  # numbers of the log by component
    units: tuple[str, ...]  # possible units, the most probable first
    comment: str  # reason for the unit
    is_stated: bool  # whether the log or a name states the unit
    codes: tuple[float, ...] = ()  # numbers that mean a missing measurement; NaN in `numbers`
    marked: int = 0  # rows with such a number
    zeros: int = 0  # rows with zeros in all components, which mean the same; NaN in `numbers`

    @property
    def unit(self) -> str:
        """Return the most probable unit."""
        return self.units[0]

    def unit_entry(self) -> YamlEntry:
        """Return the unit in the form of a map; null if several are possible."""
        if len(self.units) == 1:
            return YamlEntry("unit", self.unit, self.comment)
        return YamlEntry("unit", None, f"required: {' or '.join(self.units)}; {self.comment}")

    @property
    def is_quaternion(self) -> bool:
        """Whether the columns are a quaternion."""
        return set(self.numbers) == set(QUATERNION_NAMES)

    def si(self) -> dict[str, Array]:
        """Return the components in SI, a quaternion as angles; implausible values are NaN."""
        if self.is_quaternion:
            angles = euler_of_quaternion(np.column_stack([self.numbers[axis] for axis in "wxyz"]))
            return dict(zip(("phi", "theta", "psi"), angles.T, strict=True))
        si = SENSORS[self.sensor][0].unit
        factor = unit_factor(self.unit, si)
        most = magnitude_of(si).largest / factor
        return {
            component: factor * np.where(np.abs(raw) <= most, raw, np.nan) for component, raw in self.numbers.items()
        }


def found_in(logs: Mapping[str, Log], sensor: str, name: str, match: Match) -> Found:
    """Read the columns of a sensor, in SI units if neither the log nor their names state a unit."""
    values = logs[name].read(match.table, [column.name for column in match.columns.values()])
    numbers = {component: np.asarray(values[column.name], np.float64) for component, column in match.columns.items()}
    si = SENSORS[sensor][0].unit
    stated, comment = _stated_unit(list(match.columns.values()), si)
    message = match.message
    unit = next((unit for unit in message.units if _is_unit_of(unit, si)), "") if message is not None else ""
    if message is not None and unit and not any(column.unit for column in match.columns.values()):
        stated, comment = unit, f"unit of this message of {message.source}"
    codes = find_codes(numbers)
    marked = np.any([is_code(own, codes) for own in numbers.values()], axis=0)
    zeros = rows_of_zeros(numbers) if has_rows_of_zeros(numbers) else np.zeros(marked.size, np.bool_)
    numbers = {key: np.where(is_code(own, codes) | zeros, np.nan, own) for key, own in numbers.items()}
    counts = int(np.count_nonzero(marked)), int(np.count_nonzero(zeros))
    return Found(sensor, name, match, numbers, (stated or si,), comment, bool(stated), codes, *counts)


def tracks_of(log: Log, table: str, signals: Mapping[str, Array]) -> dict[str, Track]:
    """Return signals with their times in s; empty if the table has no valid times."""
    flow, _ = time_of(log, table)
    if flow in (HEADER_STAMP, LOG_TIME):
        seconds = np.asarray(log.read(table, [str(flow)])[str(flow)], np.float64)
    elif (times := _best_times(log, table)) is not None and times.seconds.size:
        seconds = times.seconds
    else:
        return {}
    edges = [0, *find_restarts(seconds).tolist(), seconds.size]
    longest = int(np.argmax(np.diff(edges)))
    run = slice(edges[longest], edges[longest + 1])
    rows = np.arange(seconds.size)[run][order_rows(seconds[run]).rows]
    if rows.size < 2:
        return {}
    return {symbol: Track(seconds[rows], values[rows]) for symbol, values in signals.items()}


def _stated_unit(columns: Sequence[LogColumn], si: str) -> tuple[str, str]:
    """Return the unit that the log or the names of columns state, and the source; an empty unit without one."""
    units = {column.unit for column in columns}
    comment = ""
    if len(units) == 1 and (unit := units.pop()):
        try:
            unit_factor(unit, si)
        except ValueError:
            comment = f"the log states the unknown unit {unit!r}"
        else:
            return unit, "unit stated by the log"
    named = {named_unit(column.name, si) for column in columns}
    if len(named) == 1 and (unit := named.pop()):
        return unit, "check: unit by the name"
    return "", comment
