"""A run as an MCAP file of ROS 2 messages, which Foxglove, Rerun and ROS itself read."""

import heapq
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auvid_cli.data.files import replacing
from auvid_cli.errors import FileError
from auvid_cli.export.recording import Topic, TopicKind

try:
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
except ModuleNotFoundError as error:
    raise FileError("writing MCAP needs the packages mcap and rosbags: pip install 'auvid[ros]'") from error

_MAP = "map"
_NANOSECONDS = 10**9
# Poses of a path: as many as a screen shows.
_PATH_POSES = 2000
_PACKAGE = "auvid_msgs/msg"


class _Channel(NamedTuple):
    """Messages on their way into a file.

    Attributes
    ----------
    topic, type_name : str
    stamps : list of int
        Increasing, ns.
    message : callable
        The message of a row.
    """

    topic: str
    type_name: str
    stamps: list[int]
    message: Callable[[int], Any]


def write_mcap(path: Path, topics: list[Topic], origin: Mapping[str, str]) -> None:
    """Write a file whole or not at all.

    Poses also become transforms on ``/tf``, and a path at the first time.

    Parameters
    ----------
    path : pathlib.Path
    topics : list of Topic
    origin : mapping
        Where the run comes from, by name; the file begins with it.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    messages = _Messages()
    channels = [channel for topic in topics for channel in messages.channels(topic)]
    with replacing(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="auvid")
        writer.add_metadata("auvid run", dict(origin))
        # Transforms of estimate and truth share a topic.
        numbers = {
            topic: _register(writer, topic, type_name, messages.definition(type_name))
            for topic, type_name in {channel.topic: channel.type_name for channel in channels}.items()
        }
        for stamp, k, row in heapq.merge(*(_places(k, channel.stamps) for k, channel in enumerate(channels))):
            writer.add_message(numbers[channels[k].topic], stamp, messages.bytes_of(channels[k], row), stamp)
        writer.finish()


def _places(k: int, stamps: list[int]) -> Iterator[tuple[int, int, int]]:
    for row, stamp in enumerate(stamps):
        yield stamp, k, row


def _register(writer: Writer, topic: str, type_name: str, definition: str) -> int:
    return writer.register_channel(topic, "cdr", writer.register_schema(type_name, "ros2msg", definition.encode()))


class _Messages:
    """Message types of ROS 2, and those of tables that topics bring."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS2_HUMBLE)

    def definition(self, type_name: str) -> str:
        return self._store.generate_msgdef(type_name, ros_version=2)[0]

    def bytes_of(self, channel: _Channel, row: int) -> bytes:
        return bytes(self._store.serialize_cdr(channel.message(row), channel.type_name))

    def channels(self, topic: Topic) -> Iterator[_Channel]:
        stamps, rows = (topic.time * _NANOSECONDS).round().astype(np.int64).tolist(), topic.values.tolist()
        match topic.kind:
            case TopicKind.POSE:
                yield self._poses(topic, stamps, rows)
                yield self._transforms(topic, stamps, rows)
                yield self._path(topic, stamps, rows)
            case TopicKind.VELOCITY:
                yield self._velocities(topic, stamps, rows)
            case TopicKind.TABLE:
                yield self._table(topic, stamps, rows)

    def _poses(self, topic: Topic, stamps: list[int], rows: list[list[float]]) -> _Channel:
        name, pose = "geometry_msgs/msg/PoseStamped", self._pose
        stamped, header = self._type(name), self._header
        return _Channel(topic.name, name, stamps, lambda k: stamped(header(stamps[k], _MAP), pose(rows[k])))

    def _transforms(self, topic: Topic, stamps: list[int], rows: list[list[float]]) -> _Channel:
        transform, stamped, name = (
            self._type("geometry_msgs/msg/Transform"),
            self._type("geometry_msgs/msg/TransformStamped"),
            "tf2_msgs/msg/TFMessage",
        )
        all_of_them, vector = self._type(name), self._type("geometry_msgs/msg/Vector3")
        quaternion = self._type("geometry_msgs/msg/Quaternion")

        def message(k: int) -> Any:
            place = transform(vector(*rows[k][:3]), quaternion(*rows[k][3:]))
            return all_of_them([stamped(self._header(stamps[k], _MAP), topic.frame, place)])

        return _Channel("/tf", name, stamps, message)

    def _path(self, topic: Topic, stamps: list[int], rows: list[list[float]]) -> _Channel:
        name, stamped = "nav_msgs/msg/Path", self._type("geometry_msgs/msg/PoseStamped")
        shown = np.unique(np.linspace(0, max(len(rows) - 1, 0), _PATH_POSES).astype(int)).tolist() if rows else []

        def message(_: int) -> Any:
            poses = [stamped(self._header(stamps[k], _MAP), self._pose(rows[k])) for k in shown]
            return self._type(name)(self._header(stamps[0], _MAP), poses)

        return _Channel(topic.name.removesuffix("pose") + "path", name, stamps[:1], message)

    def _velocities(self, topic: Topic, stamps: list[int], rows: list[list[float]]) -> _Channel:
        name, vector, twist = (
            "geometry_msgs/msg/TwistStamped",
            self._type("geometry_msgs/msg/Vector3"),
            self._type("geometry_msgs/msg/Twist"),
        )
        stamped = self._type(name)

        def message(k: int) -> Any:
            return stamped(self._header(stamps[k], topic.frame), twist(vector(*rows[k][:3]), vector(*rows[k][3:])))

        return _Channel(topic.name, name, stamps, message)

    def _table(self, topic: Topic, stamps: list[int], rows: list[list[float]]) -> _Channel:
        word = "".join(part.capitalize() for part in topic.name.replace("/", "_").split("_"))
        name, fields = f"{_PACKAGE}/{word}", (f"float64 {field}" for field in topic.fields)
        self._store.register(get_types_from_msg("\n".join(("std_msgs/Header header", *fields)), name))
        table = self._type(name)
        return _Channel(topic.name, name, stamps, lambda k: table(self._header(stamps[k], topic.frame), *rows[k]))

    def _pose(self, row: list[float]) -> Any:
        point, quaternion = self._type("geometry_msgs/msg/Point"), self._type("geometry_msgs/msg/Quaternion")
        return self._type("geometry_msgs/msg/Pose")(point(*row[:3]), quaternion(*row[3:]))

    def _header(self, stamp: int, frame: str) -> Any:
        time = self._type("builtin_interfaces/msg/Time")(*divmod(stamp, _NANOSECONDS))
        return self._type("std_msgs/msg/Header")(time, frame)

    def _type(self, name: str) -> Any:
        return self._store.types[name]
