"""A first map from what logs are seen to hold, for somebody to check and fill in."""

import os
import re
from collections.abc import Sequence
from pathlib import Path

from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.suggest.commented_yaml import Comment, Line, Phrase, YamlEntry, commented_text
from auvid_cli.logs.suggest.inputs import find_inputs, input_lines, input_tracks
from auvid_cli.logs.suggest.judge import judge
from auvid_cli.logs.suggest.sensors import expected_of, find_sensors, sensor_lines, sensor_tracks
from auvid_cli.logs.suggest.unused import unused_lines
from auvid_cli.vehicle.parameters import PARAMETERS


def suggest(logs: Sequence[Log], folder: Path) -> str:
    """Write a map by the names, units and values in logs, and by what agrees best in them.

    Parameters
    ----------
    logs : sequence of Log
    folder : pathlib.Path
        Where the map is to be: its paths are relative to it.

    Returns
    -------
    str
        YAML, in which ``# check:`` marks what was guessed, and null with ``# required:`` what only the user knows; what
        the data say for a line stands beside it, and below it all columns that it leaves out.

    Raises
    ------
    FileError
        If a log is damaged.
    """
    names = _log_names(logs)
    files = [YamlEntry(name, os.path.relpath(log.path, folder)) for name, log in names.items()]
    sensors, inputs = find_sensors(names), find_inputs(names)
    tracks = sensor_tracks(names, sensors) | input_tracks(names, inputs)
    guessed = {name: sensor.main.unit for name, sensor in sensors.items() if not sensor.main.is_stated}
    judged = judge(tracks, expected_of(names, sensors), guessed)
    return commented_text(
        [
            Comment("A map suggested by auvid: look at every line with `check:`, replace every null with `required:`."),
            YamlEntry("name", next(iter(names))),
            YamlEntry("vehicle", _vehicle(), "or the path of a vehicle file, such as `auvid init` writes"),
            YamlEntry("logs", files),
            YamlEntry("sensors", list(sensor_lines(names, sensors, judged))),
            YamlEntry("inputs", list(input_lines(names, inputs, judged))),
            *unused_lines(names, sensors, inputs),
        ]
    )


def _log_names(logs: Sequence[Log]) -> dict[str, Log]:
    names: dict[str, Log] = {}
    for log in logs:
        name = re.sub(r"\W+", "_", log.path.name.split(".")[0], flags=re.ASCII).strip("_")
        # A number would be no name in YAML.
        name = name if name[:1].isalpha() else f"log_{name}".rstrip("_")
        names[name if name not in names else f"{name}_{len(names) + 1}"] = log
    return names


def _vehicle() -> list[Line]:
    size: list[Line] = [
        YamlEntry("length", None, "required: of the hull, such as 1.6 m"),
        YamlEntry("diameter", None, "required: of the hull, such as 0.19 m"),
    ]
    parameters = [
        YamlEntry(quantity.symbol, None, f"required: {quantity.meaning}, {quantity.unit}") for quantity in PARAMETERS
    ]
    name = YamlEntry("name", Phrase("my vehicle"), "check: what you call it")
    return [name, YamlEntry("size", size), YamlEntry("parameters", parameters)]
