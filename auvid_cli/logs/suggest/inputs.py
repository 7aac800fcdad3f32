"""The part of a suggested map that says what fins and propeller did."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest.commented_yaml import Comment, Flow, Line, Phrase, YamlEntry
from auvid_cli.logs.suggest.names import INPUT_NAMES, find_columns, find_in_logs, named_unit
from auvid_cli.logs.suggest.rows import row_entries, time_of

Array = NDArray[np.float64]

_LARGEST_FIN_DEGREES, _LARGEST_PERCENT, _LARGEST_FRACTION = 90.0, 110.0, 1.5
# Pulses of a servo, in microseconds, and the numbers of a byte: their middles.
_PULSES, _MIDDLE_PULSE, _MIDDLE_BYTE = (800.0, 2200.0), 1500, 128
_OPPOSITE = (("top", "bottom"), ("right", "left"))


class _Input(NamedTuple):
    """A column that looks like an input, its numbers, and where it stands if that is not where most of them do."""

    column: LogColumn
    values: Array
    place: dict[str, Flow]

    @property
    def largest(self) -> float:
        """Return the largest size."""
        return float(np.nanmax(np.abs(self.values), initial=0.0))

    def signal(self, **more: Flow) -> dict[str, Flow]:
        """Return place, column and what else it needs."""
        return {**self.place, "column": self.column.name, **more}


def input_lines(logs: Mapping[str, Log]) -> Iterator[Line]:
    """Yield the lines below `inputs:`."""
    place = find_in_logs(logs, INPUT_NAMES)
    if place is None:
        yield YamlEntry("rudder", None, "required: no column looks like a fin or a propeller")
        return
    name, main = place
    yield from row_entries(logs, name, main.table)
    inputs = _inputs(logs, name, main.table)
    direct = {key: signal for key, signal in inputs.items() if "." not in key}
    fins = {key.removeprefix("fins."): signal for key, signal in inputs.items() if key.startswith("fins.")}
    if fins and ("rudder" in direct or "elevator" in direct):
        fins = {}
    deflecting = {**fins, **{key: direct[key] for key in ("rudder", "elevator") if key in direct}}
    largest = max((fin.largest for fin in deflecting.values()), default=0.0)
    for key, signal in direct.items():
        yield (
            _fin(key, signal, largest) if key in deflecting else YamlEntry(key, signal.signal(), "check: in N, or N m")
        )
    if fins:
        lines: list[Line] = [_fin(key, fin, largest) for key, fin in fins.items()]
        lines += _opposites(fins)
        yield YamlEntry("fins", lines, "check: positive pushes the tail to starboard, or up; else sign: -1")
    if not deflecting:
        candidates = ", ".join(_possible_fins(logs, name, main.table))
        these = f"; these may be fins: {candidates}" if candidates else ""
        yield Comment(f"check: no column is called like a fin{these}")
    yield from _thrust(inputs)


def _opposites(fins: Mapping[str, _Input]) -> Iterator[Comment]:
    for first, second in _OPPOSITE:
        if {first, second} <= set(fins) and _are_opposite(fins[first].values, fins[second].values):
            why = f"{first} and {second} go against each other, so one of them counts the other way"
            yield Comment(f"check: {why}: sign: -1")


def _possible_fins(logs: Mapping[str, Log], name: str, main: str) -> Iterator[str]:
    """Yield columns of the table with the inputs, and tables of numbers, that have a fin in their names."""
    yield from (column.name for column in logs[name].tables()[main] if "fin" in column.name.lower())
    for log in logs.values():
        for table, columns in log.tables().items():
            if "fin" in table.lower():
                yield from (f"{table} {column.name}" for column in columns if column.name.startswith("data"))


def _inputs(logs: Mapping[str, Log], name: str, main: str) -> dict[str, _Input]:
    """Find inputs by their keys: those of the table that has most of them, then what others have besides."""
    places = [(name, columns) for columns in find_columns(INPUT_NAMES, {main: logs[name].tables()[main]})]
    places += [(log, columns) for log in logs for columns in find_columns(INPUT_NAMES, logs[log].tables())]
    inputs: dict[str, _Input] = {}
    for log, (table, columns) in places:
        new = {key: column for key, column in columns.items() if key not in inputs}
        elsewhere = (log, table) != (name, main)
        place = _place(logs, log, table) if elsewhere else {}
        if new and place is not None:
            read = logs[log].read(table, [column.name for column in new.values()])
            numbers = {key: np.asarray(read[column.name], np.float64) for key, column in new.items()}
            inputs |= {
                key: _Input(new[key], values, place) for key, values in numbers.items() if _counts(values, elsewhere)
            }
    return inputs


def _counts(values: Array, must_change: bool) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size) and (not must_change or bool(np.ptp(known) > 0.0))


def _place(logs: Mapping[str, Log], log: str, table: str) -> dict[str, Flow] | None:
    """Return the place of a column that stands elsewhere; None if nothing there looks like times."""
    time, _ = time_of(logs[log], table)
    if time is None:
        return None
    place: dict[str, Flow] = {"log": log} if len(logs) > 1 else {}
    return place | ({"table": table} if table else {}) | {"time": time}


def _are_opposite(first: Array, second: Array) -> bool:
    if first.size != second.size:
        return False
    return float(np.nanstd(first + second)) < 0.5 * float(np.nanstd(first - second))


def _thrust(inputs: Mapping[str, _Input]) -> Iterator[Line]:
    if "surge_force" in inputs:
        return
    if "thrust.revolutions" in inputs:
        factor = YamlEntry("a", None, "required: force = a n|n|, such as 0.05 N*s^2")
        yield YamlEntry("thrust", [_revolutions(inputs["thrust.revolutions"]), factor])
    elif "thrust.share" in inputs:
        full = YamlEntry("full", None, "required: force at 100 percent, such as 20 N")
        yield YamlEntry("thrust", [_share(inputs["thrust.share"]), full])
    else:
        yield Comment("check: no column looks like thrust: it will be zero")


def _revolutions(command: _Input) -> YamlEntry:
    if command.column.unit:
        return YamlEntry("revolutions", command.signal(), f"{command.column.unit} as the log says")
    unit = named_unit(command.column.name, "turn/s") or "rpm"
    return YamlEntry("revolutions", command.signal(unit=unit), "check: rpm, or turn/s")


def _share(command: _Input) -> YamlEntry:
    comment = f"check: percent, or '1' for fractions; it reaches {command.largest:.4g}"
    return YamlEntry("share", command.signal(**_share_unit(command)), comment)


def _share_unit(command: _Input) -> dict[str, Flow]:
    if command.column.unit:
        return {}
    if command.largest > _LARGEST_PERCENT:
        centre = _middle(command.values)
        return {"centre": centre, "scale": Phrase("0.25 percent" if centre == _MIDDLE_PULSE else "0.787 percent")}
    is_fraction = 0.0 < command.largest <= _LARGEST_FRACTION and not named_unit(command.column.name, "percent")
    return {"unit": "1" if is_fraction else "percent"}


def _fin(key: str, fin: _Input, largest: float) -> YamlEntry:
    extent = f"it goes from {np.nanmin(fin.values):.4g} to {np.nanmax(fin.values):.4g}"
    if fin.column.unit:
        return YamlEntry(key, fin.signal(), f"{fin.column.unit} as the log says; check: sign")
    if unit := named_unit(fin.column.name, "rad"):
        return YamlEntry(key, fin.signal(unit=unit), f"as the name says; check: sign; {extent}")
    if largest > _LARGEST_FIN_DEGREES:
        counts = fin.signal(centre=_middle(fin.values), scale=None)
        return YamlEntry(key, counts, f"required: what is straight, and one count, such as 0.35 deg; {extent}")
    unit = "deg" if largest > 0.5 * np.pi else "rad"
    return YamlEntry(key, fin.signal(unit=unit), f"check: unit and sign; {extent}")


def _middle(counts: Array) -> int:
    """Guess the count that means zero."""
    low, high = _PULSES
    return _MIDDLE_PULSE if np.nanmin(counts) >= low and np.nanmax(counts) <= high else _MIDDLE_BYTE
