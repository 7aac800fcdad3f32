"""Usual names of sensors, inputs and times in logs."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, Log, LogColumn
from auvid_cli.logs.suggest.known_formats import KnownMessage, Role, known_columns, known_message

_VELOCITY = r"(v|(bt_|ground_?)?vel(ocity)?|linear|dvl_v\w*)[_.]?"
_TO_GROUND = r"_vel(ocity)?(_wrt_ground)?"
# By sensor and component: pattern of the end of a name in lower case, with underscores for blanks and dashes. Names are
# English or German.
SENSOR_NAMES: dict[str, dict[str, str]] = {
    "gyroscope": {
        "p": r"(gyro\w*_)?p|(gyro?|g|omega|ang\w*_?vel\w*|angular|w|rate)[_.]?x|roll_?(rate|speed)",
        "q": r"(gyro\w*_)?q|(gyro?|g|omega|ang\w*_?vel\w*|angular|w|rate)[_.]?y|pitch_?(rate|speed)",
        "r": r"(gyro\w*_)?r|(gyro?|g|omega|ang\w*_?vel\w*|angular|w|rate)[_.]?z|(yaw|turn)_?(rate|speed)",
    },
    "accelerometer": {
        "fx": r"(acc\w*_)?fx|(a|acc?|accel|accelerometer|(lin\w*_?)?acceleration)[_.]?x",
        "fy": r"(acc\w*_)?fy|(a|acc?|accel|accelerometer|(lin\w*_?)?acceleration)[_.]?y",
        "fz": r"(acc\w*_)?fz|(a|acc?|accel|accelerometer|(lin\w*_?)?acceleration)[_.]?z",
    },
    "dvl": {
        "u": rf"(dvl_)?u|surge(_(speed|velocity))?|{_VELOCITY}x|x{_TO_GROUND}|geschwindigkeit_x",
        "v": rf"(dvl_)?v|sway(_(speed|velocity))?|{_VELOCITY}y|y{_TO_GROUND}|geschwindigkeit_y",
        "w": rf"(dvl_)?w|heave(_(speed|velocity))?|{_VELOCITY}z|z{_TO_GROUND}|geschwindigkeit_z",
    },
    "attitude": {
        "phi": r"(attitude_)?(phi|roll)(_angle)?|roll(en|winkel)",
        "theta": r"(attitude_)?(theta|pitch)(_angle)?|nick(en|winkel)",
        "psi": r"((attitude_)?(psi|yaw)(_angle)?|((c_)?true_|magnetic_)?heading|orientation"
        r"|kurs(winkel)?|gier(en|winkel))(_(enu|ned))?",
    },
    "depth": {"down": r"down|(dfs_)?depth|position\.z|(tauch)?tiefe"},
}
SENSOR_OF = {component: sensor for sensor, wanted in SENSOR_NAMES.items() for component in wanted}
# Velocity along north, east and down, by component of a DVL.
EARTH_VELOCITY: dict[str, str] = {
    component: rf"(dvl_)?(v|vel|velocity)[_.]?({word[0]}|{word})|{word}_?(v|vel|velocity)"
    for component, word in zip("uvw", ("north", "east", "down"), strict=True)
}
# PX4 numbers the components, w first.
QUATERNION_NAMES: dict[str, str] = {
    axis: rf"(orientation|quaternion|quat|q)[_.]{axis}|q{axis}|q\[{number}\]" for number, axis in enumerate("wxyz")
}
_OF_QUATERNION = "|".join(QUATERNION_NAMES.values())
# Sides of fins and thrusters.
SIDES = (
    r"(port|starboard|stbd|left|right|bow|front|fore|fwd|rear|aft|stern|upper|lower|vert(ical)?|lat(eral)?|[fr][lr])"
)
_WHICH = rf"(_?\d+|_{SIDES})*"
INPUT_NAMES: dict[str, str] = {
    "rudder": r"(servo_)?(rudder|delta_r|dr)(_(angle|cmd|input|pwm|us))?|yaw_input|fin|seitenruder",
    "elevator": r"(servo_)?(elevator|stern_?planes?|delta_[se]|de|ds)(_(angle|cmd|input|pwm|us))?|pitch_input"
    r"|tiefenruder",
    "fins.top": r"(fins?_)?(yaw_t|top)|top_fins?",
    "fins.bottom": r"(fins?_)?(yaw_b|bottom|bot)|bottom_fins?",
    "fins.right": r"(fins?_)?(pitch_r|right|starboard|stbd)|(right|starboard|stbd)_fins?",
    "fins.left": r"(fins?_)?(pitch_l|left|port)|(left|port)_fins?",
    "surge_force": rf"surge_force|thrust(_force)?{_WHICH}|schub(kraft)?",
    "thrust.revolutions": r"((prop|screw|shaft|motor|thrust|throttle)\w*)?(rpm|rps|rev/s|turn/s)|(rpm|rps)_\w+"
    r"|propeller_rotation_rate",
    "thrust.share": rf"({SIDES}_)*thruster{_WHICH}(_(cmd|command|input|pwm|us))?{_WHICH}|motor_speed_cmd|throttle",
    "roll_moment": r"roll_moment",
}
# By SI unit: endings of names that state a unit.
NAMED_UNITS: dict[str, dict[str, str]] = {
    "rad/s": {"dps": "deg/s", "deg_s": "deg/s", "degs": "deg/s", "rad_s": "rad/s", "rads": "rad/s"}
    | {"degree_per_second": "deg/s", "radian_per_second": "rad/s"},
    "rad": {"deg": "deg", "degree": "deg", "degrees": "deg", "rad": "rad", "radian": "rad", "radians": "rad"},
    "m/s": {"m_s": "m/s", "ms": "m/s", "mps": "m/s", "meter_per_second": "m/s", "cm_s": "cm/s", "mm_s": "mm/s"}
    | {"mms": "mm/s", "kn": "knot", "kts": "knot", "knots": "knot"},
    "m/s^2": {"m_s2": "m/s^2", "ms2": "m/s^2", "mps2": "m/s^2", "g": "g", "mg": "mg"},
    "m": {"m": "m", "cm": "cm", "mm": "mm", "ft": "ft", "meter": "m"},
    "percent": {"pct": "percent", "percent": "percent"},
    "turn/s": {"rpm": "rpm", "rps": "turn/s", "radian_per_second": "rad/s", "rad_s": "rad/s"},
    "N": {"n": "N"},
}
_ANY_UNIT = rf"(_({'|'.join(end for ends in NAMED_UNITS.values() for end in ends)}))?"
_OWNER = r"((platform|vehicle|auv|nav|m)_)?"
_FILTERED = r"(_filt(ered)?)?"
_COMMANDED = r"((desired|commanded|cmd|c)_)?"  # before inputs of MOOS, Slocum gliders and others
_SOME_TIME = r"(t|time|timestamp|stamp)_\w+|\w+_(t|time|timestamp|stamp)"
# Times of measurement, which are better than times of reception.
_STAMPS = r"(header[._])?stamp([._](secs?|t))?|\w*time_?of_?validity\w*|(\w+_)?validity_time"
_WHOLE_SECONDS = re.compile(r"(?P<stem>(.*[._])?)(sec|secs|seconds|s)")
_ANY_TIME = r"\w*time|(.*[._])?secs?|zeit"
_TIMES = r"(t|time|timestamp|stamp|unix_?(s|time)?|t_s|seconds|secs?|time_?(s|us|ms|ns)|epoch\w*|utc\w*|date_?time)"
# Elements of a vector with three components; those of angles are roll, pitch and yaw.
_ELEMENT = re.compile(r"(?P<stem>(?!(.*\.)?(data|value|xyz|q|q_d|quat\w*)\[).*[a-zA-Z])\[(?P<index>[012])\]")
_OF_ANGLES = re.compile(r"(^|[._])(rpy|euler\w*|att(itude)?|angles|ypr_rev)$")
_ANGLES = ("roll", "pitch", "yaw")
_BARE_FIELD = re.compile(r"(data|value|xyz)(\[(?P<index>[012])\])?|(?P<axis>[xyz])")
# Fields of ROS messages in forward-left-up and east-north-up axes (REP 103).
_REP_103 = {
    "sensor_msgs/Imu": ("orientation.w", "angular_velocity.x", "linear_acceleration.x"),
    "nav_msgs/Odometry": ("pose.pose.orientation.w", "twist.twist.linear.x"),
    "geometry_msgs/TwistWithCovarianceStamped": ("twist.twist.linear.x", "twist.covariance[0]"),
    "geometry_msgs/TwistStamped": ("twist.linear.x", "twist.angular.x"),
    "geometry_msgs/PoseWithCovarianceStamped": ("pose.pose.position.x", "pose.pose.orientation.w"),
    "geometry_msgs/PoseStamped": ("pose.position.x", "pose.orientation.w"),
}
_SET_POINT = re.compile(
    r"(^|[_./ ])(desired|target|goal|ref|reference|set_?points?|sp|cmd|command(ed|s)?|next)([_./ ]|$)"
)
_MAX_INSTANCES = 100
MAX_COLUMNS = 40  # columns of a table whose values are read; more are those of images and the like
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")  # start of a word within DesiredHeading
_FILTER_WORDS = (
    r"global_position_int|local_position|odom|ekf|[xn]kf\d|kalman|estimat|dead_?reckon|(^|[_./])nav(_|state|solution)"
)
_FILTER_OUTPUT = re.compile(_FILTER_WORDS)
# Last part of the name of a table with the measurements of a device, such as nav_t.DVL.
_DEVICE = re.compile(r"(dvl|imu|ahrs|gyro\w*|fog|ins_raw|paro\w*|ctd|pressure\w*|compass|rdi|nortek|a50|xsens|mti)\d*")
_FILTER_TABLE = re.compile(rf"{_FILTER_WORDS}|filtered")


class Match(NamedTuple):
    """Columns of a table by component."""

    table: str
    columns: dict[str, LogColumn]
    message: KnownMessage | None = None  # known message that the table has

    @property
    def is_filter_output(self) -> bool:
        """Whether the message is a navigation filter's output, or the table or a column has the name of one."""
        if self.message is not None:
            return self.message.role is Role.FILTER_OUTPUT
        return is_filter_output(self.table, *(column.name for column in self.columns.values()))


