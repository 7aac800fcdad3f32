"""Suggest a map for a log: sensors, inputs, and the unused columns with the reason."""

import os
import re
import textwrap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, Log, LogColumn
from auvid_cli.logs.suggest import names
from auvid_cli.logs.suggest.evidence import weigh_evidence
from auvid_cli.logs.suggest.found_sensors import FoundSensor, flag_of, sensor_tracks
from auvid_cli.logs.suggest.inputs import FoundInputs, find_inputs, input_lines, input_tracks, with_numbered_fins
from auvid_cli.logs.suggest.known_formats import Role, known_message
from auvid_cli.logs.suggest.sensors import expected_of, find_sensors, sensor_lines
from auvid_cli.logs.suggest.times import align_clocks, one_sender, time_of
from auvid_cli.text import Comment, Flow, Line, Phrase, YamlEntry, commented_text
from auvid_cli.vehicle.parameters import PARAMETERS

MAX_TEXT = 64_000_000  # bytes that are read from a text log to recognise its columns
_wrapper = textwrap.TextWrapper(110, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
_SAME = 1e-6  # largest difference from a used column, divided by its spread
_UNKNOWN = "no name of a signal that a map has"


def suggest(logs: Sequence[Log], folder: Path, vehicle: str | None = None) -> str:
    """Return a map suggested from names, units and values of logs, and from relations between their signals.

    Parameters
    ----------
    logs : sequence of Log
    folder : pathlib.Path
        Folder of the map; its paths are relative to it.
    vehicle : str, optional
        Vehicle file as the map names it; its coefficients are the mean of the prior. Default: the map asks for size and
        parameters, and the mean is zero.

    Returns
    -------
    str
        YAML. ``# check:`` marks guesses, null with ``# required:`` values that only the user knows. Comments give the
        evidence of a line. Unused columns are listed at the end.

    Raises
    ------
    FileError
        If a log is damaged.
    """
    by_name = _log_names(logs)
    files = [YamlEntry(name, _file(log, folder)) for name, log in by_name.items()]
    align_clocks(by_name)
    sensors = find_sensors(by_name)
    measured = sensor_tracks(by_name, sensors)
    inputs = with_numbered_fins(by_name, find_inputs(by_name, measured), measured)
    tracks = measured | input_tracks(by_name, inputs)
    evidence = weigh_evidence(tracks, expected_of(by_name, sensors))
    return commented_text(
        [
            Comment(
                "A map suggested by auvid: check every line marked `check:`, and replace every null marked `required:`."
            ),
            *(
                Comment(f"Only the first {MAX_TEXT / 1e6:g} MB of {log.path.name} were read.")
                for log in logs
                if log.is_cut
            ),
            *(Comment(f"{log.path.name}: {remark}") for log in logs for remark in log.remarks()),
            YamlEntry("name", next(iter(by_name))),
            YamlEntry("vehicle", vehicle)
            if vehicle is not None
            else YamlEntry("vehicle", _vehicle(), "or the path of a vehicle file, such as `auvid init` writes"),
            YamlEntry("logs", files),
            YamlEntry("sensors", list(sensor_lines(by_name, sensors, evidence))),
            YamlEntry("inputs", list(input_lines(by_name, inputs, evidence))),
            YamlEntry("identification", list(_identification(vehicle is not None))),
            *unused_lines(by_name, sensors, inputs),
        ]
    )


def _file(log: Log, folder: Path) -> Flow:
    file = os.path.relpath(log.path, folder)
    messages = tuple(os.path.relpath(path, folder) for path in log.definitions)
    return {"file": file, "messages": messages} if messages else file


def _log_names(logs: Sequence[Log]) -> dict[str, Log]:
    names: dict[str, Log] = {}
    for log in logs:
        name = re.sub(r"\W+", "_", log.path.name.split(".")[0], flags=re.ASCII).strip("_")
        # YAML would read a name that begins with a digit as a number.
        name = name if name[:1].isalpha() else f"log_{name}".rstrip("_")
        names[name if name not in names else f"{name}_{len(names) + 1}"] = log
    return names


def _vehicle() -> list[Line]:
    size: list[Line] = [
        YamlEntry("length", None, "required: length of the hull, such as 1.6 m"),
        YamlEntry("diameter", None, "required: diameter of the hull, such as 0.19 m"),
    ]
    parameters = [
        YamlEntry(quantity.symbol, None, f"required: {quantity.meaning}, {quantity.unit}") for quantity in PARAMETERS
    ]
    name = YamlEntry("name", Phrase("my vehicle"), "check: name of your vehicle")
    return [name, YamlEntry("size", size), YamlEntry("parameters", parameters)]


def _identification(has_values: bool) -> Iterator[Line]:
    if has_values:
        yield YamlEntry("prior", {"mean": "vehicle"}, "coefficients that the log does not determine keep these values")
    yield YamlEntry("tolerances", "usual", "or what you measured, such as {inertia: 2 %, delay: 1 ms}")


def unused_lines(
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], inputs: FoundInputs | None
) -> Iterator[Comment]:
    """Yield comments that list the columns that the map does not use, with the reason."""
    used = _used(logs, sensors, inputs)
    in_map = {component for sensor in sensors.values() for part in sensor.parts for component in part.match.columns}
    for name, log in logs.items():
        distinct = names.distinct_tables(log.tables())
        for table, columns in log.tables().items():
            time, _ = time_of(log, table)
            times = [str(text) for text in time.values()] if isinstance(time, Mapping) else [time]
            unused = [
                column for column in columns if (name, table, column.name) not in used and column.name not in times
            ]
            if (sender := one_sender(log, table)) is not None:
                unused = [column for column in unused if column.name != sender[0]]
            if not unused:
                continue
            where = " ".join(part for part in (name if len(logs) > 1 else "", table) if part)
            prefix = f"not used{f' of {where}' if where else ''}"
            if table not in distinct:
                yield Comment(f"{prefix}: its rows are those of other tables, one for each instance")
                continue
            if kind := _kind_of_table(table, columns, log.path.stem):
                members = ", ".join(_joined_elements(column.name for column in unused))
                yield from map(Comment, _wrapper.wrap(f"{prefix} ({kind}): {members}"))
                continue
            own = [column.name for column in columns if (name, table, column.name) in used]
            reasons = _reasons(log, table, unused, own, in_map)
            text = "; ".join(f"{', '.join(_joined_elements(of))} ({reason})" for reason, of in reasons.items())
            yield from map(Comment, _wrapper.wrap(f"{prefix}: {text}"))


