"""Logs of ArduPilot (DataFlash, .BIN) and MAVLink telemetry (.tlog): a table for each kind of message.

A message that is cut off at the end of a log is left out.
"""

import mmap
import re
import struct
from array import array
from collections.abc import Iterator, Sequence
from contextlib import closing, redirect_stderr, redirect_stdout
from functools import cached_property
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.DFReader import FORMAT_TO_STRUCT, DFFormat, DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, ColumnValues, FileLog, LogColumn, Tables

_TICKS_PER_SECOND = {"TimeUS": 1e6, "TimeMS": 1e3}
_HEADER_BYTES = 3
_LIST_LENGTH = 32
_ELEMENT = re.compile(r"(?P<name>.+)\[(?P<index>\d+)\]")

# A telemetry log alternates time stamps and messages.
_STAMP_BYTES = 8
_VERSION_2 = mavlink.PROTOCOL_MARKER_V2
_OVERHEAD = {mavlink.PROTOCOL_MARKER_V1: 8, _VERSION_2: 12}  # bytes of a message without its payload
_MIN_PACKET_BYTES = 8
_HEAD_BYTES = 10


class DataFlashLog(FileLog):
    """Log on the card of the autopilot, with the messages that have a time; it counts from power-on.

    A message with several instances, such as IMU, has a table with all of them and one for each: IMU[0].
    """

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        kind, instance = _split(table)
        form, rows = self._rows(kind)
        if instance is not None:
            rows = rows[rows[form.instance_field] == instance]
        return {column.name: _values(form, rows, column) for column in columns}

    def _find_tables(self) -> Tables:
        tables = {}
        for kind in sorted(self._index):
            form, rows = self._rows(kind)
            if len(rows) and not _TICKS_PER_SECOND.keys().isdisjoint(form.columns):
                tables[kind] = tuple(_columns(form))
                for instance in np.unique(rows[form.instance_field]) if form.instance_field else ():
                    tables[f"{kind}[{instance}]"] = tables[kind]
        return tables

    @cached_property
    def _index(self) -> dict[str, tuple[DFFormat, list[int]]]:
        complaints = StringIO()
        refusing = damage_as_file_error(lambda reason: f"{self.path}: is damaged: {reason}")
        # The library prints a line for each invalid byte and continues.
        out, err = redirect_stdout(complaints), redirect_stderr(complaints)
        with refusing, out, err, closing(_Reader(str(self.path))) as reader:
            index = {name: (reader.formats[k], reader.offsets[k]) for name, k in reader.name_to_id.items()}
        if complaints.getvalue():
            raise FileError(f"{self.path}: is damaged: {complaints.getvalue().splitlines()[0]}")
        return index

    def _rows(self, kind: str) -> tuple[DFFormat, NDArray[np.void]]:
        form, offsets = self._index[kind]
        try:
            layout = np.dtype([(name, _dtype(code)) for name, code in zip(form.columns, form.format, strict=True)])
        except ValueError as error:
            raise FileError(f"{self.path}: damaged format of {kind}: {error}") from error
        with self.path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            starts = (offset + _HEADER_BYTES for offset in offsets)
            messages = (data[start : start + layout.itemsize] for start in starts)
            whole = b"".join(message for message in messages if len(message) == layout.itemsize)
        return form, np.frombuffer(whole, layout) if whole else np.empty(0, layout)


class _Reader(DFReader_binary):
    """The library's reader without its compiled scan and its guess of the date."""

    def init_arrays_fast(self, progress_callback: None = None) -> None:
        """Index the messages in Python, because the compiled scan prints errors to the terminal itself."""
        self.init_arrays(progress_callback)

    def init_clock(self) -> None:
        """Count time from power-on; the search for the date would read the whole log."""


def _dtype(code: str) -> np.dtype[Any]:
    if code == "a":
        return np.dtype(("<i2", (_LIST_LENGTH,)))
    written = FORMAT_TO_STRUCT[code][0]
    return np.dtype("S" + written[:-1] if written.endswith("s") else "<" + written)


def _columns(form: DFFormat) -> Iterator[LogColumn]:
    yield LogColumn(LOG_TIME, "s")
    for name, code in zip(form.columns, form.format, strict=True):
        unit = form.get_unit(name)
        if code == "a":
            yield from (LogColumn(f"{name}[{k}]", unit) for k in range(_LIST_LENGTH))
        else:
            yield LogColumn(name, unit, is_text=code in "nNZ")