def find_columns(
    wanted: Mapping[str, str],
    tables: Mapping[str, tuple[LogColumn, ...]],
    hint: str = "",
    unit: str = "",
    file: str = "",
) -> list[Match]:
    """Return the matching columns of each table; measurements and tables with most components first.

    Set-points are left out, except for inputs.

    Parameters
    ----------
    wanted : mapping of str to str
        Pattern of the names by component.
    tables : mapping of str to tuple of LogColumn
    hint : str
        Word that a preferred table contains.
    unit : str
        SI unit, for endings of names in `NAMED_UNITS`.
    file : str
        Name of the file of a text log, which may be that of a message.
    """
    whose = f"{_OWNER}{_COMMANDED}" if wanted is INPUT_NAMES else _OWNER
    ending = rf"(_({'|'.join(NAMED_UNITS[unit])}))?" if unit in NAMED_UNITS else _ANY_UNIT
    places = []
    for table, columns in distinct_tables(tables).items():
        numbers = [
            column
            for column in columns
            if not column.is_text
            and (wanted is INPUT_NAMES or not is_set_point(table, column.name))
            and (wanted is QUATERNION_NAMES or not _is_called(column.name, _OF_QUATERNION))
        ]
        message = known_message(table, columns, file)
        if message is not None:
            if matches := known_columns(message, wanted, columns, wanted is QUATERNION_NAMES):
                places.append(Match(table, matches, message))
            continue
        matches = {}
        for component, pattern in wanted.items():
            full_name = rf"{whose}({pattern}){_FILTERED}{ending}{_FILTERED}"
            matching = [c for c in numbers if any(_is_called(name, full_name) for name in _possible_names(table, c))]
            if matching:
                # "velocity.x" rather than "target.velocity.x".
                matches[component] = min(
                    matching, key=lambda c: (is_filter_output("", c.name), "filt" in c.name.lower(), len(c.name))
                )
        if matches:
            places.append(Match(table, matches))
    return sorted(places, key=lambda place: (*_rank(place), hint in place.table), reverse=True)


