"""Bags of ROS 1, and of ROS 2 as a folder, an .mcap or a .db3 file: a table for each topic."""

import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cached_property
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import HEADER_STAMP, LOG_TIME, ColumnValues, Log, LogColumn, Tables, missing

_MAX_LIST_LENGTH = 100  # elements that become columns; longer lists, such as images, are read by an index only
_FIRST_MESSAGES = 200  # messages of a topic that are searched for filled lists
_NANOSECONDS = 10**9  # nanoseconds in 1 s
_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")
_REPAIR = {".bag": "rosbag reindex", ".mcap": "mcap recover"}


class _Topic(NamedTuple):
    columns: tuple[LogColumn, ...]
    note: str
    is_unreadable: bool = False


class BagLog(Log):
    """A bag. Messages are decoded by its own definitions, by those of ROS 2, or by the given `definitions`."""

    def tables(self) -> Tables:
        """Return the columns of each topic; the longest of the first messages determines the length of lists.

        A topic without messages, without a definition or with a wrong one has the time of the log only.
        """
        return {name: topic.columns for name, topic in self._topics.items()}

    def remarks(self) -> tuple[str, ...]:
        """Return the topics that are not decoded, with the reason."""
        return tuple(f"{name}{topic.note}" for name, topic in self._topics.items() if topic.is_unreadable)

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

    def _register(self, reader: AnyReader) -> None:
        """Replace definitions by the given ones; default of the package: that which lacks it."""
        undefined = sorted({c.msgtype for c in reader.connections} - reader.typestore.fielddefs.keys())
        packages = {name.split("/")[-1]: name.split("/")[0] for name in undefined}
        types: dict[str, Any] = {}
        for path in self.definitions:
            try:
                text = path.read_text(encoding="utf-8")
                folder = path.parent.parent.name if path.parent.name == "msg" else ""
                package = folder or packages.get(path.stem) or next(iter(packages.values()), "")
                types |= get_types_from_msg(text, f"{package}/msg/{path.stem}")
            except (OSError, UnicodeDecodeError, TypesysError) as error:
                raise FileError(f"{path}: not a definition of a message: {error}") from error
        if types:
            for name in types:
                reader.typestore.fielddefs.pop(name, None)
            reader.typestore.register(types)

    def _topic(self, reader: AnyReader, topic: str, msgtype: str) -> _Topic:
        time = (LogColumn(LOG_TIME),)
        package, _, kind = msgtype.rpartition("/")
        give = f"name its file in the map, `logs: {{bag: {{file: ..., messages: [{package}/{kind}.msg]}}}}`"
        if msgtype not in reader.typestore.fielddefs:
            return _Topic(time, f": the bag does not define its messages, {msgtype}: {give}", is_unreadable=True)
        if not self._is_decodable(reader, topic):
            return _Topic(time, f": its messages do not fit the definition of {msgtype}: {give}", is_unreadable=True)
        message, columns = None, ()
        for _, message in islice(self._messages(reader, topic), _FIRST_MESSAGES):
            columns = max(columns, tuple(_leaves("", message)), key=len)
            if not _has_empty_list(message):
                break
        if message is None:
            return _Topic(time, ": the topic has no messages")
        has_stamp = hasattr(getattr(getattr(message, "header", None), "stamp", None), "nanosec")
        stamp = (LogColumn(HEADER_STAMP),) if has_stamp else ()
        return _Topic((*time, *stamp, *columns), "")

    def _is_decodable(self, reader: AnyReader, topic: str) -> bool:
        connections = [connection for connection in reader.connections if connection.topic == topic]
        with damage_as_file_error(lambda reason: self._damaged(f"in {topic}", reason)):
            first = next(reader.messages(connections), None)
        if first is None:
            return True
        try:
            with damage_as_file_error(lambda reason: reason):
                reader.deserialize(first[2], first[0].msgtype)
        except FileError:
            return False
        return True

    @contextmanager
    def _opened(self) -> Iterator[AnyReader]:
        with damage_as_file_error(lambda reason: self._damaged("it cannot be opened", reason)):
            reader = AnyReader([self.path], default_typestore=get_typestore(Stores.LATEST))
            reader.open()
        try:
            self._register(reader)
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


def _has_empty_list(value: Any) -> bool:
    """Whether a message has a list without elements, which other messages may have."""
    if is_dataclass(value):
        return any(_has_empty_list(getattr(value, field.name)) for field in fields(value))
    return isinstance(value, list | np.ndarray) and len(value) == 0


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
