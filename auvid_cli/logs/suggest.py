"""A first map from what logs are seen to hold, for somebody to check and fill in."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.log_columns import unit_factor
from auvid_cli.data.dataset import SENSORS
from auvid_cli.logs.log import HEADER_STAMP, LOG_TIME, Column, Log
from auvid_cli.logs.names import INPUT_NAMES, QUATERNION_NAMES, SENSOR_NAMES, Found, find_in_logs, find_time
from auvid_cli.logs.noise import estimate_noise
from auvid_cli.vehicle.parameters import PARAMETERS

Array = NDArray[np.float64]

# Larger than that is not in radians, or radians per second.
_LARGEST_RADIANS = {"rad": 2.0 * np.pi, "rad/s": 3.0}
_DEGREES = {"rad": "deg", "rad/s": "deg/s"}
# Larger than that are counts.
_LARGEST_FIN_DEGREES, _LARGEST_PERCENT = 90.0, 110.0
_WORDS_OF_YAML = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")
_FLAG = re.compile(r"(.*[_. ])?(valid|validity|is_valid)", re.IGNORECASE)
_PLAIN = re.compile(r"[A-Za-z_/][\w./-]*", re.ASCII)


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
    lines = [
        "# A map suggested by auvid: look at every line with `check:`, replace every null with `required:`.",
        f"name: {next(iter(names))}",
        *_vehicle(),
        "logs:",
        *(f"  {name}: {_quoted(os.path.relpath(log.path, folder))}" for name, log in names.items()),
        "sensors:",
    ]
    sensors = {sensor: find_in_logs(names, wanted, sensor) for sensor, wanted in SENSOR_NAMES.items()}
    quaternion = find_in_logs(names, QUATERNION_NAMES)
    if quaternion is not None and len(quaternion[1].columns) == 4:
        sensors["attitude"] = quaternion
    for sensor, place in sensors.items():
        if place is not None:
            lines += _sensor(sensor, names, *place)
    if not any(sensors.values()):
        lines.append("  # required: no column looks like a sensor; see the guide for what may stand here")
    return "\n".join([*lines, "inputs:", *_inputs(names)]) + "\n"


def _log_names(logs: Sequence[Log]) -> dict[str, Log]:
    names: dict[str, Log] = {}
    for log in logs:
        name = re.sub(r"\W+", "_", log.path.name.split(".")[0], flags=re.ASCII).strip("_")
        # A number would be no name in YAML.
        name = name if name[:1].isalpha() else f"log_{name}".rstrip("_")
        names[name if name not in names else f"{name}_{len(names) + 1}"] = log
    return names


def _vehicle() -> Iterator[str]:
    yield "vehicle: # or the path of a vehicle file"
    yield "  name: my vehicle # check: what you call it"
    yield "  size:"
    yield "    length: null # required: of the hull, such as 1.6 m"
    yield "    diameter: null # required: of the hull, such as 0.19 m"
    yield "  parameters:"
    for quantity in PARAMETERS:
        yield f"    {quantity.symbol}: null # required: {quantity.meaning}, {quantity.unit}"


def _sensor(sensor: str, logs: Mapping[str, Log], name: str, found: Found) -> Iterator[str]:
    columns, quantities = found.columns, SENSORS[sensor]
    values = logs[name].read(found.table, [column.name for column in columns.values()])
    numbers = {component: np.asarray(values[column.name], np.float64) for component, column in columns.items()}
    yield f"  {sensor}:"
    yield from _rows(logs, name, found.table, "    ")
    if set(columns) == set(QUATERNION_NAMES):
        yield "    quaternion:"
        yield from (f"      {axis}: {_quoted(column.name)}" for axis, column in columns.items())
        yield "    frame: FLU # check: FRD, forward-right-down, or FLU, forward-left-up"
        yield "    reference: ENU # check: usual for quaternions in ROS; NED, from north, or ENU, from east"
        yield "    standard_deviation: null # required: noise by the data sheet, or estimate"
        return
    yield "    columns:"
    for component, column in columns.items():
        if component == "down" and np.nanmedian(numbers[component]) < 0.0:
            yield f"      down: {{column: {_quoted(column.name)}, sign: -1}} # check: it is mostly negative"
        else:
            yield f"      {component}: {_quoted(column.name)}"
    missing = [quantity.symbol for quantity in quantities if quantity.symbol not in columns]
    if missing:
        yield f"      # check: no column found for {', '.join(missing)}"
    unit, comment = _unit(list(columns.values()), numbers, quantities[0].unit)
    yield f"    unit: {_quoted(unit)} # {comment}"
    factor = unit_factor(unit, quantities[0].unit)
    si = {component: factor * own for component, own in numbers.items()}
    yield from _axes(sensor, si)
    flag = next((column.name for column in logs[name].tables()[found.table] if _FLAG.fullmatch(column.name)), None)
    if flag is not None:
        yield f"    valid: {{column: {_quoted(flag)}, values: [true, 1]}} # check: which values mean valid"
    noise = [estimate_noise(own, quantities[0].unit == "rad").standard_deviation for own in si.values()]
    known = ", ".join(f"{one:.2g}" for one in noise if one > 0.0)
    hint = f"; the signals look like {known} {quantities[0].unit}" if known else ""
    yield f"    standard_deviation: null # required: noise by the data sheet, or estimate{hint}"


def _rows(logs: Mapping[str, Log], name: str, table: str, indent: str) -> Iterator[str]:
    """Where columns stand, as far as it must be said."""
    if len(logs) > 1:
        yield f"{indent}log: {name}"
    if table:
        yield f"{indent}table: {_quoted(table)}"
    columns = logs[name].tables()[table]
    time = find_time(columns)
    if time is None:
        some = ", ".join(column.name for column in columns[:8])
        yield f"{indent}time: null # required: the column with the times; there is {some}"
    elif time.name == HEADER_STAMP and not np.unique(logs[name].read(table, [HEADER_STAMP])[HEADER_STAMP]).size > 1:
        yield f"{indent}time: '{LOG_TIME}' # check: the header stamps never change"
    elif time.name in (HEADER_STAMP, LOG_TIME):
        yield f"{indent}time: '{time.name}' # check: the clock of the others too?"
    else:
        yield f"{indent}time: {{column: {_quoted(time.name)}{_time_unit(logs[name], table, time)}"


def _time_unit(log: Log, table: str, time: Column) -> str:
    if time.is_text or time.unit:
        return "} # check: as text, mm:ss.s, HH:MM:SS or dates" if time.is_text else "}"
    steps = np.diff(np.asarray(log.read(table, [time.name])[time.name], np.float64))
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    unit = "s" if step < 50.0 else "ms" if step < 5e3 else "us" if step < 5e6 else "ns"
    return f", unit: {unit}}} # check: its median step is {step:.4g}"


def _unit(columns: Sequence[Column], numbers: Mapping[str, Array], si: str) -> tuple[str, str]:
    """Unit of columns, and why."""
    stated = {column.unit for column in columns}
    if len(stated) == 1 and (unit := stated.pop()):
        try:
            unit_factor(unit, si)
        except ValueError:
            return si, f"check: the log says {unit!r}"
        return unit, "as the log says"
    largest = max(float(np.nanmax(np.abs(values), initial=0.0)) for values in numbers.values())
    if si in _DEGREES and largest > _LARGEST_RADIANS[si]:
        return _DEGREES[si], f"check: values reach {largest:.4g}"
    return si, f"check: values reach {largest:.4g}"


def _axes(sensor: str, numbers: Mapping[str, Array]) -> Iterator[str]:
    """Axes that the numbers, in SI, speak for."""
    if sensor == "accelerometer" and "fz" in numbers:
        mean = float(np.nanmean(numbers["fz"]))
        yield f"    frame: {'FLU' if mean > 0.0 else 'FRD'} # check: fz is {mean:.3g} on average, of FRD it is negative"
    elif sensor == "attitude":
        yield "    frame: FRD # check: FRD, forward-right-down, or FLU, forward-left-up"
        yield "    reference: NED # check: a turn to starboard makes psi grow; NED, psi from north, or ENU, from east"
        if "phi" in numbers and np.nanmedian(np.abs(numbers["phi"])) > 0.75 * np.pi:
            yield "    mount: upside down # check: roll is about 180 deg"
    elif sensor in ("gyroscope", "dvl"):
        positive = "r" if sensor == "gyroscope" else "v"
        yield f"    frame: FRD # check: in FRD a turn or drift to starboard makes {positive} positive, in FLU negative"


def _inputs(logs: Mapping[str, Log]) -> Iterator[str]:
    place = find_in_logs(logs, INPUT_NAMES)
    if place is None:
        yield "  rudder: null # required: no column looks like a fin or a propeller"
        return
    name, found = place
    yield from _rows(logs, name, found.table, "  ")
    values = logs[name].read(found.table, [column.name for column in found.columns.values()])
    direct = {key: column for key, column in found.columns.items() if "." not in key}
    fins = {key: column for key, column in found.columns.items() if key.startswith("fins.")}
    numbers = {key: np.asarray(values[column.name], np.float64) for key, column in found.columns.items()}
    if fins and ("rudder" in direct or "elevator" in direct):
        fins = {}
    deflecting = [*fins, *(key for key in direct if key in ("rudder", "elevator"))]
    largest = max((float(np.nanmax(np.abs(numbers[key]))) for key in deflecting), default=0.0)
    for key, column in direct.items():
        if key in deflecting:
            yield _fin(f"  {key}", column, numbers[key], largest)
        else:
            yield f"  {key}: {{column: {_quoted(column.name)}}} # check: in N, or N m"
    if fins:
        yield "  fins: # check: positive pushes the tail to starboard, or up; else sign: -1"
        for key, column in fins.items():
            yield _fin(f"    {key.removeprefix('fins.')}", column, numbers[key], largest)
    if {"fins.right", "fins.left"} <= set(fins) and _are_opposite(numbers["fins.right"], numbers["fins.left"]):
        yield "    # check: right and left go against each other, so one of them counts the other way: sign: -1"
    others = [column.name for column in logs[name].tables()[found.table] if "fin" in column.name.lower()]
    if not deflecting:
        yield f"  # check: no column is called like a fin{'; these may be fins: ' if others else ''}{', '.join(others)}"
    yield from _thrust(found, numbers)


def _are_opposite(one: Array, other: Array) -> bool:
    return float(np.nanstd(one + other)) < 0.5 * float(np.nanstd(one - other))


def _thrust(found: Found, numbers: Mapping[str, Array]) -> Iterator[str]:
    if "surge_force" in found.columns:
        return
    if "thrust.revolutions" in found.columns:
        yield "  thrust:"
        column = found.columns["thrust.revolutions"]
        yield f"    revolutions: {{column: {_quoted(column.name)}, unit: rpm}} # check: rpm, or turn/s"
        yield "    a: null # required: force = a n|n|, such as 0.05 N*s^2"
    elif "thrust.share" in found.columns:
        column, largest = found.columns["thrust.share"], float(np.nanmax(np.abs(numbers["thrust.share"])))
        counts = ", centre: 128, scale: 0.787 percent" if largest > _LARGEST_PERCENT else ""
        yield "  thrust:"
        yield f"    share: {{column: {_quoted(column.name)}{counts}}} # check: in percent; it reaches {largest:.4g}"
        yield "    full: null # required: force at 100 percent, such as 20 N"
    else:
        yield "  # check: no column looks like thrust: it will be zero"


def _fin(key: str, column: Column, values: Array, largest: float) -> str:
    name, spread = _quoted(column.name), f"it goes from {np.nanmin(values):.4g} to {np.nanmax(values):.4g}"
    if column.unit:
        return f"{key}: {{column: {name}}} # {column.unit} as the log says; check: sign"
    if largest > _LARGEST_FIN_DEGREES:
        return f"{key}: {{column: {name}, centre: 128, scale: null}} # required: one count, such as 0.35 deg; {spread}"
    unit = "deg" if largest > 0.5 * np.pi else "rad"
    return f"{key}: {{column: {name}, unit: {unit}}} # check: unit and sign; {spread}"


def _quoted(name: str) -> str:
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS_OF_YAML:
        return name
    return "'" + name.replace("'", "''") + "'"
