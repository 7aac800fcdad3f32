"""Columns of a log with units and times for a suggested map."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.log_columns import factor_if_known, unit_factor
from auvid_cli.config.units import magnitude_of
from auvid_cli.logs.clock import find_restarts, order_rows
from auvid_cli.logs.formats.log import Log, LogColumn, find_codes, has_rows_of_zeros, is_code, rows_of_zeros
from auvid_cli.logs.frames import euler_of_quaternion, in_forward_axes, quaternion_of_euler
from auvid_cli.logs.suggest.names import QUATERNION_NAMES, Match, named_unit, standard_message
from auvid_cli.logs.suggest.relations import ANGLES, Track
from auvid_cli.logs.suggest.times import one_sender, rows_of_sender, seconds_of, time_of
from auvid_cli.text import Flow, Phrase, YamlEntry
from auvid_cli.vehicle.parameters import SENSORS


def row_entries(logs: Mapping[str, Log], name: str, table: str, delay: float = 0.0) -> Iterator[YamlEntry]:
    """Yield log, table and time of columns; `delay` is how late their times are, s."""
    if len(logs) > 1:
        yield YamlEntry("log", name)
    if table:
        yield YamlEntry("table", table)
    if (sender := one_sender(logs[name], table)) is not None:
        column, value = sender
        yield YamlEntry("rows", {"column": column, "values": (_value(value),)}, "check: one of several senders")
    time, comment = time_of(logs[name], table)
    if delay and time is not None:
        time = dict(time) if isinstance(time, Mapping) else {"column": time}
        if time.get("offset", "0 s") is None:
            yield YamlEntry("time", time, comment)
            return
        time["offset"] = Phrase(_added(str(time.get("offset", "0 s")), -delay))
        direction = "later" if delay > 0.0 else "earlier"
        comment = f"check: its changes are {abs(delay):.2f} s {direction} than those of related signals"
    yield YamlEntry("time", time, comment)


def _added(offset: str, seconds: float) -> str:
    """Return the sum of an offset in s or days and seconds, s."""
    number, unit = offset.split()
    return f"{float(number) * unit_factor(unit, 's') + seconds:.12g} s" if float(number) else f"{seconds:.2f} s"


def place_of(logs: Mapping[str, Log], name: str, table: str) -> dict[str, Flow] | None:
    """Return log, table and time of a single column in another table; None if that has no times."""
    time, _ = time_of(logs[name], table)
    if time is None:
        return None
    place: dict[str, Flow] = {"log": name} if len(logs) > 1 else {}
    if (sender := one_sender(logs[name], table)) is not None:
        place["rows"] = {"column": sender[0], "values": (_value(sender[1]),)}
    return place | ({"table": table} if table else {}) | {"time": time}


def _value(value: str | float) -> Flow:
    return value if isinstance(value, str) else Phrase(f"{value:.10g}")


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
    is_right_forward_up: bool = False  # whether an attitude is of axes to starboard, ahead and up, from east

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
        """Return the components in SI, a quaternion as angles; implausible values are NaN.

        An attitude of axes to starboard, ahead and up is turned into the usual axes.
        """
        if self.is_quaternion:
            quaternion = np.column_stack([self.numbers[axis] for axis in "wxyz"])
            if self.is_right_forward_up:
                quaternion = in_forward_axes(quaternion)
            return dict(zip(ANGLES, euler_of_quaternion(quaternion).T, strict=True))
        si = SENSORS[self.sensor][0].unit
        factor = unit_factor(self.unit, si)
        most = magnitude_of(si).largest / factor
        values = {
            component: factor * np.where(np.abs(raw) <= most, raw, np.nan) for component, raw in self.numbers.items()
        }
        if self.is_right_forward_up and {*values} == {*ANGLES}:
            quaternion = in_forward_axes(quaternion_of_euler(np.column_stack([values[symbol] for symbol in ANGLES])))
            values |= dict(zip(ANGLES, euler_of_quaternion(quaternion).T, strict=True))
        return values


def found_in(logs: Mapping[str, Log], sensor: str, name: str, match: Match) -> Found:
    """Read the columns of a sensor, in SI units if neither the log nor their names state a unit."""
    values = logs[name].read(match.table, [column.name for column in match.columns.values()])
    numbers = {component: np.asarray(values[column.name], np.float64) for component, column in match.columns.items()}
    si = SENSORS[sensor][0].unit
    stated, comment = _stated_unit(list(match.columns.values()), si)
    message = match.message
    units = [unit for unit in (message.units if message is not None else ()) if factor_if_known(unit, si) is not None]
    if message is not None and units and not any(column.unit for column in match.columns.values()):
        stated, comment = units[0], f"unit of this message of {message.source}"
    if message is None and not stated and (kind := standard_message(logs[name].tables()[match.table])):
        stated, comment = si, f"check: {kind} is in SI units by REP 103"
    if (chosen := rows_of_sender(logs[name], match.table)) is not None:
        numbers = {component: np.where(chosen, values, np.nan) for component, values in numbers.items()}
    codes = find_codes(numbers)
    marked = np.any([is_code(own, codes) for own in numbers.values()], axis=0)
    zeros = rows_of_zeros(numbers) if has_rows_of_zeros(numbers) else np.zeros(marked.size, np.bool_)
    numbers = {key: np.where(is_code(own, codes) | zeros, np.nan, own) for key, own in numbers.items()}
    counts = int(np.count_nonzero(marked)), int(np.count_nonzero(zeros))
    return Found(sensor, name, match, numbers, (stated or si,), comment, bool(stated), codes, *counts)


def tracks_of(
    log: Log, table: str, signals: Mapping[str, Array], chosen: NDArray[np.bool_] | None = None
) -> dict[str, Track]:
    """Return signals with their times in s, by default of all rows; empty if the table has no valid times."""
    seconds = seconds_of(log, table)
    if chosen is None:
        chosen = rows_of_sender(log, table)
    if chosen is not None and seconds.size:
        seconds, signals = seconds[chosen], {symbol: values[chosen] for symbol, values in signals.items()}
    if not seconds.size:
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
    stated = units.pop() if len(units) == 1 else ""
    if stated and factor_if_known(stated, si) is not None:
        return stated, "unit stated by the log"
    named = {named_unit(column.name, si) for column in columns}
    if len(named) == 1 and (unit := named.pop()):
        return unit, "check: unit by the name"
    return "", f"the log states the unknown unit {stated!r}" if stated else ""
