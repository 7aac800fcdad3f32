"""Sensors of a suggested map, by names, units, values and evidence."""

from collections.abc import Iterator, Mapping

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.signals import estimate_noise, is_smoothed
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.suggest import names
from auvid_cli.logs.suggest.behaviour import with_behaviour
from auvid_cli.logs.suggest.evidence import MIN_GRAVITY, OVER_GROUND, ROTATED, TRIPLES, USUAL_AXES, Evidence
from auvid_cli.logs.suggest.found_sensors import (
    FoundSensor,
    flag_of,
    is_over_ground,
    is_upside_down,
    part_tracks,
    sensor_tracks,
    valid_value,
    with_unfiltered,
)
from auvid_cli.logs.suggest.known_formats import known_message
from auvid_cli.logs.suggest.numbered import in_usual_order, numbered_attitude
from auvid_cli.logs.suggest.rows import Found, found_in, place_of, row_entries
from auvid_cli.logs.suggest.times import time_of
from auvid_cli.logs.suggest.units import Columns, possible_units
from auvid_cli.text import Comment, Flow, Line, Phrase, YamlEntry
from auvid_cli.vehicle.parameters import SENSORS

_EARTH_AXES = {"FRD": "NED", "FLU": "ENU"}
_HEADINGS = {"NED": "clockwise from north", "ENU": "anticlockwise from east"}
_MANY_REPEATS = 0.5  # share of rows that repeat the one before
# Log likelihoods by conventions and names.
_CONVENTION = 6.0  # axes of a standard message, or of a velocity with north and east in its names
_MIRROR = 30.0  # axes of a known message that are not a mirror image
_QUATERNION = 2.0  # FLU axes for a quaternion
_HANGING = 2.0  # FLU axes for the DVL of a vehicle with an attitude upside down
_HEADING = 1.5  # usual sign of a column with heading in its name
_EAST = 8.0  # opposite sign of a heading with ENU in its name
_BODY_AXES = 4.0  # FRD axes of an attitude with ENU in its name


def find_sensors(logs: Mapping[str, Log]) -> dict[str, FoundSensor]:
    """Return the sensors whose names a log contains."""
    places = {
        sensor: names.find_in_logs(logs, wanted, sensor, SENSORS[sensor][0].unit)
        for sensor, wanted in names.SENSOR_NAMES.items()
    }
    # Names of earth axes only if there are none of body axes: a velocity has one or the other.
    places["dvl"] = places["dvl"] or names.find_in_logs(logs, names.EARTH_VELOCITY, "dvl", SENSORS["dvl"][0].unit)
    quaternion, angles = names.find_in_logs(logs, names.QUATERNION_NAMES), places["attitude"]
    if quaternion is not None and len(quaternion[1].columns) == 4:
        is_measured = angles is not None and not angles[1].is_filter_output
        if not (is_measured and quaternion[1].is_filter_output):
            places["attitude"] = quaternion
    found: dict[str, FoundSensor] = {}
    for sensor, place in places.items():
        if place is not None:
            main = found_in(logs, sensor, *place)
            found[sensor] = FoundSensor(main, [] if main.is_quaternion else _apart(logs, main))
    if "attitude" not in found:
        found |= numbered_attitude(logs, found)
    found = with_unfiltered(logs, with_behaviour(logs, found))
    return _with_units(logs, in_usual_order(found, sensor_tracks(logs, found)))


