"""The part of a suggested map that says what each sensor measures, by names, units, values and evidence."""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.signals import estimate_noise
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.suggest.judge import OVER_GROUND, TRIPLES, USUAL_AXES, Evidence
from auvid_cli.logs.suggest.names import (
    EARTH_VELOCITY,
    QUATERNION_NAMES,
    SENSOR_NAMES,
    find_columns,
    find_in_logs,
    is_over_ground,
    standard_message,
)
from auvid_cli.logs.suggest.rows import (
    Comment,
    Flow,
    Found,
    Line,
    Phrase,
    YamlEntry,
    found_in,
    row_entries,
    time_of,
    tracks_of,
)
from auvid_cli.logs.suggest.ties import Track
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]

# Axes of the earth that go with those of the body.
_EARTH = {"FRD": "NED", "FLU": "ENU"}
# m/s^2, of a mean specific force that tells up from down; rad, of a roll from where on a sensor hangs upside down.
_SOME_GRAVITY, _HANGING = 5.0, 0.75 * np.pi
# Of rows that are as the one before: more than that are rather a slower sensor's last value.
_MANY_REPEATS = 0.5
# Of log likelihoods: what conventions and words say of axes and of the sign of a heading.
_CONVENTION, _QUATERNION, _HANGS, _HEADING, _EAST, _OF_HEADING = 6.0, 2.0, 2.0, 1.5, 8.0, 4.0
_FLAG = re.compile(r"(?P<whose>.*?)[_. ]?(valid|validity|is_valid|lock(ed)?)", re.IGNORECASE)
# What columns of a sensor, and its flags, are called by.
_WORDS = {
    "gyroscope": ("gyro", "imu", "rate"),
    "accelerometer": ("acc", "imu"),
    "dvl": ("dvl", "vel", "bottom"),
    "attitude": ("att", "ahrs", "imu", "orientation", "roll", "pitch", "yaw"),
    "depth": ("depth", "press"),
}


class FoundSensor(NamedTuple):
    """A sensor that was found by names, and components of it that stand elsewhere."""

    main: Found
    apart: list[Found]

    @property
    def parts(self) -> list[Found]:
        """Return all its places."""
        return [self.main, *self.apart]


def find_sensors(logs: Mapping[str, Log]) -> dict[str, FoundSensor]:
    """Find what looks like a sensor by names."""
    places = {
        sensor: find_in_logs(logs, wanted, sensor, SENSORS[sensor][0].unit) for sensor, wanted in SENSOR_NAMES.items()
    }
    # Not in one place with names of the body's axes: a velocity is along these or along the others.
    places["dvl"] = places["dvl"] or find_in_logs(logs, EARTH_VELOCITY, "dvl", SENSORS["dvl"][0].unit)
    quaternion, angles = find_in_logs(logs, QUATERNION_NAMES), places["attitude"]
    if quaternion is not None and len(quaternion[1].columns) == 4:
        is_measured = angles is not None and not angles[1].is_filter_output
        if not (is_measured and quaternion[1].is_filter_output):
            places["attitude"] = quaternion
    found = {}
    for sensor, place in places.items():
        if place is not None:
            main = found_in(logs, sensor, *place)
            found[sensor] = FoundSensor(main, [] if main.is_quaternion else _apart(logs, main))
    return found


def _apart(logs: Mapping[str, Log], main: Found) -> list[Found]:
    """Find the components that another table holds, each measured, unless what was found is a filter's as well."""
    apart, sensor = [], main.sensor
    for component, pattern in SENSOR_NAMES[sensor].items():
        missing = {} if component in main.numbers else {component: pattern}
        place = find_in_logs(logs, missing, sensor, SENSORS[sensor][0].unit)
        if place is None or (place[1].is_filter_output and not main.match.is_filter_output):
            continue
        if time_of(logs[place[0]], place[1].table)[0]:
            apart.append(found_in(logs, sensor, *place))
    return apart


def sensor_tracks(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, Track]:
    """Return the components of all sensors in SI, a roll of a sensor that hangs upside down set upright."""
    tracks: dict[str, Track] = {}
    for sensor in sensors.values():
        for part in sensor.parts:
            log, signals = logs[part.log], part.si()
            if flag := flag_of(sensors, log, part):
                said = np.asarray(log.read(part.match.table, [flag])[flag], np.float64)
                known = said == _meaning_valid(said)
                signals = {symbol: np.where(known, values, np.nan) for symbol, values in signals.items()}
            tracks |= tracks_of(log, part.match.table, signals)
    if "phi" in tracks and _hangs(tracks["phi"].values):
        tracks["phi"] = tracks["phi"]._replace(values=tracks["phi"].values + np.pi)
    return {symbol: track for symbol, track in tracks.items() if np.isfinite(track.values).any()}


