"""Inputs of a suggested map: fins and thrust."""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest.evidence import Evidence
from auvid_cli.logs.suggest.known_formats import KnownMessage, Role
from auvid_cli.logs.suggest.names import INPUT_NAMES, SIDES, find_columns, find_in_logs, named_unit
from auvid_cli.logs.suggest.numbered import FinRole, fin_channels, fin_roles
from auvid_cli.logs.suggest.relations import PITCH_FINS, YAW_FINS, Track
from auvid_cli.logs.suggest.rows import place_of, row_entries, tracks_of
from auvid_cli.text import Comment, Flow, Line, Phrase, YamlEntry

_MAX_FIN_DEGREES = 90.0
_MAX_PERCENT = 110.0
_MAX_FRACTION = 1.5
_SERVO_PULSES = (800.0, 2200.0)  # us
_MIDDLE_PULSE = 1500  # us
_MIDDLE_BYTE = 128
_EITHER = ("rudder", "elevator")
_MOTION = ("phi", "theta", "psi", "p", "q", "r")
_SAME_SIGNAL = 0.05  # largest difference from a measurement that a column repeats, as a share of its spread
_MIN_ROWS = 30
_OPPOSITE = (("top", "bottom"), ("right", "left"))
_OF_ANGLE = re.compile(r"(yaw|pitch)_input")  # input of a controller, not of a fin, if the log has numbered fins
_FIN_WORDS = re.compile(r"(?<![a-z])((stern|bow)_?)?(fin|rudder|elevator|plane|servo)s?(?![a-z])")


class FoundInput(NamedTuple):
    """A column that looks like an input, its numbers, and its place in the map."""

    column: LogColumn
    values: Array
    log: str
    table: str
    place: dict[str, Flow]
    message: KnownMessage | None = None
    role: FinRole | None = None  # place of a fin that has a number, with its sign

    @property
    def largest(self) -> float:
        """Return the largest absolute value."""
        return float(np.nanmax(np.abs(self.values), initial=0.0))

    def signal(self, **more: Flow) -> dict[str, Flow]:
        """Return the entry of the map: place, column and further keys."""
        return {**self.place, "column": self.column.name, **more}


class FoundInputs(NamedTuple):
    """Inputs by key, the table with most of them, and the columns of several thrusters."""

    log: str
    table: str
    signals: dict[str, FoundInput]
    thrusters: list[str]


def find_inputs(logs: Mapping[str, Log], measured: Mapping[str, Track]) -> FoundInputs | None:
    """Return the columns whose names are those of inputs; None without any.

    A column that repeats a measured angle or rate is not a fin, such as the ``yaw_input`` of a controller.

    Parameters
    ----------
    logs : mapping of str to Log
    measured : mapping of str to Track
        Signals of sensors by symbol.
    """
    place = find_in_logs(logs, INPUT_NAMES)
    if place is None:
        return None
    name, main = place
    signals = {
        key: signal
        for key, signal in _inputs(logs, name, main.table).items()
        if not (key in _EITHER and _repeats_measurement(logs[signal.log], signal, measured))
        and not (_OF_ANGLE.search(signal.column.name.lower()) and next(fin_channels(logs), None))
    }
    direct = {"rudder", "elevator"} & {*signals}
    signals = {key: signal for key, signal in signals.items() if not (direct and key.startswith("fins."))}
    # Several thrusters are not one surge force. Their revolutions and shares have similar names.
    thrusters = dict.fromkeys(
        text
        for key, signal in signals.items()
        if _is_thrust(key)
        for text in _similar_columns(logs[signal.log], signal)
    )
    if thrusters:
        signals = {key: signal for key, signal in signals.items() if not _is_thrust(key)}
    return FoundInputs(name, main.table, signals, [*thrusters])