def _with_units(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return sensors with the units that remain possible."""
    parts = [part for sensor in sensors.values() for part in sensor.parts]
    columns = []
    for part in parts:
        numbers = part.si() if part.is_quaternion else part.numbers
        tracks = part_tracks(logs, sensors, part, numbers)
        is_stated = part.is_stated or part.is_quaternion
        columns.append(Columns(part.sensor, tracks, part.unit if is_stated else ""))
    is_over_ground = "dvl" in sensors and names.is_over_ground(sensors["dvl"].main.match.columns)
    verdicts = possible_units(columns, is_over_ground)
    known = [
        part._replace(units=units, comment="; ".join(filter(None, (part.comment, reason))))
        for part, (units, reason) in zip(parts, verdicts, strict=True)
    ]
    return {
        name: sensor._replace(main=own[0], apart=own[1:])
        for name, sensor in sensors.items()
        if (own := [part for part in known if part.sensor == name])
    }


def _apart(logs: Mapping[str, Log], main: Found) -> list[Found]:
    """Return components from other tables; outputs of a filter only if the main columns are such too."""
    apart, sensor = [], main.sensor
    for component, pattern in names.SENSOR_NAMES[sensor].items():
        missing = {} if component in main.numbers else {component: pattern}
        place = names.find_in_logs(logs, missing, sensor, SENSORS[sensor][0].unit)
        if place is None or (place[1].is_filter_output and not main.match.is_filter_output):
            continue
        if time_of(logs[place[0]], place[1].table)[0]:
            apart.append(found_in(logs, sensor, *place))
    return apart


def expected_of(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, dict[str, float]]:
    """Return log likelihoods of axes and signs by names and conventions, see `likely_signs`."""
    expected: dict[str, dict[str, float]] = {}
    for name, (main, apart, _, is_exchanged, _) in sensors.items():
        if is_exchanged:
            signs = zip(TRIPLES[name], _signs_of_exchanged(main), strict=True)
            expected |= {symbol: {"+": sign * _CONVENTION} for symbol, sign in signs}
        convention = _convention(logs[main.log], main.match.table)
        if main.is_right_forward_up:
            expected[name] = {"FRD": _CONVENTION, ROTATED: _MIRROR}
        elif convention is not None:
            expected[name] = {convention[0]: _CONVENTION, ROTATED: _MIRROR}
        elif main.is_quaternion:
            expected[name] = {"FLU": _QUATERNION, ROTATED: _MIRROR}
        if main.match.message is not None and not main.match.message.is_of_bottom:
            expected.setdefault(name, {})[ROTATED] = _MIRROR
        for part in (main, *apart):
            if "psi" in part.match.columns:
                column = part.match.columns["psi"].name.lower()
                expected["psi"] = {"+": -_EAST if "enu" in column else _HEADING if "heading" in column else 0.0}
                if "enu" in column and convention is None:
                    # The name of a heading does not concern the body axes.
                    expected.setdefault(name, {"FRD": _BODY_AXES})
    if "dvl" in sensors and is_over_ground(sensors["dvl"].main.match):
        expected["dvl"] = {OVER_GROUND: _CONVENTION}
    if "dvl" in sensors and "attitude" in sensors and is_upside_down(sensors["attitude"].main.si().get("phi")):
        expected.setdefault("dvl", {"FLU": _HANGING})
    return expected


def _signs_of_exchanged(main: Found) -> tuple[float, float, float]:
    """Return the signs of components whose axes point to starboard, ahead and up; x may also point to port."""
    ahead = float(np.nanmean(main.numbers["u"])) if "u" in main.numbers else 1.0
    turned = -1.0 if ahead < 0.0 else 1.0
    # The bottom moves against the vehicle, along all axes.
    is_of_bottom = main.match.message is not None and main.match.message.is_of_bottom and turned < 0.0
    return turned, turned, 1.0 if is_of_bottom else -1.0


def sensor_lines(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], evidence: Evidence) -> Iterator[Line]:
    """Yield the lines below `sensors:`."""
    for name, sensor in sensors.items():
        is_output = sensor.main.match.is_filter_output
        comment = "check: by its name the output of a navigation filter, not a measurement" if is_output else ""
        yield YamlEntry(name, list(_sensor(logs, sensors, sensor, evidence)), comment)
    if not sensors and (unnamed := names.without_names(logs)):
        yield Comment(
            f"required: {unnamed} have no names: write sensors here, such as depth: {{columns: {{down: 'data[3]'}}}}"
        )
    elif not sensors:
        yield Comment(
            "required: no column looks like a sensor, and outputs of a navigation filter do not count: log measured "
            "motion (velocities u, v, w of a DVL; turn rates p, q, r; roll, pitch and yaw; depth), see "
            "docs/how-to/import-logs.md"
        )


def _sensor(
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], found: FoundSensor, evidence: Evidence
) -> Iterator[Line]:
    main, name = found.main, found.main.sensor
    log = logs[main.log]
    convention = _convention(log, main.match.table)
    frame = _frame(name, evidence, convention[0] if convention is not None else "")
    yield from row_entries(logs, main.log, main.match.table, evidence.delays.get(name, 0.0))
    yield from map(Comment, found.notes)
    if main.is_quaternion:
        yield YamlEntry("quaternion", [YamlEntry(axis, column.name) for axis, column in main.match.columns.items()])
    else:
        yield YamlEntry("columns", list(_columns(logs, found, frame, evidence)))
        yield main.unit_entry()
    yield from _axes(log, found, frame, evidence)
    yield from _repeats(main.numbers)
    yield from _valid(sensors, log, main)
    if codes := sorted({code for part in found.parts for code in part.codes}):
        count = sum(part.marked for part in found.parts)
        numbers = tuple(Phrase(f"{code:.10g}") for code in codes)
        yield YamlEntry("missing", numbers, f"check: numbers without a measurement, in {count} rows")
    if main.zeros:
        yield YamlEntry("zeros", "drop", f"check: all components are zero in {main.zeros} rows: no measurement?")
    si = main.si()
    unit = SENSORS[name][0].unit
    noise = [estimate_noise(signal, unit == "rad").standard_deviation for signal in si.values()]
    scatter = ", ".join(f"{deviation:.2g}" for deviation in noise if deviation > 0.0)
    is_known = len(main.units) == 1 and not main.is_quaternion
    hint = f"; scatter of the signals: {scatter} {unit}" if scatter and is_known else ""
    # The errors of an AHRS or of a filtered signal are autocorrelated and larger than its scatter.
    if name != "attitude" and min(noise) > 0.0 and not any(is_smoothed(signal) for signal in si.values()):
        yield YamlEntry("standard_deviation", "estimate", f"check: noise by the data sheet is better{hint}")
    else:
        yield YamlEntry("standard_deviation", None, f"required: noise by the data sheet, or the word estimate{hint}")


def _frame(sensor: str, evidence: Evidence, convention: str) -> str:
    """Return the usual axes nearest to the signs of a sensor; the convention decides between equals."""
    if sensor == "dvl" and evidence.over_ground:
        return evidence.over_ground
    signs = [evidence.verdict.signs.get(symbol, 0) for symbol in TRIPLES.get(sensor, ())]
    n_reversed = {
        axes: sum(sign == -usual for sign, usual in zip(signs, of_axes, strict=False))
        for axes, of_axes in USUAL_AXES.items()
    }
    return min(n_reversed, key=lambda axes: (n_reversed[axes], axes != convention))


def _columns(logs: Mapping[str, Log], found: FoundSensor, frame: str, evidence: Evidence) -> Iterator[Line]:
    name, present = found.main.sensor, set[str]()
    for part in found.parts:
        for component, column in part.match.columns.items():
            present.add(component)
            if question := dict(found.questions).get(component):
                yield YamlEntry(component, None, f"required: {question}")
                continue
            place: dict[str, Flow] = {}
            comment = ""
            if part is not found.main:
                unit: Flow = part.unit if len(part.units) == 1 else None
                place = (place_of(logs, part.log, part.match.table) or {}) | {"unit": unit}
                comment = part.unit_entry().comment
            more: dict[str, Flow] = {}
            if _is_reversed(part, component, frame, evidence):
                more = {"sign": -1, "offset": Phrase("90 deg")} if component == "psi" else {"sign": -1}
                sign = f"check: opposite sign; {evidence.words([component])}"
                comment = "; ".join(filter(None, (comment, sign)))
            entry = {**place, "column": column.name, **more} if place or more else column.name
            yield YamlEntry(component, entry, comment)
    missing = [quantity.symbol for quantity in SENSORS[name] if quantity.symbol not in present]
    if missing:
        yield Comment(f"check: no column found for {', '.join(missing)}")


def _is_reversed(part: Found, component: str, frame: str, evidence: Evidence) -> bool:
    """Whether the evidence contradicts the sign of a component in the axes of its sensor."""
    if part.is_right_forward_up or (part.sensor == "dvl" and evidence.over_ground):
        return False
    axis = TRIPLES.get(part.sensor, (component,)).index(component)
    usual = USUAL_AXES.get(frame, (1, 1, 1))[axis]
    return evidence.verdict.signs.get(component, usual) != usual


def _is_heading_turned(found: FoundSensor, frame: str, evidence: Evidence) -> bool:
    """Whether the map states sign and offset of the heading, so that it has the reference of the axes."""
    is_asked = "psi" in dict(found.questions)
    parts = [part for part in found.parts if "psi" in part.match.columns and not is_asked]
    return any(_is_reversed(part, "psi", frame, evidence) for part in parts)


def _axes(log: Log, found: FoundSensor, frame: str, evidence: Evidence) -> Iterator[Line]:
    """Yield the axes of a sensor that has some, with the evidence for them."""
    name = found.main.sensor
    if name not in TRIPLES:
        return
    convention = _convention(log, found.main.match.table)
    reasons = [evidence.words([symbol for symbol in TRIPLES[name] if symbol in evidence.verdict.signs])]
    if convention is not None:
        reasons.append(convention[1])
    elif found.main.is_quaternion:
        reasons.append("FLU is usual for quaternions in ROS")
    if evidence.over_ground and name == "dvl":
        is_named = is_over_ground(found.main.match)
        reasons = [
            "velocity over ground " + ("by its names" if is_named else "because its direction follows the heading")
        ]
    words = "; ".join(reason for reason in reasons if reason)
    if found.main.is_right_forward_up:
        yield YamlEntry("frame", "FRD", "check: axes to starboard, ahead and up: depth follows the roll of the log")
        yield YamlEntry("reference", "ENU", "check: east, north, up")
        mount = {axis: Phrase(f"{angle} deg") for axis, angle in (("roll", 180), ("pitch", 0), ("yaw", 90))}
        yield YamlEntry("mount", mount, "axes to starboard, ahead and up in those of the body")
        return
    yield YamlEntry("frame", frame, f"check: {words or 'no evidence for the axes'}")
    if name == "attitude":
        reference = _EARTH_AXES[frame]
        if _is_heading_turned(found, frame, evidence):
            meaning = f"psi is {_HEADINGS[reference]} with its sign and offset"
        else:
            meaning = "check: NED (psi clockwise from north) or ENU (anticlockwise from east)?"
        yield YamlEntry("reference", reference, meaning)
        if is_upside_down(found.main.si().get("phi")):
            yield YamlEntry("mount", Phrase("upside down"), "check: roll is about 180 deg")


def _valid(sensors: Mapping[str, FoundSensor], log: Log, main: Found) -> Iterator[Line]:
    if flag := flag_of(sensors, log, main):
        value = valid_value(main, np.asarray(log.read(main.match.table, [flag])[flag], np.float64))
        values = (True, 1) if value == 1 else (value,)
        yield YamlEntry("valid", {"column": flag, "values": values}, "check: values of valid rows")


def _convention(log: Log, table: str) -> tuple[str, str] | None:
    """Return the axes of a standard message of ROS and the reason; gravity may contradict the convention."""
    columns = log.tables()[table]
    message = known_message(table, columns, log.path.stem)
    if message is not None:
        is_fixed = message.frame in USUAL_AXES
        return (message.frame, f"{message.source} states {message.frame} axes") if is_fixed else None
    kind = names.standard_message(columns)
    if not kind:
        return None
    for place in names.find_columns({"fz": names.SENSOR_NAMES["accelerometer"]["fz"]}, {table: columns}):
        column = place.columns["fz"].name
        up = np.asarray(log.read(table, [column])[column], np.float64)
        if np.isfinite(up).any() and (mean := float(np.nanmean(up))) < -MIN_GRAVITY:
            return "FRD", f"{kind} is FLU by REP 103, but the mean of {column} is {mean:.3g}"
    return "FLU", f"{kind} is FLU by REP 103"


def _repeats(numbers: Mapping[str, Array]) -> Iterator[Line]:
    """Yield a comment if most rows repeat the one before."""
    values = np.column_stack([*numbers.values()])
    values = values[np.isfinite(values).any(axis=1)]
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    share = float(same.all(axis=1).mean()) if len(values) > 1 else 0.0
    if share > _MANY_REPEATS:
        repeated = f"{100.0 * share:.0f} % of the rows repeat the one before"
        yield Comment(f"check: {repeated}; remove them with `repeats: drop`")