def expected_of(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, dict[str, float]]:
    """Return what names and conventions say of axes and signs, see `weigh`."""
    expected: dict[str, dict[str, float]] = {}
    for name, (main, apart) in sensors.items():
        convention = _convention(logs[main.log], main.match.table)
        if convention is not None:
            expected[name] = {convention[0]: _CONVENTION}
        elif main.is_quaternion:
            expected[name] = {"FLU": _QUATERNION}
        for part in (main, *apart):
            if "psi" in part.match.columns:
                called = part.match.columns["psi"].name.lower()
                expected["psi"] = {"+": -_EAST if "enu" in called else _HEADING if "heading" in called else 0.0}
                if "enu" in called and convention is None:
                    # What is said of the heading alone leaves the body's axes as they are.
                    expected.setdefault(name, {"FRD": _OF_HEADING})
    if "dvl" in sensors and is_over_ground(sensors["dvl"].main.match.columns):
        expected["dvl"] = {OVER_GROUND: _CONVENTION}
    attitude = sensors.get("attitude")
    if attitude is not None and "dvl" in sensors and "phi" in (angles := attitude.main.si()) and _hangs(angles["phi"]):
        expected.setdefault("dvl", {"FLU": _HANGS})
    return expected


def sensor_lines(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], judged: Evidence) -> Iterator[Line]:
    """Yield the lines below `sensors:`."""
    for name, sensor in sensors.items():
        comment = "check: by its name what a navigation filter made of others, no measurement"
        yield YamlEntry(
            name,
            list(_sensor(logs, sensors, sensor, judged)),
            comment if sensor.main.match.is_filter_output else "",
        )
    if not sensors:
        yield Comment(
            "required: no column looks like a sensor, and what a navigation filter made is none: log what measures "
            "the motion itself (velocities u, v, w of a DVL; turn rates p, q, r; roll, pitch and yaw; depth), see "
            "docs/how-to/import-logs.md"
        )


def _sensor(
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], found: FoundSensor, judged: Evidence
) -> Iterator[Line]:
    main, name = found.main, found.main.sensor
    log = logs[main.log]
    convention = _convention(log, main.match.table)
    frame = _frame(name, judged, convention[0] if convention is not None else "")
    yield from row_entries(logs, main.log, main.match.table, judged.delays.get(name, 0.0))
    if main.is_quaternion:
        yield YamlEntry("quaternion", [YamlEntry(axis, column.name) for axis, column in main.match.columns.items()])
    else:
        yield YamlEntry("columns", list(_columns(logs, found, frame, judged)))
        unit = judged.units.get(name, main.unit)
        why = main.comment if unit == main.unit else f"check: in {main.unit} it would not agree with the others"
        yield YamlEntry("unit", unit, why)
    yield from _axes(log, found, frame, judged)
    yield from _repeats(main.numbers)
    yield from _valid(sensors, log, main)
    si = main.si()
    noise = [estimate_noise(signal, SENSORS[name][0].unit == "rad").standard_deviation for signal in si.values()]
    known = ", ".join(f"{deviation:.2g}" for deviation in noise if deviation > 0.0)
    hint = f"; the signals look like {known} {SENSORS[name][0].unit}" if known and not main.is_quaternion else ""
    yield YamlEntry("standard_deviation", None, f"required: noise by the data sheet, or estimate{hint}")


def _frame(sensor: str, judged: Evidence, convention: str) -> str:
    """Return the usual axes that are nearest to the signs of a sensor's components; of equal ones those expected."""
    if sensor == "dvl" and judged.over_ground:
        return judged.over_ground
    signs = [judged.verdict.signs.get(symbol, 0) for symbol in TRIPLES.get(sensor, ())]

    def distance(axes: str) -> tuple[int, bool]:
        reversed_ones = sum(sign == -usual for sign, usual in zip(signs, USUAL_AXES[axes], strict=False))
        return reversed_ones, axes != convention

    return min(USUAL_AXES, key=distance)