def _repeats_measurement(log: Log, signal: FoundInput, measured: Mapping[str, Track]) -> bool:
    """Whether a column is a measured angle or turn rate, in rad or deg."""
    tracks = tracks_of(log, signal.table, {"fin": signal.values})
    if "fin" not in tracks:
        return False
    time, values = tracks["fin"]
    for symbol in _MOTION:
        if symbol in measured:
            other = np.interp(time, *measured[symbol], left=np.nan, right=np.nan)
            known = np.isfinite(other) & np.isfinite(values)
            if np.count_nonzero(known) < _MIN_ROWS:
                continue
            # A fin that an autopilot moves in proportion to an angle has another gain.
            for factor in (1.0, -1.0, np.degrees(1.0), -np.degrees(1.0)):
                rest = values[known] - factor * other[known]
                if np.std(rest) < _SAME_SIGNAL * np.std(values[known]):
                    return True
    return False


def with_numbered_fins(
    logs: Mapping[str, Log], inputs: FoundInputs | None, tracks: Mapping[str, Track]
) -> FoundInputs | None:
    """Return the inputs with fins such as fin1 to fin4, if no others are found and the data show their places."""
    if inputs is not None and any(key in (*YAW_FINS, *PITCH_FINS) for key in inputs.signals):
        return inputs
    for channels in fin_channels(logs):
        roles = fin_roles([channel.track for channel in channels], tracks.get("r"), tracks.get("q"))
        if not roles:
            continue
        name, table = channels[0].log, channels[0].table
        if inputs is None:
            thrust = {key: signal for key, signal in _inputs(logs, name, table).items() if _is_thrust(key)}
            inputs = FoundInputs(name, table, thrust, [])
        elsewhere = (name, table) != (inputs.log, inputs.table)
        place = (place_of(logs, name, table) or {}) if elsewhere else {}
        signals = {
            f"fins.{role.name}": FoundInput(
                channel.column, channel.track.values, name, table, place | channel.rows, channel.message, role
            )
            for channel, role in zip(channels, roles, strict=True)
        }
        return inputs._replace(signals=inputs.signals | signals)
    return inputs


def _similar_columns(log: Log, signal: FoundInput) -> list[str]:
    """Return all columns whose names differ from an input's only in a number or side, if there are several."""
    name = _without_number(signal.table), _without_number(signal.column.name)
    similar = [
        f"{table} {column.name}".strip()
        for table, columns in log.tables().items()
        for column in columns
        if (_without_number(table), _without_number(column.name)) == name
    ]
    return similar if len(similar) > 1 else []


def _without_number(name: str) -> str:
    return re.sub(rf"_?\d+_?|_?(?<![a-z]){SIDES}(?![a-z])_?", "#", name.lower())


def input_tracks(logs: Mapping[str, Log], inputs: FoundInputs | None) -> dict[str, Track]:
    """Return the deflections of fins with names in the log's units, because only their signs matter."""
    tracks: dict[str, Track] = {}
    for key, signal in inputs.signals.items() if inputs is not None else ():
        if key in (*YAW_FINS, *PITCH_FINS) and signal.role is None:
            tracks |= tracks_of(logs[signal.log], signal.table, {key: signal.values})
    return tracks


def input_lines(logs: Mapping[str, Log], inputs: FoundInputs | None, evidence: Evidence) -> Iterator[Line]:
    """Yield the lines below `inputs:`."""
    if inputs is None:
        what = "no column looks like a fin or a propeller"
        advice = _candidates(logs) or "; add the log with the commands of the fins: import --suggest LOG OTHER"
        yield YamlEntry("rudder", None, f"required: {what}{advice}")
        return
    yield from row_entries(logs, inputs.log, inputs.table)
    direct = {key: signal for key, signal in inputs.signals.items() if "." not in key}
    fins = {key: signal for key, signal in inputs.signals.items() if key.startswith("fins.")}
    if evidence.exchanged:
        direct |= {"rudder": direct["elevator"], "elevator": direct["rudder"]}
        yield Comment("check: r responds to the elevator column, q to the rudder column; they are exchanged here")
    deflecting = {**fins, **{key: direct[key] for key in ("rudder", "elevator") if key in direct}}
    largest = max((fin.largest for fin in deflecting.values()), default=0.0)
    for key, signal in direct.items():
        is_fin = key in deflecting
        yield _fin(key, signal, largest, evidence) if is_fin else YamlEntry(key, signal.signal(), "check: in N or N m?")
    if fins:
        lines: list[Line] = [_fin(key, fin, largest, evidence) for key, fin in fins.items()]
        lines += _opposites(fins, evidence)
        if any(fin.role is not None for fin in fins.values()):
            yield Comment("check: which fin of each pair is the upper or right one; yaw and pitch do not show it")
        comment = "check: must be positive if the fin pushes the tail to starboard or up; otherwise add sign: -1"
        yield YamlEntry("fins", lines, comment)
    if not deflecting:
        yield Comment(f"check: no column has the name of a fin{_candidates(logs)}")
    if inputs.thrusters:
        several = f"{', '.join(inputs.thrusters)}: several thrusters are not one surge force"
        yield Comment(f"check: {several}; add a column with their sum along the bow, or choose one of them")
    else:
        yield from _thrust(inputs.signals)


