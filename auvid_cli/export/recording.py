"""A run as topics over time with the axes of ROS, and as an MCAP file of ROS 2 messages.

Axes are east, north, up, and forward, port, up (REP 103). Foxglove, Rerun and ROS itself read the file.
"""

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from itertools import chain, count, repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import replacing
from auvid_cli.data.innovations import Innovations
from auvid_cli.errors import DataError, FileError
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, SENSORS
from auvid_cli.vehicle.rigid_body import dead_reckoned

_LATEST = 2.0**31  # s; seconds of a ROS time have 31 bits
_NANOSECONDS = 10**9
_MAX_PATH_POSES = 2000
_MAP = "map"
_ESTIMATED = "vehicle"
_TRUE = "vehicle_true"
_PACKAGE = "auvid_msgs/msg"
RECORDING_LOSSES = (
    "Positions are dead reckoned; axes are those of ROS: east, north, up, and forward, port, up (REP 103).",
    "Inputs, measurements themselves and covariances are lost; standard deviations are next to the values.",
)


class TopicKind(Enum):
    """Kind of the messages of a topic.

    A row of a pose is x, y, z, m, and a quaternion x, y, z, w, of a frame in the map; a row of a velocity is along x,
    y, z, m/s, and about them, rad/s, in the axes of the frame; a row of a table has a number for each field.
    """

    POSE = "pose"
    VELOCITY = "velocity"
    TABLE = "table"


class Topic(NamedTuple):
    """Messages of one kind over time."""

    name: str  # begins with a slash
    kind: TopicKind
    frame: str  # frame of the estimated or true vehicle
    fields: tuple[str, ...]  # columns of a table: lower case letters, digits and single underscores, as required by ROS
    time: Array  # shape (n,); s
    values: Array  # shape (n, k); SI


def topics_of(dataset: Dataset, estimate: Estimate) -> list[Topic]:
    """Return the topics of a run: estimated motion, all other states, innovations, and the truth if known.

    Raises
    ------
    DataError
        If a time is before 0 or after the last time of ROS.
    """
    motion = estimate.history(MOTION_SYMBOLS).mean
    position = dead_reckoned(estimate.time, motion)
    n = len(position)
    topics = [*_motion_topics("", _ESTIMATED, estimate.time[:n], motion[:n], position), _states(estimate)]
    topics += [_innovations(sensor, record) for sensor, record in estimate.innovations.items()]
    if dataset.truth is not None:
        topics += _motion_topics("/truth", _TRUE, dataset.truth.time, dataset.truth.motion, dataset.truth.position)
    if any(topic.time.size and not 0.0 <= topic.time[0] <= topic.time[-1] < _LATEST for topic in topics):
        raise DataError(f"times of this run cannot be recorded; expected times from 0 to {_LATEST:.0f} s for ROS")
    return topics


def ros_pose(position: Array, attitude: Array) -> Array:
    """Return poses in the axes of ROS (REP 103).

    Parameters
    ----------
    position : ndarray, shape (n, 3)
        North, east, down, m.
    attitude : ndarray, shape (n, 3)
        Roll, pitch, yaw, rad, of forward, starboard, down.

    Returns
    -------
    ndarray, shape (n, 7)
        East, north, up, m; quaternion x, y, z, w of forward, port, up.
    """
    # Yaw becomes an angle from east to north, and pitch one of the nose down.
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
    """Return a valid ROS name for each symbol, all different: ``x_uu`` for ``X_u|u|``."""
    names: list[str] = []
    for symbol in symbols:
        word = "_".join(part for part in symbol.replace("|", "").lower().split("_") if part)
        candidates = chain([word], (f"{word}_{n}" for n in count(2)))
        names.append(next(name for name in candidates if name not in names))
    return tuple(names)


def _motion_topics(prefix: str, frame: str, time: Array, motion: Array, position: Array) -> Iterator[Topic]:
    yield Topic(f"{prefix}/pose", TopicKind.POSE, frame, (), time, ros_pose(position, motion[:, 6:9]))
    velocity = motion[:, :6] * [1.0, -1.0, -1.0, 1.0, -1.0, -1.0]
    yield Topic(f"{prefix}/velocity", TopicKind.VELOCITY, frame, (), time, velocity)


def _states(estimate: Estimate) -> Topic:
    """Return all states except the motion, with their standard deviations."""
    rows = [row for row, symbol in enumerate(estimate.state) if symbol not in MOTION_SYMBOLS]
    fields = _with_deviations(estimate.state[row] for row in rows)
    values = np.hstack((estimate.mean[:, rows], estimate.standard_deviation[:, rows]))
    return Topic("/states", TopicKind.TABLE, _ESTIMATED, fields, estimate.time, values)


