"""A first map from what logs are seen to hold, for somebody to check and fill in."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.log_columns import unit_factor
from auvid_cli.config.magnitudes import magnitude_of
from auvid_cli.data.noise import estimate_noise
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest.commented_yaml import Comment, Line, Phrase, YamlEntry, commented_text
from auvid_cli.logs.suggest.inputs import input_lines
from auvid_cli.logs.suggest.names import (
    QUATERNION_NAMES,
    SENSOR_NAMES,
    Match,
    find_columns,
    find_in_logs,
    named_unit,
    standard_message,
)
from auvid_cli.logs.suggest.rows import row_entries
from auvid_cli.vehicle.parameters import PARAMETERS, SENSORS

Array = NDArray[np.float64]

# Larger than that is not in radians, or radians per second.
_LARGEST_RADIANS = {"rad": 2.0 * np.pi, "rad/s": 3.0}
_DEGREES = {"rad": "deg", "rad/s": "deg/s"}
# Axes of the earth that go with those of the body.
_EARTH = {"FRD": "NED", "FLU": "ENU"}
# m/s^2, of a mean specific force that tells up from down.
_SOME_GRAVITY = 5.0
# Of rows that are as the one before: more than that are rather a slower sensor's last value.
_MANY_REPEATS = 0.5
_FLAG = re.compile(r"(.*[_. ])?(valid|validity|is_valid)", re.IGNORECASE)


def suggest(logs: Sequence[Log], folder: Path) -> str:
    """Write a map by the names, units and values in logs.

    Parameters
    ----------
    logs : sequence of Log
    folder : pathlib.Path
        Where the map is to be: its paths are relative to it.

    Returns
    -------
    str
        YAML, in which ``# check:`` marks what was guessed, and null with ``# required:`` what only the user knows.

    Raises
    ------
    FileError
        If a log is damaged.
    """
    names = _log_names(logs)
    files = [YamlEntry(name, os.path.relpath(log.path, folder)) for name, log in names.items()]
    return commented_text(
        [
            Comment("A map suggested by auvid: look at every line with `check:`, replace every null with `required:`."),
            YamlEntry("name", next(iter(names))),
            YamlEntry("vehicle", _vehicle(), "or the path of a vehicle file"),
            YamlEntry("logs", files),
            YamlEntry("sensors", list(_sensors(names))),
            YamlEntry("inputs", list(input_lines(names))),
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


def _sensors(logs: Mapping[str, Log]) -> Iterator[Line]:
    places = {
        sensor: find_in_logs(logs, wanted, sensor, SENSORS[sensor][0].unit) for sensor, wanted in SENSOR_NAMES.items()
    }
    quaternion = find_in_logs(logs, QUATERNION_NAMES)
    if quaternion is not None and len(quaternion[1].columns) == 4:
        places["attitude"] = quaternion
    for sensor, place in places.items():
        if place is not None:
            yield YamlEntry(sensor, list(_sensor(sensor, logs, *place)))
    if not any(places.values()):
        yield Comment("required: no column looks like a sensor; see the guide for what may stand here")


def _sensor(sensor: str, logs: Mapping[str, Log], name: str, match: Match) -> Iterator[Line]:
    log, columns, quantities = logs[name], match.columns, SENSORS[sensor]
    values = log.read(match.table, [column.name for column in columns.values()])
    numbers = {component: np.asarray(values[column.name], np.float64) for component, column in columns.items()}
    yield from row_entries(logs, name, match.table)
    if set(columns) == set(QUATERNION_NAMES):
        yield YamlEntry("quaternion", [YamlEntry(axis, column.name) for axis, column in columns.items()])
        frame, why = _convention(log, match.table) or ("FLU", "usual for quaternions in ROS")
        yield YamlEntry("frame", frame, f"check: {why}; FRD, forward-right-down, or FLU, forward-left-up")
        yield YamlEntry("reference", _EARTH[frame], "check: likewise; NED, from north, or ENU, from east")
        yield from _repeats(numbers)
        yield YamlEntry("standard_deviation", None, "required: noise by the data sheet, or estimate")
        return
    yield YamlEntry("columns", list(_columns(sensor, columns, numbers)))
    unit, comment = _unit(list(columns.values()), numbers, quantities[0].unit)
    yield YamlEntry("unit", unit, comment)
    factor = unit_factor(unit, quantities[0].unit)
    most = magnitude_of(quantities[0].unit).most / factor
    si = {component: factor * np.where(np.abs(raw) <= most, raw, np.nan) for component, raw in numbers.items()}
    yield from _axes(sensor, si, _convention(log, match.table))
    yield from _repeats(si)
    flags = [column.name for column in log.tables()[match.table] if _FLAG.fullmatch(column.name)]
    if flags:
        # Of "velocity_valid" and "beams[0].valid" that of the whole message.
        flag = min(flags, key=lambda name: name.count("."))
        yield YamlEntry("valid", {"column": flag, "values": (True, 1)}, "check: which values mean valid")
    noise = [estimate_noise(signal, quantities[0].unit == "rad").standard_deviation for signal in si.values()]
    known = ", ".join(f"{deviation:.2g}" for deviation in noise if deviation > 0.0)
    hint = f"; the signals look like {known} {quantities[0].unit}" if known else ""
    yield YamlEntry("standard_deviation", None, f"required: noise by the data sheet, or estimate{hint}")


def _columns(sensor: str, columns: Mapping[str, LogColumn], numbers: Mapping[str, Array]) -> Iterator[Line]:
    for component, column in columns.items():
        if component == "down" and np.nanmedian(numbers[component]) < 0.0:
            yield YamlEntry("down", {"column": column.name, "sign": -1}, "check: it is mostly negative")
        else:
            yield YamlEntry(component, column.name)
    missing = [quantity.symbol for quantity in SENSORS[sensor] if quantity.symbol not in columns]
    if missing:
        yield Comment(f"check: no column found for {', '.join(missing)}")


def _unit(columns: Sequence[LogColumn], numbers: Mapping[str, Array], si: str) -> tuple[str, str]:
    """Guess the unit of columns, and say why."""
    units = {column.unit for column in columns}
    if len(units) == 1 and (unit := units.pop()):
        try:
            unit_factor(unit, si)
        except ValueError:
            return si, f"check: the log says {unit!r}"
        return unit, "as the log says"
    largest = max(float(np.nanmax(np.abs(values), initial=0.0)) for values in numbers.values())
    named = {named_unit(column.name, si) for column in columns}
    if len(named) == 1 and (unit := named.pop()):
        return unit, f"as the name says; check: values reach {largest:.4g}"
    if si in _DEGREES and largest > _LARGEST_RADIANS[si]:
        return _DEGREES[si], f"check: values reach {largest:.4g}"
    return si, f"check: values reach {largest:.4g}"


def _convention(log: Log, table: str) -> tuple[str, str] | None:
    """Guess the axes of all sensors of a message by a convention of ROS, unless gravity contradicts, and say why."""
    columns = log.tables()[table]
    kind = standard_message(columns)
    if not kind:
        return None
    for place in find_columns({"fz": SENSOR_NAMES["accelerometer"]["fz"]}, {table: columns}):
        column = place.columns["fz"].name
        up = np.asarray(log.read(table, [column])[column], np.float64)
        if np.isfinite(up).any() and (mean := float(np.nanmean(up))) < -_SOME_GRAVITY:
            return "FRD", f"{kind} is FLU by REP 103, but {column} is {mean:.3g} on average"
    return "FLU", f"{kind} is FLU by REP 103"


def _repeats(numbers: Mapping[str, Array]) -> Iterator[Line]:
    """Comment on rows of which most are as the one before."""
    values = np.column_stack([*numbers.values()])
    values = values[np.isfinite(values).any(axis=1)]
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    share = float(same.all(axis=1).mean()) if len(values) > 1 else 0.0
    if share > _MANY_REPEATS:
        repeated = f"{100.0 * share:.0f} % of the rows repeat the one before"
        yield Comment(f"check: {repeated}; `repeats: drop` leaves them out")


def _axes(sensor: str, numbers: Mapping[str, Array], convention: tuple[str, str] | None) -> Iterator[Line]:
    """Guess axes by a convention or by the numbers, in SI."""
    if convention is not None and sensor in ("accelerometer", "gyroscope", "dvl", "attitude"):
        frame, why = convention
        yield YamlEntry("frame", frame, f"check: {why}")
        if sensor == "attitude":
            yield YamlEntry("reference", _EARTH[frame], "check: likewise")
    elif sensor == "accelerometer" and "fz" in numbers:
        mean = float(np.nanmean(numbers["fz"]))
        yield YamlEntry(
            "frame", "FLU" if mean > 0.0 else "FRD", f"check: fz is {mean:.3g} on average, of FRD it is negative"
        )
    elif sensor == "attitude":
        yield YamlEntry("frame", "FRD", "check: FRD, forward-right-down, or FLU, forward-left-up")
        yield YamlEntry(
            "reference", "NED", "check: a turn to starboard makes psi grow; NED, psi from north, or ENU, from east"
        )
        if "phi" in numbers and np.nanmedian(np.abs(numbers["phi"])) > 0.75 * np.pi:
            yield YamlEntry("mount", Phrase("upside down"), "check: roll is about 180 deg")
    elif sensor in ("gyroscope", "dvl"):
        positive = "r" if sensor == "gyroscope" else "v"
        turning = f"in FRD a turn or drift to starboard makes {positive} positive, in FLU negative"
        yield YamlEntry("frame", "FRD", f"check: {turning}")
