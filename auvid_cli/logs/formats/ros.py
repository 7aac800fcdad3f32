"""Bags of ROS 1, and of ROS 2 as a folder, an .mcap or a .db3 file: a table for each topic."""

import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, ColumnValues, Log, LogColumn, Tables, missing

_MAX_LIST_LENGTH = 100  # elements that become columns; longer lists, such as images, are read by an index only
_NANOSECONDS = 10**9  # nanoseconds in 1 s
_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")
_REPAIR = {".bag": "rosbag reindex", ".mcap": "mcap recover"}


class _Topic(NamedTuple):
    columns: tuple[LogColumn, ...]
    note: str


class BagLog(Log):
    """A bag. Messages are decoded by its own definitions, or without any by those of ROS 2."""

    def tables(self) -> Tables:
        """Return the columns of each topic; the first message determines the length of lists.

        A topic without messages or without a definition has the time of the log only.
        """
        return {name: topic.columns for name, topic in self._topics.items()}

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Return fields by dotted paths; NaN or an empty text if a list is too short for an index."""
        if table not in self._topics:
            raise FileError(missing(self, "topic", table, self._topics))
        topic = self._topics[table]
        offered = {column.name: column for column in topic.columns}
        for name in columns:
            # A list may be longer than in the first message.
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
                        fields_there = [column.name for column in _leaves("", message)]
                        raise FileError(missing(self, f"number in {table}", name, fields_there)) from None
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
            return _Topic(time, f": the bag does not define its messages, {msgtype}")
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
        """Yield the time of the log, ns, and the message (None if its type is unknown) for each message of a topic."""
        connections = [connection for connection in reader.connections if connection.topic == topic]
        count = 0
        with damage_as_file_error(lambda reason: self._damaged(f"after {count} messages of {topic}", reason)):
            for connection, stamp, raw in reader.messages(connections):
                known = connection.msgtype in reader.typestore.fielddefs
                yield stamp, reader.deserialize(raw, connection.msgtype) if known else None
                count += 1

    def _damaged(self, where: str, reason: str) -> str:
        repair = _REPAIR.get(self.path.suffix, "ros2 bag reindex")
        return f"{self.path}: {where}: {reason}; a truncated bag may be repaired with {repair}"


def _leaves(prefix: str, value: Any) -> Iterator[LogColumn]:
    """Yield the columns of a message, a field or an element of a list."""
    if is_dataclass(value):
        for field in fields(value):
            # Constants of the type are fields with a default.
            if field.name not in vars(type(value)):
                yield from _leaves(f"{prefix}.{field.name}" if prefix else field.name, getattr(value, field.name))
    elif isinstance(value, list | bytes | np.ndarray):
        if len(value) <= _MAX_LIST_LENGTH:
            for k, element in enumerate(value):
                yield from _leaves(f"{prefix}[{k}]", element)
    else:
        yield LogColumn(prefix, is_text=isinstance(value, str))


def _extractor(name: str, beyond: float | str) -> Callable[[int, Any], Any]:
    """Return a function from time, ns, and message to a column's value; `beyond` is used beyond the end of a list."""
    if name == LOG_TIME:
        return lambda stamp, message: stamp / _NANOSECONDS
    if name == HEADER_STAMP:
        # A single division of integers rounds only once.
        return lambda stamp, message: (
            (message.header.stamp.sec * _NANOSECONDS + message.header.stamp.nanosec) / _NANOSECONDS
        )
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
