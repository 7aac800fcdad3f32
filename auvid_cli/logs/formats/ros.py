"""Logs of ROS: bags of ROS 1, and of ROS 2 as a folder, an .mcap or a .db3 file. A table for each topic."""

import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, ColumnValues, Log, LogColumn, missing

try:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore
except ModuleNotFoundError as error:
    raise FileError("reading ROS bags needs the package rosbags: pip install 'auvid[ros]'") from error

# Longer lists are pictures, scans and the like: they can be read by their index, but are not offered.
_LONGEST_OFFERED = 100
_NANOSECONDS = 10**9
_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")
_REPAIR = {".bag": "rosbag reindex", ".mcap": "mcap recover"}


class _Topic(NamedTuple):
    columns: tuple[LogColumn, ...]
    note: str


class BagLog(Log):
    """A bag. Its messages are decoded by the definitions in it, or if it has none by those of ROS 2 itself."""

    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the columns of each topic, of a list without a fixed length as many as its first message has.

        Of a topic without messages, or whose messages are not defined in the bag, that is the time of the log alone.
        """
        return {name: topic.columns for name, topic in self._topics.items()}

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read fields of a topic's messages by dotted paths; NaN or empty where a list is too short for an index."""
        if table not in self._topics:
            raise FileError(missing(self, "topic", table, self._topics))
        topic = self._topics[table]
        offered = {column.name: column for column in topic.columns}
        for name in columns:
            # A list may be longer than it was in the first message.
            if name not in offered and (topic.note or "[" not in name):
                raise FileError(missing(self, f"field in {table}", name, offered) + topic.note)
        values = {name: [] if name in offered and offered[name].is_text else array("d") for name in columns}
        extractors = {name: _extractor(name, np.nan if isinstance(values[name], array) else "") for name in columns}
        with self._opened() as reader:
            for stamp, message in self._messages(reader, table):
                for name, extract in extractors.items():
                    try:
                        values[name].append(extract(stamp, message))
                    except (AttributeError, TypeError):
                        known = [column.name for column in _leaves("", message)]
                        raise FileError(missing(self, f"number in {table}", name, known)) from None
        return {
            name: np.array(column, dtype=None if isinstance(column, array) else str) for name, column in values.items()
        }

    @cached_property
    def _topics(self) -> dict[str, _Topic]:
        with self._opened() as reader:
            types = {connection.topic: connection.msgtype for connection in reader.connections}
            return {topic: self._topic(reader, topic, types[topic]) for topic in sorted(types)}

    def _topic(self, reader: AnyReader, topic: str, msgtype: str) -> _Topic:
        time = (LogColumn(LOG_TIME),)
        if msgtype not in reader.typestore.fielddefs:
            return _Topic(time, f": its messages are {msgtype}, and the bag does not say what that is")
        _, message = next(self._messages(reader, topic), (0, None))
        if message is None:
            return _Topic(time, ": the topic has no messages")
        has_stamp = hasattr(getattr(getattr(message, "header", None), "stamp", None), "nanosec")
        stamp = (LogColumn(HEADER_STAMP),) if has_stamp else ()
        return _Topic((*time, *stamp, *_leaves("", message)), "")

    @contextmanager
    def _opened(self) -> Iterator[AnyReader]:
        with damage_as_file_error(lambda reason: self._damaged("it cannot be opened", reason)):
            reader = AnyReader([self.path], default_typestore=get_typestore(Stores.LATEST))
            reader.open()
        try:
            yield reader
        finally:
            reader.close()

    def _messages(self, reader: AnyReader, topic: str) -> Iterator[tuple[int, Any]]:
        """Yield the messages of a topic with the time of the log in ns; if their type is not known, None for each."""
        connections = [connection for connection in reader.connections if connection.topic == topic]
        count = 0
        with damage_as_file_error(lambda reason: self._damaged(f"after {count} messages of {topic}", reason)):
            for connection, stamp, raw in reader.messages(connections):
                known = connection.msgtype in reader.typestore.fielddefs
                yield stamp, reader.deserialize(raw, connection.msgtype) if known else None
                count += 1

    def _damaged(self, where: str, reason: str) -> str:
        repair = _REPAIR.get(self.path.suffix, "ros2 bag reindex")
        return f"{self.path}: {where}: {reason}; a bag that was cut short may be mended with {repair}"


def _leaves(prefix: str, value: Any) -> Iterator[LogColumn]:
    """Return the columns that a message, a field of it, or an element of a list holds."""
    if is_dataclass(value):
        for field in fields(value):
            # Constants of the type are fields too, with a default.
            if field.name not in vars(type(value)):
                yield from _leaves(f"{prefix}.{field.name}" if prefix else field.name, getattr(value, field.name))
    elif isinstance(value, list | bytes | np.ndarray):
        if len(value) <= _LONGEST_OFFERED:
            for k, element in enumerate(value):
                yield from _leaves(f"{prefix}[{k}]", element)
    else:
        yield LogColumn(prefix, is_text=isinstance(value, str))


def _extractor(name: str, beyond: float | str) -> Callable[[int, Any], Any]:
    """Make what takes a column's value from time in ns and message; `beyond` stands beyond the end of a list."""
    if name == LOG_TIME:
        return lambda stamp, message: stamp / _NANOSECONDS
    if name == HEADER_STAMP:
        return lambda stamp, message: _seconds(message.header.stamp)
    steps = [int(index) if index else field for index, field in _STEP.findall(name)]

    def extract(stamp: int, message: Any) -> Any:
        value = message
        for step in steps:
            if isinstance(step, str):
                value = getattr(value, step)
            elif step < len(value):
                value = value[step]
            else:
                return beyond
        return value

    return extract


def _seconds(stamp: Any) -> float:
    # One division of integers rounds once.
    return (stamp.sec * _NANOSECONDS + stamp.nanosec) / _NANOSECONDS