def _innovations(sensor: str, record: Innovations) -> Topic:
    fields = *_with_deviations(quantity.symbol for quantity in SENSORS[sensor]), "nis"
    values = np.column_stack((record.innovation, np.sqrt(record.variance), record.nis))
    return Topic(f"/innovations/{sensor}", TopicKind.TABLE, _ESTIMATED, fields, record.time, values)


def _with_deviations(symbols: Iterable[str]) -> tuple[str, ...]:
    values = tuple(symbols)
    return field_names((*values, *(f"{symbol}_standard_deviation" for symbol in values)))


class _Channel(NamedTuple):
    """Messages of a topic: type, increasing time stamps, ns, and a function that returns the message of a row."""

    topic: str
    type_name: str
    stamps: list[int]
    message: Callable[[int], Any]


def write_mcap(path: Path, topics: list[Topic], origin: Mapping[str, str]) -> None:
    """Write an MCAP file completely or not at all.

    Poses are also written as transforms on ``/tf``, and as a path at the first time.

    Parameters
    ----------
    origin : mapping
        Origin of the run, written at the beginning of the file.

    Raises
    ------
    FileError
        If the file cannot be written, or a package is not installed.
    """
    try:
        from mcap.writer import Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ModuleNotFoundError as error:
        raise FileError(
            "writing MCAP needs the packages mcap and rosbags: run pip install '.[ros]' in the clone of auvid"
        ) from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    for topic in topics:
        if topic.kind is TopicKind.TABLE:
            fields = (f"float64 {field}" for field in topic.fields)
            definition = "\n".join(("std_msgs/Header header", *fields))
            store.register(get_types_from_msg(definition, _table_type(topic)))
    channels = [channel for topic in topics for channel in _channels(topic, store.types)]
    with replacing(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="auvid")
        writer.add_metadata("auvid run", dict(origin))
        # Transforms of estimate and truth share a topic.
        numbers: dict[str, int] = {}
        for name, type_name in {channel.topic: channel.type_name for channel in channels}.items():
            definition = store.generate_msgdef(type_name, ros_version=2)[0]
            schema = writer.register_schema(type_name, "ros2msg", definition.encode())
            numbers[name] = writer.register_channel(name, "cdr", schema)
        stamps = (zip(channel.stamps, repeat(k), count()) for k, channel in enumerate(channels))
        for stamp, k, row in heapq.merge(*stamps):
            channel = channels[k]
            content = bytes(store.serialize_cdr(channel.message(row), channel.type_name))
            writer.add_message(numbers[channel.topic], stamp, content, stamp)
        writer.finish()


def _table_type(topic: Topic) -> str:
    word = "".join(part.capitalize() for part in topic.name.replace("/", "_").split("_"))
    return f"{_PACKAGE}/{word}"


def _channels(topic: Topic, types: Mapping[str, Any]) -> Iterator[_Channel]:
    """Yield the channels of a topic with messages of these types."""
    stamps, rows = (topic.time * _NANOSECONDS).round().astype(np.int64).tolist(), topic.values.tolist()

    def make(name: str, *values: Any) -> Any:
        return types[f"geometry_msgs/msg/{name}"](*values)

    def header(k: int, frame: str) -> Any:
        time = types["builtin_interfaces/msg/Time"](*divmod(stamps[k], _NANOSECONDS))
        return types["std_msgs/msg/Header"](time, frame)

    def pose(k: int) -> Any:
        place = make("Pose", make("Point", *rows[k][:3]), make("Quaternion", *rows[k][3:]))
        return make("PoseStamped", header(k, _MAP), place)

    def transform(k: int) -> Any:
        change = make("Transform", make("Vector3", *rows[k][:3]), make("Quaternion", *rows[k][3:]))
        return types["tf2_msgs/msg/TFMessage"]([make("TransformStamped", header(k, _MAP), topic.frame, change)])

    def path(_: int) -> Any:
        shown = np.unique(np.linspace(0, len(rows) - 1, _MAX_PATH_POSES).astype(int)).tolist()
        return types["nav_msgs/msg/Path"](header(0, _MAP), [pose(k) for k in shown])

    def velocity(k: int) -> Any:
        twist = make("Twist", make("Vector3", *rows[k][:3]), make("Vector3", *rows[k][3:]))
        return make("TwistStamped", header(k, topic.frame), twist)

    def table(k: int) -> Any:
        return types[_table_type(topic)](header(k, topic.frame), *rows[k])

    match topic.kind:
        case TopicKind.POSE:
            yield _Channel(topic.name, "geometry_msgs/msg/PoseStamped", stamps, pose)
            yield _Channel("/tf", "tf2_msgs/msg/TFMessage", stamps, transform)
            yield _Channel(topic.name.removesuffix("pose") + "path", "nav_msgs/msg/Path", stamps[:1], path)
        case TopicKind.VELOCITY:
            yield _Channel(topic.name, "geometry_msgs/msg/TwistStamped", stamps, velocity)
        case TopicKind.TABLE:
            yield _Channel(topic.name, _table_type(topic), stamps, table)