def distinct_tables(tables: Mapping[str, tuple[LogColumn, ...]]) -> dict[str, tuple[LogColumn, ...]]:
    """Return the tables without those that repeat others: one with several instances, or the only instance."""
    instances = Counter(table.partition("[")[0] for table in tables if "[" in table)
    repeats = {table for table in tables if instances.get(table, 0) > 1}
    repeats |= {f"{table}[{k}]" for table in tables if instances.get(table, 0) == 1 for k in range(_MAX_INSTANCES)}
    return {table: columns for table, columns in tables.items() if table not in repeats}


def component_of(column: LogColumn) -> str:
    """Return the component of a sensor that a column has the name of; empty without one."""
    for wanted in SENSOR_NAMES.values():
        for component, pattern in wanted.items():
            if _is_called(column.name, rf"{_OWNER}({pattern}){_FILTERED}{_ANY_UNIT}{_FILTERED}"):
                return component
    return ""


def without_names(logs: Mapping[str, Log]) -> str:
    """Return the columns of the logs if they are only elements of arrays; empty otherwise."""
    tables = [table for log in logs.values() for table in log.tables().values()]
    columns = [column.name for table in tables for column in table if not column.name.startswith("@")]
    arrays = [name for name in columns if re.fullmatch(r"data\[\d+\]|#\d+", name)]
    others = [name for name in columns if name not in arrays and not name.startswith("layout.")]
    return f"{arrays[0]} to {arrays[-1]}" if arrays and not others else ""