def _opposites(fins: Mapping[str, FoundInput], evidence: Evidence) -> Iterator[Comment]:
    for first, second in _OPPOSITE:
        keys = f"fins.{first}", f"fins.{second}"
        if not {*keys} <= {*fins}:
            continue
        one, other = (evidence.verdict.signs.get(key, 1) * fins[key].values for key in keys)
        if one.size == other.size and np.nanstd(one + other) < 0.5 * np.nanstd(one - other):
            opposite = f"{first} and {second} move in opposite directions"
            yield Comment(f"check: {opposite}, so one of them probably needs sign: -1")


def _candidates(logs: Mapping[str, Log]) -> str:
    candidates = ", ".join(_possible_fins(logs))
    return f"; possible fins: {candidates}" if candidates else ""


def _possible_fins(logs: Mapping[str, Log]) -> Iterator[str]:
    """Yield columns that have a word for a fin in their name or table, and rows of several servos."""
    for log_name, log in logs.items():
        for table, columns in log.tables().items():
            names = [column.name for column in columns]
            of_servos = "servo" in (table or log_name).lower()
            if of_servos and {"id", "value"} <= {*names}:
                place = f"table: {table}, " if table else f"log: {log_name}, " if len(logs) > 1 else ""
                yield f"{{{place}column: value, rows: {{column: id, values: [0]}}}} and so on, one for each id"
                continue
            of_fins = _FIN_WORDS.search(table.lower()) is not None
            for name in names:
                if _FIN_WORDS.search(name.lower()) or (of_fins and name.startswith("data")):
                    yield f"{table} {name}".strip()


def _inputs(logs: Mapping[str, Log], name: str, main: str) -> dict[str, FoundInput]:
    """Return inputs by key: first those of the main table, then the missing ones from other tables."""
    tables = [(name, {main: logs[name].tables()[main]}), *((log, logs[log].tables()) for log in logs)]
    places = [(log, match) for log, own in tables for match in find_columns(INPUT_NAMES, own, file=logs[log].path.stem)]
    inputs: dict[str, FoundInput] = {}
    for log, (table, columns, message) in places:
        new = {key: column for key, column in columns.items() if key not in inputs}
        elsewhere = (log, table) != (name, main)
        place = place_of(logs, log, table) if elsewhere else {}
        if new and place is not None:
            read = logs[log].read(table, [column.name for column in new.values()])
            numbers = {key: np.asarray(read[column.name], np.float64) for key, column in new.items()}
            inputs |= {
                key: FoundInput(new[key], values, log, table, place, message)
                for key, values in numbers.items()
                # An input in another table must change, unless it is thrust.
                if (known := values[np.isfinite(values)]).size
                and (not elsewhere or _is_thrust(key) or np.ptp(known) > 0.0)
            }
    return inputs


def _is_thrust(key: str) -> bool:
    return key.startswith(("thrust.", "surge_force"))


