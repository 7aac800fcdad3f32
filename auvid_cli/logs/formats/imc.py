"""Logs of DUNE vehicles (IMC): .lsf files, plain or compressed with gzip.

The framing is that of the IMC protocol (LSTS/imc, ``IMC.xml``): a header with a synchronisation mark, the fields, and a
CRC-16-IBM of both. Messages of numbers only are read together, as arrays; the others one by one with imcpy.
"""

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, LoadedLog

_SYNC = b"\x54\xfe"
_HEADER = {
    "sync": ("<u2", 0),
    "id": ("<u2", 2),
    "size": ("<u2", 4),
    "time": ("<f8", 6),
    "src": ("<u2", 14),
    "src_ent": ("u1", 16),
    "dst": ("<u2", 17),
    "dst_ent": ("u1", 19),
}  # type and offset
_HEADER_BYTES = 20
_START = struct.Struct("<HHH")
_FOOTER_BYTES = 2
_SENDER = ("src", "src_ent", "dst", "dst_ent")
_NOT_FIELDS = ("timestamp", "msg_id", "msg_name", *_SENDER)
_DTYPES = ("<u1", "<u2", "<u4", "<u8", "<i1", "<i2", "<i4", "<i8")
_GZIP = b"\x1f\x8b"


class LsfLog(LoadedLog):
    """Log of DUNE: a table for each kind of message with its numeric fields and sender, in SI.

    A kind of message with several senders has a table for each of them, named by system and entity: EulerAngles[30.21].
    `LOG_TIME` is the time at which a message was sent. Damaged messages are left out.
    """

    def __init__(self, path: Path) -> None:
        import imcpy

        super().__init__(path)
        self._deserialize = imcpy.Packet.deserialize

    def _load(self) -> dict[str, dict[str, NDArray[np.float64]]]:
        data, is_cut = _content(self.path)
        starts, damaged = _frames(data)
        if is_cut or (starts and starts[-1] + _size(data, starts[-1]) < len(data)):
            self._remarks.append("the last message is cut short: left out")
        tables: dict[str, dict[str, NDArray[np.float64]]] = {}
        n_wrong = 0
        for blocks in _by_kind(data, starts):
            kept = []
            for block in blocks:
                right = _checksums(block[:, :-_FOOTER_BYTES]) == block[:, -_FOOTER_BYTES:].copy().view("<u2")[:, 0]
                n_wrong += int(np.count_nonzero(~right))
                kept += [block[right]] if right.any() else []
            if kept:
                tables |= self._tables_of(kept)
        if damaged or n_wrong:
            self._remarks.append(f"{damaged + n_wrong} damaged spots skipped, up to the next message")
        if not tables:
            raise FileError(f"{self.path}: is a damaged IMC log: no complete message")
        return tables

    def _tables_of(self, blocks: list[NDArray[np.uint8]]) -> dict[str, dict[str, NDArray[np.float64]]]:
        first = self._message(blocks[0][0])
        layout = _layout(first) if len(blocks) == 1 else None
        if layout is None or not self._agrees(layout, blocks[0]):
            columns = self._one_by_one(blocks)
        else:
            rows = np.ascontiguousarray(blocks[0]).view(layout)[:, 0]
            columns = {LOG_TIME: rows["time"]} | {name: rows[name].astype(np.float64) for name in _SENDER}
            columns |= {name: rows[f"field {name}"].astype(np.float64) for name in _numeric_fields(first)}
        name = first.msg_name
        senders = np.unique(np.stack([columns["src"], columns["src_ent"]]), axis=1).T
        if len(senders) == 1:
            return {name: columns}
        tables = {}
        for src, entity in senders:
            sent = (columns["src"] == src) & (columns["src_ent"] == entity)
            tables[f"{name}[{src:.0f}.{entity:.0f}]"] = {key: values[sent] for key, values in columns.items()}
        return tables

    def _message(self, row: NDArray[np.uint8]) -> Any:
        try:
            return self._deserialize(row.tobytes())
        except (OSError, RuntimeError, ValueError, TypeError) as error:
            raise FileError(f"{self.path}: an IMC message that imcpy does not read: {error}") from error

    def _agrees(self, layout: np.dtype[Any], block: NDArray[np.uint8]) -> bool:
        """Whether the layout gives the fields that imcpy decodes in the first, middle and last message."""
        for k in {0, len(block) // 2, len(block) - 1}:
            row, message = np.ascontiguousarray(block[k]).view(layout)[0], self._message(block[k])
            for name in _numeric_fields(message):
                if not np.array_equal(row[f"field {name}"], getattr(message, name), equal_nan=True):
                    return False
        return True

    def _one_by_one(self, blocks: list[NDArray[np.uint8]]) -> dict[str, NDArray[np.float64]]:
        columns: dict[str, list[float]] = {}
        for block in blocks:
            for row in block:
                message = self._message(row)
                columns.setdefault(LOG_TIME, []).append(message.timestamp)
                for name in (*_SENDER, *_numeric_fields(message)):
                    columns.setdefault(name, []).append(float(getattr(message, name)))
        length = len(columns[LOG_TIME])
        return {name: np.array(values) for name, values in columns.items() if len(values) == length}


def _content(path: Path) -> tuple[bytes, bool]:
    """Return the bytes of a log, and whether its compressed file is cut short."""
    data = path.read_bytes()
    if not data.startswith(_GZIP):
        return data, False
    content, reader = [], zlib.decompressobj(zlib.MAX_WBITS | 16)
    try:
        while data:
            content.append(reader.decompress(data))
            if not reader.eof:
                return b"".join(content), True
            data = reader.unused_data
            reader = zlib.decompressobj(zlib.MAX_WBITS | 16)
    except zlib.error as error:
        raise FileError(f"{path}: is a damaged compressed file: {error}") from error
    return b"".join(content), False


def _size(data: bytes, start: int) -> int:
    return _HEADER_BYTES + _START.unpack_from(data, start)[2] + _FOOTER_BYTES


def _frames(data: bytes) -> tuple[list[int], int]:
    """Return the offsets of messages, and the number of damaged spots between them."""
    starts: list[int] = []
    damaged, at, after_damage = 0, 0, False
    while at + _HEADER_BYTES <= len(data):
        sync, _, size = _START.unpack_from(data, at)
        following = at + _HEADER_BYTES + size + _FOOTER_BYTES
        if sync == 0xFE54:
            is_followed = data[following : following + 2] == _SYNC
            if is_followed and not after_damage:
                starts.append(at)
                at = following
                continue
            if following <= len(data) and _is_intact(data[at:following]):
                starts.append(at)
                at, after_damage = following, False
                continue
        following = data.find(_SYNC, at + 1)
        if following < 0:
            # A message that is cut off at the end is not damage.
            return starts, damaged + (sync != 0xFE54 and not after_damage)
        damaged += not after_damage
        at, after_damage = following, True
    return starts, damaged


def _is_intact(packet: bytes) -> bool:
    row = np.frombuffer(packet, np.uint8)[None]
    return int(_checksums(row[:, :-_FOOTER_BYTES])[0]) == int.from_bytes(packet[-_FOOTER_BYTES:], "little")


def _by_kind(data: bytes, starts: Sequence[int]) -> list[list[NDArray[np.uint8]]]:
    """Return the messages of each kind: the bytes of messages of one size, shape (n, size)."""
    octets = np.frombuffer(data, np.uint8)
    at = np.array(starts, np.int64)
    heads = octets[at[:, None] + np.arange(_START.size)].reshape(len(at), _START.size).copy().view("<u2")
    kinds: list[list[NDArray[np.uint8]]] = []
    for number in dict.fromkeys(heads[:, 1].tolist()):
        of_kind = heads[:, 1] == number
        blocks: list[NDArray[np.uint8]] = []
        kinds.append(blocks)
        for size in np.unique(heads[of_kind, 2]):
            chosen = at[of_kind & (heads[:, 2] == size)]
            width = _HEADER_BYTES + int(size) + _FOOTER_BYTES
            blocks.append(octets[chosen[:, None] + np.arange(width)])
    return kinds


def _crc_table() -> NDArray[np.uint16]:
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = (table >> 1) ^ (table & 1) * np.uint16(0xA001)
    return table.astype(np.uint16)


_CRC = _crc_table()


def _checksums(rows: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return the CRC-16-IBM of each row."""
    crc = np.zeros(len(rows), np.uint16)
    for column in rows.T:
        crc = _CRC[(crc ^ column) & 0xFF] ^ (crc >> 8)
    return crc.astype(np.uint16)


def _numeric_fields(message: Any) -> list[str]:
    fields = [name for name in dir(type(message)) if isinstance(getattr(type(message), name), property)]
    return [name for name in fields if name not in _NOT_FIELDS and isinstance(getattr(message, name), int | float)]


def _layout(message: Any) -> np.dtype[Any] | None:
    """Return the layout of a message of numbers only; None if it has other fields.

    imcpy does not tell the places of fields. They show when a field is changed and the message is written again.
    """
    properties = [name for name in dir(type(message)) if isinstance(getattr(type(message), name), property)]
    names = _numeric_fields(message)
    if {*properties} != {*names, *_NOT_FIELDS}:
        return None
    offset = _HEADER_BYTES
    places: dict[str, tuple[str, int]] = {}
    for name in names:
        place = _place(message, name)
        if place is None:
            return None
        places[f"field {name}"] = place[0], offset + place[1]
    size = offset + len(message.serialize_fields()) + _FOOTER_BYTES
    dtypes, offsets = zip(*(_HEADER | places).values(), strict=True)
    return np.dtype({"names": [*_HEADER, *places], "formats": dtypes, "offsets": offsets, "itemsize": size})


def _place(message: Any, name: str) -> tuple[str, int] | None:
    """Return type and offset of a number among the fields; None if it is not found."""
    before = message.clone() if hasattr(message, "clone") else message
    is_float = isinstance(getattr(before, name), float)
    for dtype in ("<f4", "<f8") if is_float else _DTYPES:
        # Values of which each byte differs from those of the other.
        width = np.dtype(dtype).itemsize
        low, high = (np.frombuffer(bytes([k] * width), dtype)[0].item() for k in (0x11, 0x22))
        written = []
        try:
            for value in (low, high):
                setattr(before, name, value)
                written.append(np.frombuffer(before.serialize_fields(), np.uint8))
        except (TypeError, ValueError, OverflowError):
            continue
        if written[0].size != written[1].size:
            return None
        changed = np.flatnonzero(written[0] != written[1])
        if changed.size == width and (np.diff(changed) == 1).all() and (written[0][changed] == 0x11).all():
            signed = not is_float and dtype[1] == "u" and _takes_negative(before, name)
            return f"<i{width}" if signed else dtype, int(changed[0])
    return None


def _takes_negative(message: Any, name: str) -> bool:
    try:
        setattr(message, name, -1)
    except (TypeError, ValueError, OverflowError):
        return False
    return True
