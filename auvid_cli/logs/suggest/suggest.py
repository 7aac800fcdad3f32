"""Suggest a map for a log: sensors, inputs and unused columns."""

import os
import re
from collections.abc import Sequence
from pathlib import Path

from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.suggest.evidence import weigh_evidence
from auvid_cli.logs.suggest.found_sensors import sensor_tracks
from auvid_cli.logs.suggest.inputs import find_inputs, input_lines, input_tracks, with_numbered_fins
from auvid_cli.logs.suggest.sensors import expected_of, find_sensors, sensor_lines
from auvid_cli.logs.suggest.times import align_clocks
from auvid_cli.logs.suggest.unused import unused_lines
from auvid_cli.logs.suggest.yaml_lines import Comment, Flow, Line, Phrase, YamlEntry, commented_text
from auvid_cli.vehicle.parameters import PARAMETERS

MAX_TEXT = 64_000_000  # bytes that are read from a text log to recognise its columns


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
