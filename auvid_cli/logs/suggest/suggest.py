"""Suggest a map for a log: sensors, inputs and unused columns."""

import os
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.suggest.evidence import weigh_evidence
from auvid_cli.logs.suggest.inputs import FoundInputs, find_inputs, input_lines, input_tracks, with_numbered_fins
from auvid_cli.logs.suggest.known_formats import known_message
from auvid_cli.logs.suggest.names import is_filter_output, is_set_point
from auvid_cli.logs.suggest.sensors import FoundSensor, expected_of, find_sensors, flag_of, sensor_lines, sensor_tracks
from auvid_cli.logs.suggest.times import align_clocks, time_of
from auvid_cli.logs.suggest.yaml_lines import Comment, Flow, Line, Phrase, YamlEntry, commented_text
from auvid_cli.vehicle.parameters import PARAMETERS

_wrapper = textwrap.TextWrapper(110, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
MAX_TEXT = 64_000_000  # bytes that are read from a text log to recognise its columns


def unused_lines(
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], inputs: FoundInputs | None
) -> Iterator[Comment]:
    """Yield comments that list the columns that the map does not use."""
    used = set[tuple[str, str, str]]()
    for part in (part for sensor in sensors.values() for part in sensor.parts):
        used |= {(part.log, part.match.table, column.name) for column in part.match.columns.values()}
        used.add((part.log, part.match.table, flag_of(sensors, logs[part.log], part)))
    if inputs is not None:
        used |= {(signal.log, signal.table, signal.column.name) for signal in inputs.signals.values()}
    for log in logs:
        for table, columns in logs[log].tables().items():
            time, _ = time_of(logs[log], table)
            times = [str(text) for text in time.values()] if isinstance(time, Mapping) else [time]
            unused = _joined_elements(
                f"{column.name}{_kind_of_column(column.name)}"
                for column in columns
                if (log, table, column.name) not in used and column.name not in times
            )
            if unused:
                message = known_message(table, columns)
                kind = " (output of a navigation filter)" if is_filter_output(table) else ""
                kind = " (set-points)" if is_set_point(table, "") else kind
                kind = f" ({message.source}: {message.role.value})" if message is not None else kind
                where = " ".join(part for part in (log if len(logs) > 1 else "", table) if part)
                text = f"not used{f' of {where}' if where else ''}{kind}: {', '.join(unused)}"
                yield from map(Comment, _wrapper.wrap(text))


def _kind_of_column(column: str) -> str:
    if is_set_point("", column):
        return " (a set-point?)"
    return " (output of a navigation filter?)" if is_filter_output("", column) else ""


def _joined_elements(names: Iterable[str]) -> list[str]:
    """Return names in which the elements of a list are joined: ``name[0] to [2]``."""
    runs: list[str] = []
    stems: list[str] = []
    for name in names:
        element = re.fullmatch(r"(?P<stem>.*)\[(?P<index>\d+)\]", name)
        if element is not None and stems and stems[-1] == element["stem"]:
            runs[-1] = f"{runs[-1].split(' to ')[0]} to [{element['index']}]"
        else:
            runs.append(name)
            stems.append(element["stem"] if element is not None else "")
    return runs


def suggest(logs: Sequence[Log], folder: Path, vehicle: str | None = None) -> str:
    """Return a map suggested from names, units and values of logs, and from relations between their signals.

    Parameters
    ----------
    logs : sequence of Log
    folder : pathlib.Path
        Folder of the map; its paths are relative to it.
    vehicle : str, optional
        Vehicle file as the map names it. Default: the map asks for size and parameters.

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
    names = _log_names(logs)
    files = [YamlEntry(name, _file(log, folder)) for name, log in names.items()]
    align_clocks(names)
    sensors = find_sensors(names)
    measured = sensor_tracks(names, sensors)
    inputs = with_numbered_fins(names, find_inputs(names, measured), measured)
    tracks = measured | input_tracks(names, inputs)
    evidence = weigh_evidence(tracks, expected_of(names, sensors))
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
            YamlEntry("name", next(iter(names))),
            YamlEntry("vehicle", vehicle)
            if vehicle is not None
            else YamlEntry("vehicle", _vehicle(), "or the path of a vehicle file, such as `auvid init` writes"),
            YamlEntry("logs", files),
            YamlEntry("sensors", list(sensor_lines(names, sensors, evidence))),
            YamlEntry("inputs", list(input_lines(names, inputs, evidence))),
            YamlEntry(
                "identification",
                [YamlEntry("tolerances", "usual", "or what you measured, such as {inertia: 2 %, delay: 1 ms}")],
            ),
            *unused_lines(names, sensors, inputs),
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
