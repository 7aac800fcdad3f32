"""Sensors that a log has: their columns, signals and flags; raw columns in place of their low-pass filtered copies."""

import re
from collections.abc import Mapping
from itertools import chain
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.suggest import names
from auvid_cli.logs.suggest.evidence import OVER_GROUND
from auvid_cli.logs.suggest.relations import Track
from auvid_cli.logs.suggest.rows import Found, found_in, tracks_of

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
_OWN_PAST = 3  # rows of the copy itself that may enter it
_REACH = 20  # rows of the other column, before and after, that may enter it
_MIN_ROWS = 400
_MAX_ROWS = 20_000
_MAX_REST = 0.3  # unexplained share of the part of the copy that its own past does not explain
_MAX_ROUGHNESS = 0.7  # roughness of the copy, divided by that of the other column
_MAX_GAIN_ERROR = 0.004  # less than that between a depth in m and a pressure in dbar
_TURNS = (2.0 * np.pi, 360.0)
_MAX_WRAP = 1.01  # largest range of a wrapped angle, turns


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


def is_upside_down(roll: Array | None) -> bool:
    """Whether a roll, rad, is that of a sensor that hangs upside down."""
    if roll is None:
        return False
    size = np.abs(np.arctan2(np.sin(roll), np.cos(roll)))
    return bool(np.isfinite(size).any()) and float(np.nanmedian(size)) > _UPSIDE_DOWN


def valid_value(found: Found, flags: Array) -> int:
    """Return the value of valid rows: of a known message, else 1, or the largest of bit fields that never are 1."""
    if found.match.message is not None and found.match.message.valid != 1:
        return found.match.message.valid
    largest = float(np.max(flags, initial=0.0, where=np.isfinite(flags)))
    return int(largest) if largest > 1.0 and not (flags == 1.0).any() else 1


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
    columns, message = log.tables()[main.match.table], main.match.message
    if message is not None and message.flag and message.flag in [column.name for column in columns]:
        return message.flag
    own = []
    for column in columns:
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


def with_unfiltered(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return the sensors, with a column of the same table in place of each one that is its filtered copy."""
    used = used_columns(sensors)
    replaced: dict[str, FoundSensor] = {}
    for name, sensor in sensors.items():
        parts, reasons = zip(*(_unfiltered(logs, part, used) for part in sensor.parts), strict=True)
        notes = (*sensor.notes, *chain.from_iterable(reasons))
        replaced[name] = sensor._replace(main=parts[0], apart=[*parts[1:]], notes=notes)
    return replaced


def _unfiltered(logs: Mapping[str, Log], part: Found, used: set[tuple[str, str, str]]) -> tuple[Found, list[str]]:
    """Return a part with unfiltered columns, and the reason for each one that is new."""
    table, log = part.match.table, logs[part.log]
    tried = [
        column
        for column in log.tables()[table]
        if (part.log, table, column.name) not in used and names.may_measure(column)
    ]
    if part.match.message is not None or part.is_quaternion or not 0 < len(tried) <= names.MAX_COLUMNS:
        return part, []
    read = log.read(table, [column.name for column in tried])
    columns, reasons = dict(part.match.columns), list[str]()
    for component, column in part.match.columns.items():
        found = [
            (*fit, other)
            for other in tried
            if other.unit == column.unit
            and (fit := filtering(part.numbers[component], np.asarray(read[other.name], np.float64))) is not None
        ]
        if found:
            _, rest, raw = min(found, key=lambda one: one[0])
            columns[component] = raw
            reasons.append(
                f"check: {component} is {raw.name}, because {column.name} is a low-pass filtered copy of it: "
                f"{rest:.0%} of its changes have another cause"
            )
    if not reasons:
        return part, []
    return found_in(logs, part.sensor, part.log, part.match._replace(columns=columns)), reasons


def filtering(copy: Array, other: Array) -> tuple[float, float] | None:
    """Return how a column is a low-pass filtered copy of another with the same rows; None if it is not.

    Two sensors of one signal have noise of their own, so that neither explains the other's new part.

    Parameters
    ----------
    copy, other : ndarray, shape (n,)
        NaN where missing.

    Returns
    -------
    tuple of float, or None
        Size of the copy's second differences, divided by that of the other column; and the share of the copy's new
        part that the other column leaves unexplained.
    """
    if copy.shape != other.shape or copy.size < _MIN_ROWS:
        return None
    rows = slice(0, _MAX_ROWS)
    copy, other = unwrapped(copy[rows]), unwrapped(other[rows])
    known = np.isfinite(copy) & np.isfinite(other)
    if np.count_nonzero(known) < _MIN_ROWS:
        return None
    centre = float(np.mean(other[known]))
    roughness = _roughness(copy), _roughness(other)
    if not 0.0 < roughness[0] < _MAX_ROUGHNESS * roughness[1]:
        return None
    middle = np.arange(_REACH, copy.size - _REACH)
    past = np.column_stack([copy[middle - k] - centre for k in range(1, _OWN_PAST + 1)])
    around = np.column_stack([other[middle + k] - centre for k in range(-_REACH, _REACH + 1)])
    design = np.column_stack([np.ones(middle.size), past, around])
    target = copy[middle] - centre
    usable = np.isfinite(design).all(axis=1) & np.isfinite(target)
    if np.count_nonzero(usable) < _MIN_ROWS:
        return None
    design, target = design[usable], target[usable]
    alone, _ = _fit(design[:, : 1 + _OWN_PAST], target)
    rest, weights = _fit(design, target)
    if not rest < _MAX_REST * alone:
        return None
    own = 1.0 - float(weights[1 : 1 + _OWN_PAST].sum())
    gain = float(weights[1 + _OWN_PAST :].sum()) / own if own else np.inf
    return (roughness[0] / roughness[1], rest / alone) if abs(gain - 1.0) < _MAX_GAIN_ERROR else None


def unwrapped(values: Array) -> Array:
    """Return values without the jumps of an angle that is wrapped at a turn, in rad or degrees."""
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        return values
    range_, jump = float(np.ptp(values[known])), float(np.abs(np.diff(values[known])).max())
    turn = next((turn for turn in _TURNS if 0.9 * turn < jump and range_ < _MAX_WRAP * turn), None)
    if turn is None:
        return values
    smooth = values.copy()
    smooth[known] = np.unwrap(values[known], period=turn)
    return smooth


def _roughness(values: Array) -> float:
    second = np.diff(values, 2)
    second = second[np.isfinite(second)]
    return float(np.sqrt(np.mean(np.square(second)))) if second.size else 0.0


def _fit(design: Array, target: Array) -> tuple[float, Array]:
    """Return the root mean square of the residuals of a linear fit, and its weights."""
    weights = np.asarray(np.linalg.lstsq(design, target, rcond=None)[0], np.float64)
    return float(np.sqrt(np.mean(np.square(target - design @ weights)))), weights
