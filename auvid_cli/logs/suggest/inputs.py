"""The part of a suggested map that says what fins and propeller did."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest.judge import Evidence
from auvid_cli.logs.suggest.names import INPUT_NAMES, SIDES, find_columns, find_in_logs, named_unit
from auvid_cli.logs.suggest.rows import Comment, Flow, Line, Phrase, YamlEntry, row_entries, time_of, tracks_of
from auvid_cli.logs.suggest.ties import PITCHING, TURNING, Track

Array = NDArray[np.float64]

_LARGEST_FIN_DEGREES, _LARGEST_PERCENT, _LARGEST_FRACTION = 90.0, 110.0, 1.5
# Pulses of a servo, in microseconds, and the numbers of a byte: their middles.
_PULSES, _MIDDLE_PULSE, _MIDDLE_BYTE = (800.0, 2200.0), 1500, 128
_OPPOSITE = (("top", "bottom"), ("right", "left"))
# Words that fins, and what drives them, are called by.
_OF_FINS = re.compile(r"(?<![a-z])((stern|bow)_?)?(fin|rudder|elevator|plane|servo)s?(?![a-z])")
_OF_SERVOS = re.compile("servo")


class FoundInput(NamedTuple):
    """A column that looks like an input, its numbers, and where it stands."""

    column: LogColumn
    values: Array
    log: str
    table: str
    place: dict[str, Flow]

    @property
    def largest(self) -> float:
        """Return the largest size."""
        return float(np.nanmax(np.abs(self.values), initial=0.0))

    def signal(self, **more: Flow) -> dict[str, Flow]:
        """Return place, unless it is where most inputs stand, column and what else it needs."""
        return {**self.place, "column": self.column.name, **more}


class FoundInputs(NamedTuple):
    """Inputs by their keys, the table that holds most of them, and thrusters of which there are several."""

    log: str
    table: str
    signals: dict[str, FoundInput]
    thrusters: list[str]


def find_inputs(logs: Mapping[str, Log]) -> FoundInputs | None:
    """Find what looks like an input by names; of several thrusters none is the surge force."""
    place = find_in_logs(logs, INPUT_NAMES)
    if place is None:
        return None
    name, main = place
    signals = _inputs(logs, name, main.table)
    direct = {"rudder", "elevator"} & {*signals}
    signals = {key: signal for key, signal in signals.items() if not (direct and key.startswith("fins."))}
    # Revolutions of a thruster are called like its share as well.
    thrusters = dict.fromkeys(
        text for key, signal in signals.items() if _is_thrust(key) for text in _alike(logs[signal.log], signal)
    )
    if thrusters:
        signals = {key: signal for key, signal in signals.items() if not _is_thrust(key)}
    return FoundInputs(name, main.table, signals, [*thrusters])


def _alike(log: Log, signal: FoundInput) -> list[str]:
    """List columns that are called as an input but for a number, where there are several: thrusters of an ROV."""
    called = _unnumbered(signal.table), _unnumbered(signal.column.name)
    alike = [
        f"{table} {column.name}".strip()
        for table, columns in log.tables().items()
        for column in columns
        if (_unnumbered(table), _unnumbered(column.name)) == called
    ]
    return alike if len(alike) > 1 else []


def _unnumbered(name: str) -> str:
    return re.sub(rf"_?\d+_?|_?(?<![a-z]){SIDES}(?![a-z])_?", "#", name.lower())


def input_tracks(logs: Mapping[str, Log], inputs: FoundInputs | None) -> dict[str, Track]:
    """Return the deflections of fins, in the log's units: their signs are what matters."""
    tracks: dict[str, Track] = {}
    for key, signal in inputs.signals.items() if inputs is not None else ():
        if key in (*TURNING, *PITCHING):
            tracks |= tracks_of(logs[signal.log], signal.table, {key: signal.values})
    return tracks


def input_lines(logs: Mapping[str, Log], inputs: FoundInputs | None, judged: Evidence) -> Iterator[Line]:
    """Yield the lines below `inputs:`."""
    if inputs is None:
        these = _these_may_be(_possible_fins(logs))
        yield YamlEntry("rudder", None, f"required: no column looks like a fin or a propeller{these}")
        return
    yield from row_entries(logs, inputs.log, inputs.table)
    direct = {key: signal for key, signal in inputs.signals.items() if "." not in key}
    fins = {key: signal for key, signal in inputs.signals.items() if key.startswith("fins.")}
    if judged.exchanged:
        direct |= {"rudder": direct["elevator"], "elevator": direct["rudder"]}
        yield Comment("check: r answers what is called elevator, q what is called rudder: they are exchanged here")
    deflecting = {**fins, **{key: direct[key] for key in ("rudder", "elevator") if key in direct}}
    largest = max((fin.largest for fin in deflecting.values()), default=0.0)
    for key, signal in direct.items():
        yield (
            _fin(key, signal, largest, judged)
            if key in deflecting
            else YamlEntry(key, signal.signal(), "check: in N, or N m")
        )
    if fins:
        lines: list[Line] = [_fin(key, fin, largest, judged) for key, fin in fins.items()]
        lines += _opposites(fins, judged)
        yield YamlEntry("fins", lines, "check: positive pushes the tail to starboard, or up; else sign: -1")
    if not deflecting:
        yield Comment(f"check: no column is called like a fin{_these_may_be(_possible_fins(logs))}")
    if inputs.thrusters:
        several = f"{', '.join(inputs.thrusters)}: several thrusters are not one surge force"
        yield Comment(f"check: {several}; make a column of their sum along the bow, or say which one pushes")
    else:
        yield from _thrust(inputs.signals)