def _used(
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], inputs: FoundInputs | None
) -> set[tuple[str, str, str]]:
    used = set[tuple[str, str, str]]()
    for part in (part for sensor in sensors.values() for part in sensor.parts):
        used |= {(part.log, part.match.table, column.name) for column in part.match.columns.values()}
        used.add((part.log, part.match.table, flag_of(sensors, logs[part.log], part)))
    for signal in inputs.signals.values() if inputs is not None else ():
        used.add((signal.log, signal.table, signal.column.name))
        if isinstance(rows := signal.place.get("rows"), Mapping):
            used.add((signal.log, signal.table, str(rows["column"])))
    return used


def _kind_of_table(table: str, columns: Iterable[LogColumn], file: str) -> str:
    """Return the reason for all columns of a table that is not measured; empty for others."""
    if (message := known_message(table, columns, file)) is not None:
        is_measured = message.role in (Role.MEASURED, Role.COMMAND)
        return "" if is_measured else f"{message.source}: {message.role.value}"
    if names.is_set_point(table, ""):
        return "set-points"
    return "output of a navigation filter" if names.is_filter_output(table) else ""


def _reasons(
    log: Log, table: str, unused: Iterable[LogColumn], used: Iterable[str], in_map: Collection[str]
) -> dict[str, list[str]]:
    """Return the names of unused columns by the reason."""
    numbers = [column for column in unused if not column.is_text and not column.name.startswith("@")]
    read: dict[str, Array] = {}
    if len(numbers) <= names.MAX_COLUMNS:
        of_table = log.read(table, [*(column.name for column in numbers), *used])
        read = {key: np.asarray(values, np.float64) for key, values in of_table.items() if values.dtype.kind != "U"}
    others = {key: read[key] for key in used if key in read}
    message = known_message(table, log.tables()[table], log.path.stem)
    fields = {field: component for component, field in message.fields.items()} if message is not None else {}
    reasons: dict[str, list[str]] = {}
    for column in unused:
        reason = _reason(column, read.get(column.name), others)
        component = fields.get(column.name) or names.component_of(column)
        if reason == _UNKNOWN and component in in_map:
            reason = f"another {names.SENSOR_OF.get(component, component)}"
        reasons.setdefault(reason, []).append(column.name)
    return reasons


def _reason(column: LogColumn, values: Array | None, others: Mapping[str, Array]) -> str:
    if column.is_text:
        return "text"
    if column.name in (HEADER_STAMP, LOG_TIME) or any(one.column == column for one in names.time_columns([column])):
        return "another time"
    if names.is_set_point("", column.name):
        return "a set-point?"
    if names.is_filter_output("", column.name):
        return "output of a navigation filter?"
    if values is not None:
        known = values[np.isfinite(values)]
        if not known.size:
            return "no numbers"
        if not np.ptp(known) > 0.0:
            return "constant"
        for name, other in others.items():
            if other.shape == values.shape and np.nanmax(np.abs(values - other)) <= _SAME * np.nanstd(other):
                return f"same as {name}"
    return _UNKNOWN


def _joined_elements(members: Iterable[str]) -> list[str]:
    """Return names in which the elements of a list are joined: ``name[0] to [2]``."""
    runs: list[str] = []
    stems: list[str] = []
    for name in members:
        element = re.fullmatch(r"(?P<stem>.*)\[(?P<index>\d+)\]", name)
        if element is not None and stems and stems[-1] == element["stem"]:
            runs[-1] = f"{runs[-1].split(' to ')[0]} to [{element['index']}]"
        else:
            runs.append(name)
            stems.append(element["stem"] if element is not None else "")
    return runs
