"""Logs of DUNE vehicles such as LAUV (.lsf, IMC messages): a table for each kind of message."""

import struct
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, ColumnValues, Log, LogColumn, look_up

try:
    import imcpy
except ModuleNotFoundError as error:
    raise FileError("reading IMC logs needs the package imcpy: pip install 'auvid[imc]'") from error

# Sync mark, kind, bytes of the fields, time, sender and its entity, addressee and its entity; behind them a check sum.
_HEADER, _FOOTER_BYTES = struct.Struct("<HHHdHBHB"), 2
_SOURCES = ("src", "src_ent")


class LsfLog(Log):
    """What DUNE writes; `@log_time` is when a message was sent. A message that is cut off at the end is left out."""

    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the fields of each kind of message that are numbers, with who sent it; IMC logs SI."""
        return {table: tuple(map(LogColumn, fields)) for table, fields in self._messages.items()}

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read fields by name."""
        look_up(self, table, columns)
        return {name: np.array(self._messages[table][name], np.float64) for name in columns}

    @cached_property
    def _messages(self) -> dict[str, dict[str, list[float]]]:
        tables: dict[str, dict[str, list[float]]] = {}
        with damage_as_file_error(lambda reason: f"{self.path}: is a damaged IMC log: {reason}"):
            for packet in _packets(self.path.read_bytes()):
                message = imcpy.Packet.deserialize(packet)
                fields = tables.setdefault(message.msg_name, {LOG_TIME: []})
                fields[LOG_TIME].append(message.timestamp)
                for name in _numbers(message):
                    fields.setdefault(name, []).append(float(getattr(message, name)))
        return tables


def _packets(data: bytes) -> Iterator[bytes]:
    at = 0
    while at + _HEADER.size <= len(data):
        size = _HEADER.size + _HEADER.unpack_from(data, at)[2] + _FOOTER_BYTES
        if at + size <= len(data):
            yield data[at : at + size]
        at += size


def _numbers(message: Any) -> list[str]:
    """Name the fields of a message that are numbers."""
    fields = [name for name in dir(type(message)) if isinstance(getattr(type(message), name), property)]
    return [
        name
        for name in (*_SOURCES, *fields)
        if isinstance(getattr(message, name), int | float) and name not in ("timestamp", "msg_id")
    ]
