"""The part of a suggested map that says what fins and propeller did."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.formats.log import Column, Log
from auvid_cli.logs.suggest.names import INPUT_NAMES, find_columns, find_in_logs, named_unit
from auvid_cli.logs.suggest.rows import quoted, row_lines, time_of

Array = NDArray[np.float64]

_LARGEST_FIN_DEGREES, _LARGEST_PERCENT, _LARGEST_FRACTION = 90.0, 110.0, 1.5
# Pulses of a servo, in microseconds, and the numbers of a byte: their middles.
_PULSES, _MIDDLE_PULSE, _MIDDLE_BYTE = (800.0, 2200.0), 1500, 128
_OPPOSITE = (("top", "bottom"), ("right", "left"))


class _Input(NamedTuple):
    """A column that looks like an input, its numbers, and where it stands if that is not where most of them do."""

    column: Column
    values: Array
    place: str

    @property
    def largest(self) -> float:
        """Largest size."""
        return float(np.nanmax(np.abs(self.values), initial=0.0))

    def signal(self, *more: str) -> str:
        """Write a flow mapping of place, column and what else it needs."""
        return f"{{{', '.join((f'{self.place}column: {quoted(self.column.name)}', *more))}}}"


def input_lines(logs: Mapping[str, Log]) -> Iterator[str]:
    """Yield the lines below `inputs:`."""
    place = find_in_logs(logs, INPUT_NAMES)
    if place is None:
        yield "  rudder: null # required: no column looks like a fin or a propeller"
        return
    name, main = place
    yield from row_lines(logs, name, main.table, "  ")
    found = _inputs(logs, name, main.table)
    direct = {key: own for key, own in found.items() if "." not in key}
    fins = {key.removeprefix("fins."): own for key, own in found.items() if key.startswith("fins.")}
    if fins and ("rudder" in direct or "elevator" in direct):
        fins = {}
    deflecting = {**fins, **{key: own for key, own in direct.items() if key in ("rudder", "elevator")}}
    largest = max((own.largest for own in deflecting.values()), default=0.0)
    for key, own in direct.items():
        yield (
            f"  {key}: {own.signal()} # check: in N, or N m"
            if key not in deflecting
            else _fin(f"  {key}", own, largest)
        )
    if fins:
        yield "  fins: # check: positive pushes the tail to starboard, or up; else sign: -1"
        yield from (_fin(f"    {key}", own, largest) for key, own in fins.items())
    for one, other in _OPPOSITE:
        if {one, other} <= set(fins) and _are_opposite(fins[one].values, fins[other].values):
            yield f"    # check: {one} and {other} go against each other, so one of them counts the other way: sign: -1"
    if not deflecting:
        others = [column.name for column in logs[name].tables()[main.table] if "fin" in column.name.lower()]
        others += [
            f"{table} {c.name}"
            for log in logs.values()
            for table in log.tables()
            if "fin" in table.lower()
            for c in log.tables()[table]
            if c.name.startswith("data")
        ]
        yield f"  # check: no column is called like a fin{'; these may be fins: ' if others else ''}{', '.join(others)}"
    yield from _thrust(found)


def _inputs(logs: Mapping[str, Log], name: str, main: str) -> dict[str, _Input]:
    """Find inputs by their keys: those of the table that has most of them, then what others have besides."""
    places = [(name, found) for found in find_columns(INPUT_NAMES, {main: logs[name].tables()[main]})]
    places += [(log, found) for log in logs for found in find_columns(INPUT_NAMES, logs[log].tables())]
    inputs: dict[str, _Input] = {}
    for log, (table, columns) in places:
        new = {key: column for key, column in columns.items() if key not in inputs}
        place = "" if (log, table) == (name, main) else _place(logs, log, table)
        if new and place is not None:
            read = logs[log].read(table, [column.name for column in new.values()])
            numbers = {key: np.asarray(read[column.name], np.float64) for key, column in new.items()}
            inputs |= {key: _Input(new[key], own, place) for key, own in numbers.items() if _counts(own, bool(place))}
    return inputs


def _counts(values: Array, must_change: bool) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size) and (not must_change or bool(np.ptp(known) > 0.0))


def _place(logs: Mapping[str, Log], log: str, table: str) -> str | None:
    """Return the place of a column that stands elsewhere; None if nothing there looks like times."""
    time, _ = time_of(logs[log], table)
    where = (f"log: {log}, " if len(logs) > 1 else "", f"table: {quoted(table)}, " if table else "")
    return None if time == "null" else f"{''.join(where)}time: {time}, "


def _are_opposite(one: Array, other: Array) -> bool:
    if one.size != other.size:
        return False
    return float(np.nanstd(one + other)) < 0.5 * float(np.nanstd(one - other))


def _thrust(found: Mapping[str, _Input]) -> Iterator[str]:
    if "surge_force" in found:
        return
    if "thrust.revolutions" in found:
        yield "  thrust:"
        yield f"    revolutions: {_revolutions(found['thrust.revolutions'])}"
        yield "    a: null # required: force = a n|n|, such as 0.05 N*s^2"
    elif "thrust.share" in found:
        own = found["thrust.share"]
        yield "  thrust:"
        signal, reached = own.signal(*_share_unit(own)), f"it reaches {own.largest:.4g}"
        yield f"    share: {signal} # check: percent, or '1' for fractions; {reached}"
        yield "    full: null # required: force at 100 percent, such as 20 N"
    else:
        yield "  # check: no column looks like thrust: it will be zero"


def _revolutions(own: _Input) -> str:
    if own.column.unit:
        return f"{own.signal()} # {own.column.unit} as the log says"
    unit = named_unit(own.column.name, "turn/s") or "rpm"
    return f"{own.signal(f'unit: {unit}')} # check: rpm, or turn/s"


def _share_unit(own: _Input) -> tuple[str, ...]:
    if own.column.unit:
        return ()
    if own.largest > _LARGEST_PERCENT:
        centre = _middle(own.values)
        return f"centre: {centre}", f"scale: {'0.25' if centre == _MIDDLE_PULSE else '0.787'} percent"
    is_fraction = 0.0 < own.largest <= _LARGEST_FRACTION and not named_unit(own.column.name, "percent")
    return ("unit: '1'" if is_fraction else "unit: percent",)


def _fin(key: str, own: _Input, largest: float) -> str:
    spread = f"it goes from {np.nanmin(own.values):.4g} to {np.nanmax(own.values):.4g}"
    if own.column.unit:
        return f"{key}: {own.signal()} # {own.column.unit} as the log says; check: sign"
    if unit := named_unit(own.column.name, "rad"):
        return f"{key}: {own.signal(f'unit: {unit}')} # as the name says; check: sign; {spread}"
    if largest > _LARGEST_FIN_DEGREES:
        counts = own.signal(f"centre: {_middle(own.values)}", "scale: null")
        return f"{key}: {counts} # required: what is straight, and one count, such as 0.35 deg; {spread}"
    unit = "deg" if largest > 0.5 * np.pi else "rad"
    return f"{key}: {own.signal(f'unit: {unit}')} # check: unit and sign; {spread}"


def _middle(counts: Array) -> int:
    """Guess the count that means zero."""
    low, high = _PULSES
    return _MIDDLE_PULSE if np.nanmin(counts) >= low and np.nanmax(counts) <= high else _MIDDLE_BYTE
