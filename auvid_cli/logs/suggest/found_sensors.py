"""Sensors that a log has: their columns, signals and flags."""

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest import names
from auvid_cli.logs.suggest.evidence import OVER_GROUND
from auvid_cli.logs.suggest.relations import Track
from auvid_cli.logs.suggest.rows import Found, tracks_of

_UPSIDE_DOWN = 0.75 * np.pi  # rad, least median roll of a sensor that hangs upside down
_FLAG = re.compile(r"(?P<whose>.*?)[_. ]?(valid|validity|is_valid|lock(ed)?|good)", re.IGNORECASE)
# Words in the names of a sensor's flags.
_WORDS = {
    "gyroscope": ("gyro", "imu", "rate"),
    "accelerometer": ("acc", "imu"),
    "dvl": ("dvl", "vel", "bottom"),
    "attitude": ("att", "ahrs", "imu", "orientation", "roll", "pitch", "yaw"),
    "depth": ("depth", "press"),
}


class FoundSensor(NamedTuple):
    """Columns of a sensor in its main table, and its components in other tables."""

    main: Found
    apart: list[Found]
    notes: tuple[str, ...] = ()  # reasons for columns that their names do not show
    is_exchanged: bool = False  # whether x points to starboard and y ahead, so that z points up
    questions: tuple[tuple[str, str], ...] = ()  # components whose column is uncertain, each with the reason

    @property
    def parts(self) -> list[Found]:
        """Return the main columns and the others."""
        return [self.main, *self.apart]


def sensor_tracks(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, Track]:
    """Return the components of all sensors in SI, with an upside-down roll turned upright."""
    tracks: dict[str, Track] = {}
    for sensor in sensors.values():
        for part in sensor.parts:
            tracks |= part_tracks(logs, sensors, part, part.si())
    if "phi" in tracks and is_upside_down(tracks["phi"].values):
        tracks["phi"] = tracks["phi"]._replace(values=tracks["phi"].values + np.pi)
    return {symbol: track for symbol, track in tracks.items() if np.isfinite(track.values).any()}


def part_tracks(
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], part: Found, signals: Mapping[str, Array]
) -> dict[str, Track]:
    """Return signals of a part with their times; rows that the log marks as invalid are NaN."""
    log = logs[part.log]
    if flag := flag_of(sensors, log, part):
        flags = np.asarray(log.read(part.match.table, [flag])[flag], np.float64)
        is_valid = flags == valid_value(part, flags)
        signals = {symbol: np.where(is_valid, values, np.nan) for symbol, values in signals.items()}
    return tracks_of(log, part.match.table, signals)


def is_over_ground(match: names.Match) -> bool:
    """Whether a velocity is along north and east, by its message or its names."""
    if match.message is not None:
        return match.message.frame == OVER_GROUND
    return names.is_over_ground(match.columns)


def is_upside_down(roll: Array) -> bool:
    """Whether a roll, rad, is that of a sensor that hangs upside down."""
    size = np.abs(np.arctan2(np.sin(roll), np.cos(roll)))
    return bool(np.isfinite(size).any()) and float(np.nanmedian(size)) > _UPSIDE_DOWN


def valid_value(found: Found, flags: Array) -> int:
    """Return the value of valid rows: of a known message, else 1, or the largest of bit fields that never are 1."""
    if found.match.message is not None and found.match.message.valid != 1:
        return found.match.message.valid
    largest = float(np.max(flags, initial=0.0, where=np.isfinite(flags)))
    return int(largest) if largest > 1.0 and not (flags == 1.0).any() else 1


def _stated_flag(columns: Iterable[LogColumn], found: Found) -> str:
    """Return the flag of a known message, if the table has it."""
    message = found.match.message
    return message.flag if message is not None and message.flag in [column.name for column in columns] else ""


def used_columns(sensors: Mapping[str, FoundSensor]) -> set[tuple[str, str, str]]:
    """Return log, table and name of each column that a sensor has."""
    return {
        (part.log, part.match.table, column.name)
        for sensor in sensors.values()
        for part in sensor.parts
        for column in part.match.columns.values()
    }


def flag_of(sensors: Mapping[str, FoundSensor], log: Log, main: Found) -> str:
    """Return the column that flags this sensor's rows: by its name, or because the table has no other sensor."""
    sharing = [
        other for other in sensors.values() if (other.main.log, other.main.match.table) == (main.log, main.match.table)
    ]
    if stated := _stated_flag(log.tables()[main.match.table], main):
        return stated
    own = []
    for column in log.tables()[main.match.table]:
        flag = _FLAG.fullmatch(column.name)
        if flag is None:
            continue
        whose = flag["whose"].lower()
        named = [sensor for sensor, words in _WORDS.items() if any(word in whose for word in words)]
        # A flag may also have the first part of a column's name, such as x_good next to x_raw.
        stems = {re.split(r"[_. ]", column.name.lower())[0] for column in main.match.columns.values()}
        if main.sensor in named or (not named and (len(sharing) == 1 or whose in stems)):
            own.append(column.name)
    # "velocity_valid" rather than "beams[0].valid".
    return min(own, key=lambda name: name.count("."), default="")
