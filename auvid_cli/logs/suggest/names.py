"""What columns are usually called, to guess what they hold."""

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, Log, LogColumn

_VELOCITY, _TO_GROUND = r"(v|(ground_?)?vel(ocity)?|linear|dvl_v\w*)[_.]?", r"_vel(ocity)?(_wrt_ground)?"
# By sensor and component: what the end of a column's name, in small letters, with blanks and dashes as underscores, is.
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
        "u": rf"(dvl_)?u|surge(_(speed|velocity))?|{_VELOCITY}x|x{_TO_GROUND}",
        "v": rf"(dvl_)?v|sway(_(speed|velocity))?|{_VELOCITY}y|y{_TO_GROUND}",
        "w": rf"(dvl_)?w|heave(_(speed|velocity))?|{_VELOCITY}z|z{_TO_GROUND}",
    },
    "attitude": {
        "phi": r"(attitude_)?(phi|roll)(_angle)?",
        "theta": r"(attitude_)?(theta|pitch)(_angle)?",
        "psi": r"((attitude_)?(psi|yaw)(_angle)?|((c_)?true_|magnetic_)?heading|orientation)(_(enu|ned))?",
    },
    "depth": {"down": r"down|(dfs_)?depth|position\.z"},
}
# Of a velocity along the axes of the earth, by component of a DVL.
EARTH_VELOCITY: dict[str, str] = {
    component: rf"(dvl_)?(v|vel|velocity)[_.]?({word[0]}|{word})|{word}_?(v|vel|velocity)"
    for component, word in zip("uvw", ("north", "east", "down"), strict=True)
}
# PX4 numbers its components, w first.
QUATERNION_NAMES: dict[str, str] = {
    axis: rf"(orientation|quaternion|quat|q)[_.]{axis}|q{axis}|q\[{number}\]" for number, axis in enumerate("wxyz")
}
_OF_QUATERNION = "|".join(QUATERNION_NAMES.values())
# Which of several fins or thrusters, where a number does not say it.
SIDES = (
    r"(port|starboard|stbd|left|right|bow|front|fore|fwd|rear|aft|stern|upper|lower|vert(ical)?|lat(eral)?|[fr][lr])"
)
_WHICH = rf"(_?\d+|_{SIDES})*"
INPUT_NAMES: dict[str, str] = {
    "rudder": r"(rudder|delta_r|dr)(_(angle|cmd|input))?|yaw_input|fin",
    "elevator": r"(elevator|stern_?planes?|delta_[se]|de|ds)(_(angle|cmd|input))?|pitch_input",
    "fins.top": r"(fins?_)?(yaw_t|top)|top_fins?",
    "fins.bottom": r"(fins?_)?(yaw_b|bottom|bot)|bottom_fins?",
    "fins.right": r"(fins?_)?(pitch_r|right|starboard|stbd)|(right|starboard|stbd)_fins?",
    "fins.left": r"(fins?_)?(pitch_l|left|port)|(left|port)_fins?",
    "surge_force": rf"surge_force|thrust(_force)?{_WHICH}",
    "thrust.revolutions": r"((prop|screw|shaft|motor|thrust|throttle)\w*)?(rpm|rps|rev/s|turn/s)|(rpm|rps)_\w+"
    r"|propeller_rotation_rate",
    "thrust.share": rf"({SIDES}_)*thruster{_WHICH}(_(cmd|command|input))?{_WHICH}|motor_speed_cmd|throttle",
    "roll_moment": r"roll_moment",
}
# By SI unit: what a name may end with to say another one.
NAMED_UNITS: dict[str, dict[str, str]] = {
    "rad/s": {"dps": "deg/s", "deg_s": "deg/s", "degs": "deg/s", "rad_s": "rad/s", "rads": "rad/s"}
    | {"degree_per_second": "deg/s", "radian_per_second": "rad/s"},
    "rad": {"deg": "deg", "degree": "deg", "degrees": "deg", "rad": "rad", "radian": "rad", "radians": "rad"},
    "m/s": {"m_s": "m/s", "ms": "m/s", "mps": "m/s", "cm_s": "cm/s", "kn": "knot", "kts": "knot", "knots": "knot"}
    | {"meter_per_second": "m/s"},
    "m/s^2": {"m_s2": "m/s^2", "ms2": "m/s^2", "mps2": "m/s^2", "g": "g", "mg": "mg"},
    "m": {"m": "m", "cm": "cm", "mm": "mm", "ft": "ft", "meter": "m"},
    "percent": {"pct": "percent", "percent": "percent"},
    "turn/s": {"rpm": "rpm", "rps": "turn/s", "radian_per_second": "rad/s", "rad_s": "rad/s"},
    "N": {"n": "N"},
}
_ANY_UNIT = rf"(_({'|'.join(end for ends in NAMED_UNITS.values() for end in ends)}))?"
# What stands before a name, of whose it is, and behind it, of what was done to it.
_OWNER, _FILTERED = r"((platform|vehicle|auv|nav|m)_)?", r"(_filt(ered)?)?"
# How MOOS, Slocum gliders and others call what is sent to fins and propeller.
_SENT = r"((desired|commanded|cmd|c)_)?"
_SOME_TIME = r"(t|time|timestamp|stamp)_\w+|\w+_(t|time|timestamp|stamp)"
_TIMES = r"(t|time|timestamp|stamp|unix_?(s|time)?|t_s|seconds|secs?|time_?(s|us|ms|ns)|epoch\w*|utc\w*|date_?time)"
_BARE_FIELD = re.compile(r"(data|value|xyz)(\[(?P<index>[012])\])?|(?P<axis>[xyz])")
# What messages of ROS hold that refer to forward-left-up axes and east-north-up by convention (REP 103).
_REP_103 = {
    "sensor_msgs/Imu": ("orientation.w", "angular_velocity.x", "linear_acceleration.x"),
    "nav_msgs/Odometry": ("pose.pose.orientation.w", "twist.twist.linear.x"),
    "geometry_msgs/TwistWithCovarianceStamped": ("twist.twist.linear.x", "twist.covariance[0]"),
    "geometry_msgs/TwistStamped": ("twist.linear.x", "twist.angular.x"),
    "geometry_msgs/PoseWithCovarianceStamped": ("pose.pose.position.x", "pose.pose.orientation.w"),
    "geometry_msgs/PoseStamped": ("pose.position.x", "pose.orientation.w"),
}