def _thrust(inputs: Mapping[str, FoundInput]) -> Iterator[Line]:
    if "surge_force" in inputs:
        return
    if "thrust.revolutions" in inputs:
        factor = YamlEntry("a", None, "required: factor a of the force a n|n|, such as 0.05 N*s^2")
        yield YamlEntry("thrust", [_revolutions(inputs["thrust.revolutions"]), factor])
    elif "thrust.share" in inputs:
        full = YamlEntry("full", None, "required: force at 100 percent, such as 20 N")
        yield YamlEntry("thrust", [_share(inputs["thrust.share"]), full])
    else:
        constant = "surge_force: {constant: 10 N}"
        yield Comment(f"check: no column looks like thrust, so it will be zero; a constant one: {constant}")


def _revolutions(command: FoundInput) -> YamlEntry:
    if command.column.unit:
        return YamlEntry("revolutions", command.signal(), f"unit {command.column.unit} stated by the log")
    if known := _known_unit(command):
        return YamlEntry("revolutions", command.signal(unit=known), "unit of this message by its format")
    unit = named_unit(command.column.name, "turn/s") or "rpm"
    return YamlEntry("revolutions", command.signal(unit=unit), "check: unit, rpm or turn/s?")


def _share(command: FoundInput) -> YamlEntry:
    if known := _known_unit(command):
        return YamlEntry("share", command.signal(unit=known), "unit of this message by its format")
    comment = f"check: unit, percent or '1' for fractions? Values reach {command.largest:.4g}"
    return YamlEntry("share", command.signal(**_share_unit(command)), comment)


def _share_unit(command: FoundInput) -> dict[str, Flow]:
    if command.column.unit:
        return {}
    if command.largest > _MAX_PERCENT:
        centre = _middle(command.values)
        return {"centre": centre, "scale": Phrase("0.25 percent" if centre == _MIDDLE_PULSE else "0.787 percent")}
    is_fraction = 0.0 < command.largest <= _MAX_FRACTION and not named_unit(command.column.name, "percent")
    return {"unit": "1" if is_fraction else "percent"}


def _fin(key: str, fin: FoundInput, largest: float, evidence: Evidence) -> YamlEntry:
    name = key.removeprefix("fins.")
    span = f"values from {np.nanmin(fin.values):.4g} to {np.nanmax(fin.values):.4g}"
    is_reversed = (fin.role.sign if fin.role is not None else evidence.verdict.signs.get(key, 1)) < 0
    sign: dict[str, Flow] = {"sign": -1} if is_reversed else {}
    why = fin.role.reason if fin.role is not None else evidence.words([key])
    words = f"check: sign; {why}"
    if fin.column.unit:
        return YamlEntry(name, fin.signal(**sign), f"unit {fin.column.unit} stated by the log; {words}")
    if known := _known_unit(fin):
        is_set_point = fin.message is not None and fin.message.role is Role.SET_POINT
        words = f"a set-point, which the fin follows late; {words}" if is_set_point else words
        return YamlEntry(name, fin.signal(unit=known, **sign), f"unit of this message by its format; {words}; {span}")
    if unit := named_unit(fin.column.name, "rad"):
        return YamlEntry(name, fin.signal(unit=unit, **sign), f"unit by the name; {words}; {span}")
    if largest > _MAX_FIN_DEGREES:
        counts = fin.signal(centre=_middle(fin.values), scale=None, **sign)
        return YamlEntry(
            name, counts, f"required: count of a straight fin, and scale, such as 0.35 deg; {span}; {words}"
        )
    unit = "deg" if largest > 0.5 * np.pi else "rad"
    return YamlEntry(name, fin.signal(unit=unit, **sign), f"check: unit and sign; {span}; {why}")


def _known_unit(signal: FoundInput) -> str:
    message = signal.message
    return message.units[0] if message is not None and message.units else ""


def _middle(counts: Array) -> int:
    """Return the probable count of a straight fin or of zero thrust."""
    low, high = _SERVO_PULSES
    if np.nanmin(counts) < 0.0:
        return 0
    return _MIDDLE_PULSE if np.nanmin(counts) >= low and np.nanmax(counts) <= high else _MIDDLE_BYTE