def is_set_point(table: str, name: str) -> bool:
    """Whether a table or column has the name of a set-point."""
    return any(_SET_POINT.search(_plain(_CAMEL.sub("_", text))) is not None for text in (table, name))


def is_filter_output(table: str, *names: str) -> bool:
    """Whether a table or one of its columns has the name of a navigation filter's output."""
    if _FILTER_TABLE.search(_plain(table)) and not _DEVICE.fullmatch(re.split(r"[./]", _plain(table))[-1]):
        return True
    return any(_FILTER_OUTPUT.search(_plain(name)) for name in names)


def _rank(place: Match) -> tuple[bool, int]:
    return not place.is_filter_output, len(place.columns)


def named_unit(name: str, unit: str) -> str:
    """Return the unit that a name ends with, one that converts to the SI unit; empty if there is none."""
    ends = NAMED_UNITS.get(unit, {})
    plain = f"_{_plain(name)}"
    return next((ends[end] for end in sorted(ends, key=len, reverse=True) if plain.endswith(f"_{end}")), "")


def find_in_logs(
    logs: Mapping[str, Log], wanted: Mapping[str, str], hint: str = "", unit: str = ""
) -> tuple[str, Match] | None:
    """Return the log and columns with most of the wanted components, of tables whose numbers change."""
    places = [
        (name, place)
        for name, log in logs.items()
        for place in find_columns(wanted, log.tables(), hint, unit, log.path.stem)
    ]
    if hint == "depth":
        # One of several pressure sensors may measure the air inside the hull.
        places.sort(key=lambda place: _range(logs[place[0]], place[1]), reverse=True)
    for name, place in sorted(places, key=lambda place: _rank(place[1]), reverse=True):
        values = logs[name].read(place.table, [column.name for column in place.columns.values()])
        numbers = {key: np.asarray(values[column.name], np.float64) for key, column in place.columns.items()}
        filled = {key: values for key, values in numbers.items() if np.isfinite(values).any()}
        if any(np.nanmax(values) > np.nanmin(values) for values in filled.values()):
            return name, place._replace(columns={key: place.columns[key] for key in filled})
    return None