def _values(form: DFFormat, rows: NDArray[np.void], column: LogColumn) -> ColumnValues:
    if column.name == LOG_TIME:
        name = next(name for name in _TICKS_PER_SECOND if name in form.columns)
        return rows[name] / _TICKS_PER_SECOND[name]
    if column.is_text:
        # Bytes after the zero byte of a text are arbitrary.
        return np.array([text.split(b"\0")[0].decode("utf-8", "backslashreplace") for text in rows[column.name]], str)
    name, index = _split(column.name)
    values = (rows[name] if index is None else rows[name][:, index]).astype(np.float64)
    factor = form.msg_mults[form.columns.index(name)]
    # Factors such as 0.01 have no exact binary form; their inverses have.
    return values if factor is None else values / round(1.0 / factor)


class TelemetryLog(FileLog):
    """MAVLink messages that a ground station received, with the time of the ground station."""

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        values = {column.name: [] if column.is_text else array("d") for column in columns}
        places = {column.name: _split(column.name) for column in columns if column.name != LOG_TIME}
        number = next(number for number, kind in mavlink.mavlink_map.items() if kind.msgname == table)
        parser = mavlink.MAVLink(None)
        for start, seconds, packet in self._packets(number):
            try:
                message = parser.decode(bytearray(packet))
            except (mavlink.MAVError, struct.error) as error:
                raise FileError(f"{self.path}: byte {start}: a damaged {table} message: {error}") from error
            for name, column_values in values.items():
                if name == LOG_TIME:
                    column_values.append(seconds)
                else:
                    field, index = places[name]
                    value = getattr(message, field)
                    column_values.append(value if index is None else value[index])
        return {name: np.array(column, None if isinstance(column, array) else str) for name, column in values.items()}

    def _find_tables(self) -> Tables:
        kinds = {mavlink.mavlink_map[number] for number in {_number(packet) for _, _, packet in self._packets()}}
        if not kinds:
            raise FileError(f"{self.path}: no known MAVLink message")
        return {kind.msgname: tuple(_message_columns(kind)) for kind in sorted(kinds, key=lambda kind: kind.msgname)}

    def _packets(self, number: int | None = None) -> Iterator[tuple[int, float, bytes]]:
        """Yield offset, time in s since 1970 and bytes of each known message, or of those of one kind."""
        data = self.path.read_bytes()
        start = 0
        while start + _STAMP_BYTES + _MIN_PACKET_BYTES <= len(data):
            head = data[start + _STAMP_BYTES : start + _STAMP_BYTES + _HEAD_BYTES]
            if head[0] not in _OVERHEAD:
                raise FileError(f"{self.path}: byte {start}: damaged: expected a MAVLink message here")
            signed = head[0] == _VERSION_2 and head[2] & mavlink.MAVLINK_IFLAG_SIGNED
            length = head[1] + _OVERHEAD[head[0]] + (mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if signed else 0)
            end = start + _STAMP_BYTES + length
            if end > len(data):
                return
            message = _number(head)
            if message in mavlink.mavlink_map and number in (None, message):
                (stamp,) = struct.unpack_from(">Q", data, start)
                yield start, stamp / 1e6, data[start + _STAMP_BYTES : end]
            start = end


def _number(packet: bytes) -> int:
    return int.from_bytes(packet[7:10], "little") if packet[0] == _VERSION_2 else packet[5]


def _message_columns(kind: Any) -> Iterator[LogColumn]:
    yield LogColumn(LOG_TIME, "s")
    # Lengths are in the order of transmission.
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    for name, written in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        length = lengths[name]
        unit = kind.fieldunits_by_name.get(name, "")
        if written == "char" or not length:
            yield LogColumn(name, unit, is_text=written == "char")
        else:
            yield from (LogColumn(f"{name}[{k}]", unit) for k in range(length))


def _split(column: str) -> tuple[str, int | None]:
    """Return a name and its index, if it is an element of a list."""
    element = _ELEMENT.fullmatch(column)
    return (element["name"], int(element["index"])) if element else (column, None)