def _opposites(fins: Mapping[str, FoundInput], judged: Evidence) -> Iterator[Comment]:
    for first, second in _OPPOSITE:
        keys = f"fins.{first}", f"fins.{second}"
        if not {*keys} <= {*fins}:
            continue
        one, other = (judged.verdict.signs.get(key, 1) * fins[key].values for key in keys)
        if _are_opposite(one, other):
            why = f"{first} and {second} go against each other, so one of them counts the other way"
            yield Comment(f"check: {why}: sign: -1")


def _these_may_be(fins: Iterable[str]) -> str:
    candidates = ", ".join(fins)
    return f"; these may be fins: {candidates}" if candidates else ""


def _possible_fins(logs: Mapping[str, Log]) -> Iterator[str]:
    """Yield columns that have a fin in their names, or in that of their table, and rows of several servos."""
    for log_name, log in logs.items():
        for table, columns in log.tables().items():
            names = [column.name for column in columns]
            of_servos = _OF_SERVOS.search((table or log_name).lower()) is not None
            if of_servos and {"id", "value"} <= {*names}:
                place = f"table: {table}, " if table else f"log: {log_name}, " if len(logs) > 1 else ""
                yield f"{{{place}column: value, rows: {{column: id, values: [0]}}}}, and so on by id"
                continue
            of_fins = _OF_FINS.search(table.lower()) is not None
            for name in names:
                if _OF_FINS.search(name.lower()) or (of_fins and name.startswith("data")):
                    yield f"{table} {name}".strip()


def _inputs(logs: Mapping[str, Log], name: str, main: str) -> dict[str, FoundInput]:
    """Find inputs by their keys: those of the table that has most of them, then what others have besides."""
    places = [(name, columns) for columns in find_columns(INPUT_NAMES, {main: logs[name].tables()[main]})]
    places += [(log, columns) for log in logs for columns in find_columns(INPUT_NAMES, logs[log].tables())]
    inputs: dict[str, FoundInput] = {}
    for log, (table, columns) in places:
        new = {key: column for key, column in columns.items() if key not in inputs}
        elsewhere = (log, table) != (name, main)
        place = _place(logs, log, table) if elsewhere else {}
        if new and place is not None:
            read = logs[log].read(table, [column.name for column in new.values()])
            numbers = {key: np.asarray(read[column.name], np.float64) for key, column in new.items()}
            inputs |= {
                key: FoundInput(new[key], values, log, table, place)
                for key, values in numbers.items()
                if _counts(values, elsewhere and not _is_thrust(key))
            }
    return inputs


def _counts(values: Array, must_change: bool) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size) and (not must_change or bool(np.ptp(known) > 0.0))


def _is_thrust(key: str) -> bool:
    return key.startswith(("thrust.", "surge_force"))


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


def _thrust(inputs: Mapping[str, FoundInput]) -> Iterator[Line]:
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


def _revolutions(command: FoundInput) -> YamlEntry:
    if command.column.unit:
        return YamlEntry("revolutions", command.signal(), f"{command.column.unit} as the log says")
    unit = named_unit(command.column.name, "turn/s") or "rpm"
    return YamlEntry("revolutions", command.signal(unit=unit), "check: rpm, or turn/s")


def _share(command: FoundInput) -> YamlEntry:
    comment = f"check: percent, or '1' for fractions; it reaches {command.largest:.4g}"
    return YamlEntry("share", command.signal(**_share_unit(command)), comment)


def _share_unit(command: FoundInput) -> dict[str, Flow]:
    if command.column.unit:
        return {}
    if command.largest > _LARGEST_PERCENT:
        centre = _middle(command.values)
        return {"centre": centre, "scale": Phrase("0.25 percent" if centre == _MIDDLE_PULSE else "0.787 percent")}
    is_fraction = 0.0 < command.largest <= _LARGEST_FRACTION and not named_unit(command.column.name, "percent")
    return {"unit": "1" if is_fraction else "percent"}


def _fin(key: str, fin: FoundInput, largest: float, judged: Evidence) -> YamlEntry:
    called = key.removeprefix("fins.")
    extent = f"it goes from {np.nanmin(fin.values):.4g} to {np.nanmax(fin.values):.4g}"
    turned: dict[str, Flow] = {"sign": -1} if judged.verdict.signs.get(key, 1) < 0 else {}
    said = f"check: sign; {judged.words([key])}"
    if fin.column.unit:
        return YamlEntry(called, fin.signal(**turned), f"{fin.column.unit} as the log says; {said}")
    if unit := named_unit(fin.column.name, "rad"):
        return YamlEntry(called, fin.signal(unit=unit, **turned), f"as the name says; {said}; {extent}")
    if largest > _LARGEST_FIN_DEGREES:
        counts = fin.signal(centre=_middle(fin.values), scale=None, **turned)
        what = "required: what is straight, and one count, such as 0.35 deg"
        return YamlEntry(called, counts, f"{what}; {extent}; {said}")
    unit = "deg" if largest > 0.5 * np.pi else "rad"
    return YamlEntry(called, fin.signal(unit=unit, **turned), f"check: unit; {extent}; {said}")


def _middle(counts: Array) -> int:
    """Guess the count that means zero."""
    low, high = _PULSES
    return _MIDDLE_PULSE if np.nanmin(counts) >= low and np.nanmax(counts) <= high else _MIDDLE_BYTE