# Words of what somebody wanted, and of what a navigation filter made of all sensors: one by itself, or a whole table.
_SET_POINT = re.compile(
    r"(^|[_./ ])(desired|target|goal|ref|reference|set_?points?|sp|cmd|command(ed|s)?|next)([_./ ]|$)"
)
# Where a word begins within DesiredHeading.
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_FILTER_MADE = (
    r"global_position_int|local_position|odom|ekf|[xn]kf\d|kalman|estimat|dead_?reckon|(^|[_./])nav(_|state|solution)"
)
_FILTER_OUTPUT, _FILTER_TABLE = re.compile(_FILTER_MADE), re.compile(rf"{_FILTER_MADE}|filtered")


class Match(NamedTuple):
    """Columns of a table that look like what is wanted."""

    table: str
    columns: dict[str, LogColumn]

    @property
    def is_filter_output(self) -> bool:
        """Say whether any of it is by its name what a navigation filter made of all sensors."""
        return is_filter_output(self.table, *(column.name for column in self.columns.values()))


def find_columns(
    wanted: Mapping[str, str], tables: Mapping[str, tuple[LogColumn, ...]], hint: str = "", unit: str = ""
) -> list[Match]:
    """Find columns by component of what is wanted, table by table: most of them first, then those called like the hint.

    What a navigation filter made comes after what was measured; set-points count only where inputs are wanted.

    Parameters
    ----------
    wanted : mapping of str to str
        Pattern of the names, by component.
    tables : mapping of str to tuple of LogColumn
    hint : str
        Part of a table's name.
    unit : str
        SI unit; a name may end with what stands for it or another one in `NAMED_UNITS`.
    """
    whose = f"{_OWNER}{_SENT}" if wanted is INPUT_NAMES else _OWNER
    ending = rf"(_({'|'.join(NAMED_UNITS[unit])}))?" if unit in NAMED_UNITS else _ANY_UNIT
    places = []
    for table, columns in tables.items():
        numbers = [
            column
            for column in columns
            if not column.is_text
            and (wanted is INPUT_NAMES or not is_set_point(table, column.name))
            and (wanted is QUATERNION_NAMES or not _is_called(column.name, _OF_QUATERNION))
        ]
        matches = {}
        for component, pattern in wanted.items():
            called = rf"{whose}({pattern}){_FILTERED}{ending}{_FILTERED}"
            matching = [c for c in numbers if any(_is_called(name, called) for name in _spoken(table, c))]
            if matching:
                # Of "velocity.x" and "target.velocity.x" the shorter.
                matches[component] = min(matching, key=lambda c: (is_filter_output("", c.name), len(c.name)))
        if matches:
            places.append(Match(table, matches))
    return sorted(places, key=lambda place: (*_rank(place), hint in place.table), reverse=True)


