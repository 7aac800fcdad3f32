"""A run as topics over time, as ROS and its viewers expect them: east, north, up, and forward, port, up."""

from collections.abc import Iterable, Iterator
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate, Innovations
from auvid_cli.errors import DataError
from auvid_cli.vehicle.kinematics import dead_reckoned
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, SENSORS

Array = NDArray[np.float64]

# s; seconds of a ROS time have 31 bits.
_LATEST = 2.0**31
RECORDING_LOSSES = (
    "Positions are dead reckoned; axes are those of ROS: east, north, up, and forward, port, up (REP 103).",
    "Inputs, measurements themselves and covariances are lost; standard deviations stand beside the values.",
)
_ESTIMATED, _TRUE = "vehicle", "vehicle_true"


class TopicKind(Enum):
    """What a topic's messages are, and what stands in a row of its values.

    A pose is x, y, z, m, then a quaternion x, y, z, w, of a frame in the map; a velocity is along x, y, z, m/s, then
    about them, rad/s, in the frame's own axes; a table has a number for each of its fields.
    """

    POSE = "pose"
    VELOCITY = "velocity"
    TABLE = "table"


class Topic(NamedTuple):
    """Messages of one kind over time.

    Attributes
    ----------
    name : str
        Begins with a slash.
    kind : TopicKind
    frame : str
        The vehicle, estimated or true.
    fields : tuple of str
        Of a table: lower case letters, digits and single underscores, as ROS has them.
    time : ndarray, shape (n,)
        s.
    values : ndarray, shape (n, k)
        SI.
    """

    name: str
    kind: TopicKind
    frame: str
    fields: tuple[str, ...]
    time: Array
    values: Array


def topics_of(dataset: Dataset, estimate: Estimate) -> list[Topic]:
    """List what is known of a run: the estimated motion, all other states, innovations, and the truth if it is known.

    Raises
    ------
    DataError
        If a time is before 0 or beyond what ROS can state.
    """
    motion = estimate.history(MOTION_SYMBOLS).mean
    position = dead_reckoned(estimate.time, motion)
    topics = [*_moving("", _ESTIMATED, estimate.time[: len(position)], motion[: len(position)], position)]
    topics.append(_states(estimate))
    topics += [_innovations(sensor, record) for sensor, record in estimate.innovations.items()]
    if dataset.truth is not None:
        topics += _moving("/truth", _TRUE, dataset.truth.time, dataset.truth.motion, dataset.truth.position)
    if any(topic.time.size and not 0.0 <= topic.time[0] <= topic.time[-1] < _LATEST for topic in topics):
        raise DataError(f"a ROS recording has times from 0 to {_LATEST:.0f} s; those of this run lie elsewhere")
    return topics


def ros_pose(position: Array, attitude: Array) -> Array:
    """Turn poses of forward, starboard, down in north, east, down into forward, port, up in east, north, up (REP 103).

    Parameters
    ----------
    position : ndarray, shape (n, 3)
        North, east, down, m.
    attitude : ndarray, shape (n, 3)
        Roll, pitch, yaw, rad.

    Returns
    -------
    ndarray, shape (n, 7)
        East, north, up, m; quaternion x, y, z, w.
    """
    # Yaw is then from east to north, and pitch is nose down.
    half = 0.5 * np.column_stack((attitude[:, 0], -attitude[:, 1], 0.5 * np.pi - attitude[:, 2]))
    (sin_roll, sin_pitch, sin_yaw), (cos_roll, cos_pitch, cos_yaw) = np.sin(half).T, np.cos(half).T
    return np.column_stack(
        (
            *(position[:, 1], position[:, 0], -position[:, 2]),
            sin_roll * cos_pitch * cos_yaw - cos_roll * sin_pitch * sin_yaw,
            cos_roll * sin_pitch * cos_yaw + sin_roll * cos_pitch * sin_yaw,
            cos_roll * cos_pitch * sin_yaw - sin_roll * sin_pitch * cos_yaw,
            cos_roll * cos_pitch * cos_yaw + sin_roll * sin_pitch * sin_yaw,
        )
    )


def field_names(symbols: Iterable[str]) -> tuple[str, ...]:
    """Return a name that ROS allows for each symbol, all different: ``x_uu`` for ``X_u|u|``."""
    names: list[str] = []
    for symbol in symbols:
        word = "_".join(part for part in symbol.replace("|", "").lower().split("_") if part)
        free = (name for name in _numbered(word) if name not in names)
        names.append(next(free))
    return tuple(names)


def _numbered(word: str) -> Iterator[str]:
    yield word
    n = 2
    while True:
        yield f"{word}_{n}"
        n += 1


def _moving(prefix: str, frame: str, time: Array, motion: Array, position: Array) -> Iterator[Topic]:
    yield Topic(f"{prefix}/pose", TopicKind.POSE, frame, (), time, ros_pose(position, motion[:, 6:9]))
    turned = motion[:, :6] * [1.0, -1.0, -1.0, 1.0, -1.0, -1.0]
    yield Topic(f"{prefix}/velocity", TopicKind.VELOCITY, frame, (), time, turned)


def _states(estimate: Estimate) -> Topic:
    """Return all states but the motion, with their standard deviations."""
    rows = [row for row, symbol in enumerate(estimate.state) if symbol not in MOTION_SYMBOLS]
    fields = _with_deviations(estimate.state[row] for row in rows)
    values = np.hstack((estimate.mean[:, rows], estimate.standard_deviation[:, rows]))
    return Topic("/states", TopicKind.TABLE, _ESTIMATED, fields, estimate.time, values)


def _innovations(sensor: str, record: Innovations) -> Topic:
    fields = *_with_deviations(quantity.symbol for quantity in SENSORS[sensor]), "nis"
    values = np.column_stack((record.innovation, np.sqrt(record.variance), record.nis))
    return Topic(f"/innovations/{sensor}", TopicKind.TABLE, _ESTIMATED, fields, record.time, values)


def _with_deviations(symbols: Iterable[str]) -> tuple[str, ...]:
    known = tuple(symbols)
    return field_names((*known, *(f"{symbol}_standard_deviation" for symbol in known)))
