"""What columns are usually called, to guess what they hold."""

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.logs.log import HEADER_STAMP, LOG_TIME, Column, Log

# By sensor and component: what the end of a column's name, in small letters, with blanks and dashes as underscores, is.
SENSOR_NAMES: dict[str, dict[str, str]] = {
    "gyroscope": {
        "p": r"p|(gyro?|omega|ang\w*_?vel\w*|w|rate)[_.]?x|roll_?(rate|speed)",
        "q": r"q|(gyro?|omega|ang\w*_?vel\w*|w|rate)[_.]?y|pitch_?(rate|speed)",
        "r": r"r|(gyro?|omega|ang\w*_?vel\w*|w|rate)[_.]?z|(yaw|turn)_?(rate|speed)",
    },
    "accelerometer": {
        "fx": r"fx|(acc?|accel|accelerometer|(lin\w*_?)?acceleration)[_.]?x",
        "fy": r"fy|(acc?|accel|accelerometer|(lin\w*_?)?acceleration)[_.]?y",
        "fz": r"fz|(acc?|accel|accelerometer|(lin\w*_?)?acceleration)[_.]?z",
    },
    "dvl": {
        "u": r"u|u_m_?s|surge(_(speed|velocity))?|(v|vel|velocity|linear|dvl_v\w*)[_.]?x",
        "v": r"v|v_m_?s|sway(_(speed|velocity))?|(v|vel|velocity|linear|dvl_v\w*)[_.]?y",
        "w": r"w|w_m_?s|heave(_(speed|velocity))?|(v|vel|velocity|linear|dvl_v\w*)[_.]?z",
    },
    "attitude": {
        "phi": r"phi|roll(_(angle|deg|rad))?",
        "theta": r"theta|pitch(_(angle|deg|rad))?",
        "psi": r"psi|yaw(_(angle|deg|rad))?|((c_)?true_|magnetic_)?heading(_(deg|rad))?",
    },
    "depth": {"down": r"down|(dfs_)?depth(_m)?|position\.z"},
}
QUATERNION_NAMES: dict[str, str] = {axis: rf"(orientation|quaternion|quat|q)[_.]{axis}|q{axis}" for axis in "wxyz"}
INPUT_NAMES: dict[str, str] = {
    "rudder": r"(rudder|delta_r|dr)(_(angle|deg|rad|cmd))?",
    "elevator": r"(elevator|stern_?plane|delta_[se]|de|ds)(_(angle|deg|rad|cmd))?",
    "fins.top": r"fins?_(yaw_t|top)(_(deg|rad))?|top_fin",
    "fins.bottom": r"fins?_(yaw_b|bottom)(_(deg|rad))?|bottom_fin",
    "fins.right": r"fins?_(pitch_r|right|starboard)(_(deg|rad))?|right_fin",
    "fins.left": r"fins?_(pitch_l|left|port)(_(deg|rad))?|left_fin",
    "surge_force": r"surge_force|thrust(_n)?|thrust_force",
    "thrust.revolutions": r"(prop\w*_|motor_|thruster_)?(rpm|rps)",
    "thrust.share": r"thruster(_(pct|percent|cmd|command))?|motor_speed_cmd|throttle",
    "roll_moment": r"roll_moment",
}
_TIMES = r"(t|time|timestamp|stamp|unix_?(s|time)?|t_s|seconds|secs?|time_?(s|us|ms|ns)|epoch\w*|utc\w*|date_?time)"


class Found(NamedTuple):
    """Columns of a table that look like what is wanted."""

    table: str
    columns: dict[str, Column]


def find_columns(wanted: Mapping[str, str], tables: Mapping[str, tuple[Column, ...]], hint: str) -> list[Found]:
    """Columns by component of what is wanted, table by table: most of them first, then tables called like the hint."""
    places = []
    for table, columns in tables.items():
        numbers = [column for column in columns if not column.is_text]
        found = {}
        for component, pattern in wanted.items():
            matching = [column for column in numbers if _is_called(column.name, pattern)]
            if matching:
                # Of "velocity.x" and "target.velocity.x" the shorter.
                found[component] = min(matching, key=lambda column: len(column.name))
        if found:
            places.append(Found(table, found))
    return sorted(places, key=lambda place: (len(place.columns), hint in place.table), reverse=True)


def find_in_logs(logs: Mapping[str, Log], wanted: Mapping[str, str], hint: str = "") -> tuple[str, Found] | None:
    """Log and columns that have the most of what is wanted, of those whose numbers ever change; none that is empty."""
    places = [(name, place) for name, log in logs.items() for place in find_columns(wanted, log.tables(), hint)]
    for name, place in sorted(places, key=lambda one: len(one[1].columns), reverse=True):
        values = logs[name].read(place.table, [column.name for column in place.columns.values()])
        numbers = {key: np.asarray(values[column.name], np.float64) for key, column in place.columns.items()}
        filled = {key: own for key, own in numbers.items() if np.isfinite(own).any()}
        if any(np.nanmax(own) > np.nanmin(own) for own in filled.values()):
            return name, Found(place.table, {key: place.columns[key] for key in filled})
    return None


def find_time(columns: Iterable[Column]) -> Column | None:
    """The column that most likely holds the times."""
    columns = list(columns)
    for name in (HEADER_STAMP, LOG_TIME):
        if name in [column.name for column in columns]:
            return next(column for column in columns if column.name == name)
    return next((column for column in columns if _is_called(column.name, _TIMES)), None)


def _is_called(name: str, pattern: str) -> bool:
    plain = re.sub(r"[\s-]+", "_", name.strip().lower())
    return re.fullmatch(rf"(.*\.)?({pattern})", plain) is not None