def is_set_point(table: str, name: str) -> bool:
    """Say whether a column is by its name, or by that of its table, what somebody wanted, and no measurement."""
    return any(_SET_POINT.search(_plain(_CAMEL.sub("_", text))) is not None for text in (table, name))


def is_filter_output(table: str, *names: str) -> bool:
    """Say whether a table, or one of its columns, is by its name what a navigation filter made of all sensors."""
    made = (_FILTER_OUTPUT.search(_plain(name)) for name in names)
    return _FILTER_TABLE.search(_plain(table)) is not None or any(made)


def _rank(place: Match) -> tuple[bool, int]:
    return not place.is_filter_output, len(place.columns)


def named_unit(name: str, unit: str) -> str:
    """Find the unit that the end of a column's name states, of those for an SI unit; empty if it states none."""
    ends = NAMED_UNITS.get(unit, {})
    called = f"_{_plain(name)}"
    return next((ends[end] for end in sorted(ends, key=len, reverse=True) if called.endswith(f"_{end}")), "")


def find_in_logs(
    logs: Mapping[str, Log], wanted: Mapping[str, str], hint: str = "", unit: str = ""
) -> tuple[str, Match] | None:
    """Find log and columns with the most of what is wanted, of those whose numbers ever change; none that is empty."""
    places = [(name, place) for name, log in logs.items() for place in find_columns(wanted, log.tables(), hint, unit)]
    for name, place in sorted(places, key=lambda place: _rank(place[1]), reverse=True):
        values = logs[name].read(place.table, [column.name for column in place.columns.values()])
        numbers = {key: np.asarray(values[column.name], np.float64) for key, column in place.columns.items()}
        filled = {key: values for key, values in numbers.items() if np.isfinite(values).any()}
        if any(np.nanmax(values) > np.nanmin(values) for values in filled.values()):
            return name, Match(place.table, {key: place.columns[key] for key in filled})
    return None


def is_over_ground(columns: Mapping[str, LogColumn]) -> bool:
    """Say whether columns of a velocity, by component, are called by north and east."""
    return all(
        component in columns
        and _is_called(columns[component].name, rf"{_OWNER}({EARTH_VELOCITY[component]}){_ANY_UNIT}")
        for component in "uv"
    )


def standard_message(columns: Iterable[LogColumn]) -> str:
    """Return the kind of message, of those whose axes ROS fixes, that has such columns; empty if it is none."""
    names = {column.name for column in columns}
    return next((kind for kind, fields in _REP_103.items() if names.issuperset(fields)), "")


def find_time(columns: Iterable[LogColumn]) -> LogColumn | None:
    """Find the column that most likely holds the times."""
    columns = list(columns)
    for name in (HEADER_STAMP, LOG_TIME):
        if name in [column.name for column in columns]:
            return next(column for column in columns if column.name == name)
    for pattern in (_TIMES, _SOME_TIME):
        for column in columns:
            if _is_called(column.name, pattern):
                return column
    return None


def _spoken(table: str, column: LogColumn) -> tuple[str, ...]:
    """Return what a column is called, with its unit too; where a message is nothing but numbers, by its topic."""
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
