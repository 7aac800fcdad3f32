"""Columns of a log with units and times for a suggested map, and YAML with comments."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.log_columns import unit_factor
from auvid_cli.config.units import magnitude_of
from auvid_cli.logs.clock import FARTHEST, order_rows, to_seconds
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, Log, LogColumn
from auvid_cli.logs.frames import euler_of_quaternion
from auvid_cli.logs.suggest.names import QUATERNION_NAMES, Match, find_time, named_unit
from auvid_cli.logs.suggest.relations import Track
from auvid_cli.text import printable
from auvid_cli.vehicle.parameters import SENSORS

_WORDS_OF_YAML = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")
_PLAIN = re.compile(r"[A-Za-z_/][\w./-]*", re.ASCII)
Flow: TypeAlias = "str | int | Mapping[str, Flow] | tuple[Flow, ...] | None"
Value: TypeAlias = "Flow | list[Line] | list[YamlEntry]"
# For each SI unit: 99 % quantile above which another unit is more probable, the largest first.
_OTHER_UNITS: dict[str, tuple[tuple[float, str], ...]] = {
    "rad": ((2.0 * np.pi, "deg"),),
    "rad/s": ((3.0, "deg/s"),),
    "m/s": ((200.0, "mm/s"), (20.0, "cm/s")),
    "m/s^2": ((3000.0, "mm/s^2"), (300.0, "cm/s^2")),
}
_ONE_G = (0.8, 1.2)  # range of a mean vertical specific force that is probably in g


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


def time_of(log: Log, table: str) -> tuple[Flow, str]:
    """Return the time of a table in the form of a map, and a comment; None if no column looks like times."""
    columns = log.tables()[table]
    time = find_time(columns)
    if time is None:
        some = ", ".join(column.name for column in columns[:8])
        return None, f"required: the column with the times, for example of {some}"
    if time.name == HEADER_STAMP and not np.unique(log.read(table, [HEADER_STAMP])[HEADER_STAMP]).size > 1:
        return LOG_TIME, "check: used because the header stamps never change"
    if time.name in (HEADER_STAMP, LOG_TIME):
        return time.name, "check: same clock as the other sensors?"
    if time.is_text or (time.unit and _is_unit_of(time.unit, "s")):
        return {"column": time.name}, "check: text, mm:ss.s, HH:MM:SS or dates" if time.is_text else ""
    numbers = np.asarray(log.read(table, [time.name])[time.name], np.float64)
    steps = np.diff(numbers[np.abs(numbers) < FARTHEST])
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    unit = "s" if step < 50.0 else "ms" if step < 5e3 else "us" if step < 5e6 else "ns"
    stated = f"the log states the unit {time.unit!r}; " if time.unit else ""
    return {"column": time.name, "unit": unit}, f"check: {stated}unit by the median step of {step:.4g}"


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
    unit: str
    comment: str  # reason for the unit
    is_stated: bool  # whether the log or a name states the unit; otherwise it is guessed

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
    """Read the columns of a sensor and determine their unit."""
    values = logs[name].read(match.table, [column.name for column in match.columns.values()])
    numbers = {component: np.asarray(values[column.name], np.float64) for component, column in match.columns.items()}
    si = SENSORS[sensor][0].unit
    message = match.message
    unit = next((unit for unit in message.units if _is_unit_of(unit, si)), "") if message is not None else ""
    if message is not None and unit and not any(column.unit for column in match.columns.values()):
        return Found(sensor, name, match, numbers, unit, f"unit of this message of {message.source}", True)
    return Found(sensor, name, match, numbers, *_unit(list(match.columns.values()), numbers, si))


def tracks_of(log: Log, table: str, signals: Mapping[str, Array]) -> dict[str, Track]:
    """Return signals with their times in s; empty if the table has no valid times."""
    flow, _ = time_of(log, table)
    if flow is None:
        return {}
    name, unit = (flow["column"], flow.get("unit")) if isinstance(flow, Mapping) else (flow, None)
    column = next(column for column in log.tables()[table] if column.name == name)
    try:
        seconds = to_seconds(
            log.read(table, [column.name])[column.name], unit_factor(str(unit or column.unit or "s"), "s")
        )
    except ValueError:
        return {}
    order = order_rows(seconds.seconds)
    time = seconds.seconds[order.rows]
    return {symbol: Track(time, values[order.rows]) for symbol, values in signals.items()} if time.size > 1 else {}


def _unit(columns: Sequence[LogColumn], numbers: Mapping[str, Array], si: str) -> tuple[str, str, bool]:
    """Return the unit of columns, the reason for it, and whether it is stated."""
    units = {column.unit for column in columns}
    if len(units) == 1 and (unit := units.pop()):
        try:
            unit_factor(unit, si)
        except ValueError:
            return si, f"check: the log states the unknown unit {unit!r}", False
        return unit, "unit stated by the log", True
    largest = max(float(np.nanmax(np.abs(values), initial=0.0)) for values in numbers.values())
    named = {named_unit(column.name, si) for column in columns}
    if len(named) == 1 and (unit := named.pop()):
        return unit, f"unit by the name; check: values reach {largest:.4g}", True
    known = np.concatenate([np.abs(values[np.isfinite(values)]) for values in numbers.values()])
    usual = float(np.quantile(known, 0.99)) if known.size else 0.0
    size = largest if si.startswith("rad") else usual
    unit = next((unit for least, unit in _OTHER_UNITS.get(si, ()) if size > least), si)
    if si == "m/s^2" and "fz" in numbers and _ONE_G[0] < abs(float(np.nanmean(numbers["fz"]))) < _ONE_G[1]:
        unit = "g"
    return unit, f"check: unit guessed, because values reach {largest:.4g}", False