def _columns(logs: Mapping[str, Log], found: FoundSensor, frame: str, judged: Evidence) -> Iterator[Line]:
    name, present = found.main.sensor, set[str]()
    for part in found.parts:
        for component, column in part.match.columns.items():
            present.add(component)
            place: dict[str, Flow] = {}
            if part is not found.main:
                time, _ = time_of(logs[part.log], part.match.table)
                place = {"log": part.log} if len(logs) > 1 else {}
                place |= ({"table": part.match.table} if part.match.table else {}) | {"time": time}
                place |= {"unit": part.unit}
            axis = TRIPLES.get(name, (component,)).index(component)
            usual = USUAL_AXES.get(frame, (1, 1, 1))[axis]
            is_judged = name != "dvl" or not judged.over_ground
            reversed_one = is_judged and judged.verdict.signs.get(component, usual) != usual
            more: dict[str, Flow] = {}
            if reversed_one:
                more = {"sign": -1, "offset": Phrase("90 deg")} if component == "psi" else {"sign": -1}
            comment = ""
            if reversed_one:
                comment = f"counts the other way: {judged.words([component])}"
            bare = not place and not more
            yield YamlEntry(component, column.name if bare else {**place, "column": column.name, **more}, comment)
    missing = [quantity.symbol for quantity in SENSORS[name] if quantity.symbol not in present]
    if missing:
        yield Comment(f"check: no column found for {', '.join(missing)}")


def _axes(log: Log, found: FoundSensor, frame: str, judged: Evidence) -> Iterator[Line]:
    """Name the axes of a sensor that has some, and what speaks for them."""
    name = found.main.sensor
    if name not in TRIPLES:
        return
    convention = _convention(log, found.main.match.table)
    said = judged.words([symbol for symbol in TRIPLES[name] if symbol in judged.verdict.signs])
    if convention is not None:
        said = f"{said}; {convention[1]}"
    elif found.main.is_quaternion:
        said = f"{said}; FLU is usual for quaternions in ROS"
    if judged.over_ground and name == "dvl":
        named = is_over_ground(found.main.match.columns)
        said = f"{'by its names' if named else 'its direction goes with the heading, so'} it is over ground; check"
    yield YamlEntry("frame", frame, said if "check" in said else f"check: {said or 'nothing tells'}")
    if name == "attitude":
        meaning = "NED, psi from north clockwise, or ENU, from east anticlockwise"
        yield YamlEntry("reference", _EARTH[frame], f"check: {meaning}")
        angles = found.main.si()
        if "phi" in angles and _hangs(angles["phi"]):
            yield YamlEntry("mount", Phrase("upside down"), "check: roll is about 180 deg")


def _hangs(roll: Array) -> bool:
    known = np.abs(np.arctan2(np.sin(roll), np.cos(roll)))
    return bool(np.isfinite(known).any()) and float(np.nanmedian(known)) > _HANGING


def _valid(sensors: Mapping[str, FoundSensor], log: Log, main: Found) -> Iterator[Line]:
    if flag := flag_of(sensors, log, main):
        value = _meaning_valid(np.asarray(log.read(main.match.table, [flag])[flag], np.float64))
        values = (True, 1) if value == 1 else (value,)
        yield YamlEntry("valid", {"column": flag, "values": values}, "check: which values mean valid")


def _meaning_valid(flags: Array) -> int:
    """Guess which value of a flag means valid: 1, or of a number with a bit for each component the one with all."""
    largest = float(np.max(flags, initial=0.0, where=np.isfinite(flags)))
    return int(largest) if largest > 1.0 and not (flags == 1.0).any() else 1


def flag_of(sensors: Mapping[str, FoundSensor], log: Log, main: Found) -> str:
    """Find the flag of a table that is this sensor's own: by what it is called, or as the only sensor of the table."""
    sharing = [
        other for other in sensors.values() if (other.main.log, other.main.match.table) == (main.log, main.match.table)
    ]
    own = []
    for column in log.tables()[main.match.table]:
        flag = _FLAG.fullmatch(column.name)
        if flag is None:
            continue
        whose = flag["whose"].lower()
        named = [sensor for sensor, words in _WORDS.items() if any(word in whose for word in words)]
        if main.sensor in named or (not named and len(sharing) == 1):
            own.append(column.name)
    # Of "velocity_valid" and "beams[0].valid" that of the whole message.
    return min(own, key=lambda name: name.count("."), default="")


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