def _range(log: Log, place: Match) -> float:
    """Return the largest range of values of the columns of a message; 0 for other tables, which names decide."""
    if place.message is None:
        return 0.0
    values = log.read(place.table, [column.name for column in place.columns.values()]).values()
    return max(float(np.ptp(known)) for v in values if (known := np.asarray(v)[np.isfinite(np.asarray(v))]).size)


def is_over_ground(columns: Mapping[str, LogColumn]) -> bool:
    """Whether the columns of a velocity are named by north and east."""
    return all(
        component in columns
        and _is_called(columns[component].name, rf"{_OWNER}({EARTH_VELOCITY[component]}){_ANY_UNIT}")
        for component in "uv"
    )


def standard_message(columns: Iterable[LogColumn]) -> str:
    """Return the ROS message with fixed axes that has such columns; empty if there is none."""
    names = {column.name for column in columns}
    return next((kind for kind, fields in _REP_103.items() if names.issuperset(fields)), "")


class TimeColumn(NamedTuple):
    """A column that may have the times of a table."""

    column: LogColumn
    nanoseconds: LogColumn | None  # column with the fraction, if this one has whole seconds
    is_stamp: bool  # whether its name says that it is the time of measurement


def time_columns(columns: Iterable[LogColumn]) -> list[TimeColumn]:
    """Return the columns that may have the times, the most probable names first."""
    columns = list(columns)
    by_name = {_plain(column.name): column for column in columns}
    found: list[TimeColumn] = []
    for name in (HEADER_STAMP, LOG_TIME):
        found += [TimeColumn(column, None, True) for column in columns if column.name == name]
    if found:
        return found
    for pattern in (_STAMPS, _TIMES, _SOME_TIME, _ANY_TIME):
        for column in columns:
            if _is_called(column.name, pattern) and column not in [one.column for one in found]:
                fraction = None
                if whole := _WHOLE_SECONDS.fullmatch(_plain(column.name)):
                    names = (f"{whole['stem']}{end}" for end in ("nanosec", "nanosecs", "nsec", "nsecs", "nanoseconds"))
                    fraction = next((by_name[name] for name in names if name in by_name), None)
                found.append(TimeColumn(column, fraction, pattern is _STAMPS))
    fractions = [one.nanoseconds for one in found]
    return [one for one in found if one.column not in fractions]


def may_measure(column: LogColumn) -> bool:
    """Whether a column has numbers, and no name of a time, a set-point or a navigation filter's output."""
    is_time = any(one.column == column for one in time_columns([column]))
    is_other = is_set_point("", column.name) or is_filter_output("", column.name)
    return not (column.is_text or column.name.startswith("@") or is_time or is_other)


def _possible_names(table: str, column: LogColumn) -> tuple[str, ...]:
    """Return the name of a column with and without its unit; for a message of bare numbers those of its topic."""
    if vector := _ELEMENT.fullmatch(column.name):
        axes = _ANGLES if _OF_ANGLES.search(_plain(vector["stem"])) else ("x", "y", "z")
        axis = axes[int(vector["index"])]
        return (axis,) if axes is _ANGLES else (f"{vector['stem']}_{axis}",)
    field = _BARE_FIELD.fullmatch(column.name)
    if not table or field is None:
        return (column.name, f"{column.name}_{column.unit}")
    parts = table.strip("/").split("/")
    letter = field["axis"] or ("xyz"[int(field["index"])] if field["index"] else "")
    axis = f"_{letter}" if letter else ""
    return tuple(f"{stem}{axis}" for stem in (".".join(parts), "_".join(parts[-2:])))


def _plain(name: str) -> str:
    return re.sub(r"[\s\\_-]+", "_", name.strip().lower())


def _is_called(name: str, pattern: str) -> bool:
    return re.fullmatch(rf"(.*\.)?({pattern})", _plain(name)) is not None
