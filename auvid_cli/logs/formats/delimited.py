"""Logs of delimited text, plain or compressed with gzip."""

import codecs
import gzip
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from auvid_cli.config.log_map import LogFile
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import ColumnValues, FileLog, LogColumn, Tables
from auvid_cli.logs.formats.text_layout import (
    BLANKS,
    COMMENT_MARKS,
    FLAGS,
    MISSING_VALUES,
    UTF_16,
    Header,
    is_filler,
    is_number,
    read_header,
    split_row,
)

_BLOCK_BYTES = 1 << 24  # bytes that are read at a time
_MAX_LINE_BYTES = 1 << 26
_HEAD_BYTES = 1 << 17  # bytes from which the layout is found
_CHUNK_ROWS = 100_000
_WHITE = np.frombuffer(b" \t\r\n", np.uint8)
_GZIP = b"\x1f\x8b"
_OPEN_QUOTE = "a quotation mark is not closed, or a field continues on the next line"


class TextRows(NamedTuple):
    """Number of lines of a text log, lines after the header without values (counted from 1), and encoding."""

    lines: int
    filler: frozenset[int]  # including a last row that is cut short
    encoding: str
    is_cut: bool  # whether the last row is cut short
    repeated_headers: int


def survey(path: Path, file: IO[bytes], header: Header) -> TextRows:
    """Count the lines of a log, and check the number of fields in each row.

    Raises
    ------
    FileError
        If a row has too many or too few fields, or zero bytes after a power cut.
    """
    lines, repeated_headers = 0, 0
    filler: set[int] = set()
    heading = header.names[0].encode()[:1] if header.line else b""
    utf8 = codecs.getincrementaldecoder("utf-8")()
    encoding = "utf-8"
    is_cut = False
    for block, is_whole in _whole_lines(path, file):
        encoding = encoding if encoding == "latin-1" or _decodes(utf8, block) else "latin-1"
        data = np.frombuffer(block, np.uint8)
        ends = np.flatnonzero(data == ord("\n"))
        starts = np.concatenate(([0], ends[:-1] + 1))
        if (zero := block.find(0)) >= 0:
            number = lines + int(np.searchsorted(ends, zero)) + 1
            raise FileError(
                f"{path}:{number}: zero bytes, as after a power cut: delete this row and all following ones"
            )
        fields = _count_fields(data, ends, header.delimiter)
        suspects = (fields != header.fields) | _may_be_filler(data[starts], header.delimiter)
        if heading:
            suspects |= data[starts] == heading[0]
        for k in np.flatnonzero(suspects):
            number = lines + int(k) + 1
            if number <= header.line:
                continue
            line = block[starts[k] : ends[k]].decode(encoding, errors="replace")
            if is_filler(line, header.delimiter):
                filler.add(number)
                continue
            row = split_row(line, header.delimiter)
            if header.line and row[: len(header.names)] == [*header.names]:
                filler.add(number)
                repeated_headers += 1
            elif len(row) < header.fields and not is_whole:
                filler.add(number)
                is_cut = True
            elif len(row) != header.fields:
                raise FileError(
                    f"{path}:{number}: row with {len(row)} fields; expected {header.fields} as in the others"
                )
        lines += len(ends)
    return TextRows(lines, frozenset(filler), encoding, is_cut, repeated_headers)


def _whole_lines(path: Path, file: IO[bytes]) -> Iterator[tuple[bytes, bool]]:
    """Yield blocks of whole lines that end with a line feed, and a last line without one, to which it is added."""
    rest = b""
    while block := file.read(_BLOCK_BYTES):
        whole, feed, rest = (rest + block).rpartition(b"\n")
        if feed:
            yield whole + feed, True
        elif len(rest) > _MAX_LINE_BYTES:
            raise FileError(f"{path}: a line of more than {_MAX_LINE_BYTES >> 20} MB; expected a table")
    if rest:
        yield rest + b"\n", False


def _decodes(decoder: codecs.IncrementalDecoder, block: bytes) -> bool:
    if block.isascii():
        return True
    try:
        decoder.decode(block)
    except UnicodeDecodeError:
        return False
    return True


def _count_fields(data: NDArray[np.uint8], ends: NDArray[np.int64], delimiter: str) -> NDArray[np.int64]:
    """Return the number of fields in each line, as if none were quoted."""
    if delimiter == BLANKS:
        blank = np.isin(data, _WHITE)
        marks = np.flatnonzero(~blank & np.concatenate(([True], blank[:-1])))
        return np.diff(np.searchsorted(marks, ends), prepend=0)
    marks = np.flatnonzero(data == ord(delimiter))
    return np.diff(np.searchsorted(marks, ends), prepend=0) + 1


def _may_be_filler(first: NDArray[np.uint8], delimiter: str) -> NDArray[np.bool_]:
    """Return whether lines begin like filler, by their first bytes."""
    signs = "".join(mark[0] for mark in COMMENT_MARKS) + delimiter + ' \t\r\n"'
    return np.isin(first, np.frombuffer(signs.encode(), np.uint8))


class DelimitedLog(FileLog):
    """A log of delimited text, whose rows are all checked; `layout` states what its header does not show.

    If a log has more than `max_bytes`, only its beginning is read, and `is_cut` is true.
    """

    def __init__(self, path: Path, layout: LogFile, max_bytes: int | None = None) -> None:
        super().__init__(path)
        self._max_bytes = max_bytes
        self._missing = (*MISSING_VALUES, *layout.missing)
        with self._opened() as file:
            head = file.read(_HEAD_BYTES)
        if len(head) == _HEAD_BYTES:
            head, feed, _ = head.rpartition(b"\n")
            if not feed:
                raise FileError(f"{path}:1: a line of more than {_HEAD_BYTES >> 10} kB; expected names of columns")
        # Only a line feed ends a line, as in `survey`.
        lines = _decode(head).removesuffix("\n").split("\n")
        self._header: Header = read_header(path, lines, layout)

    def _find_tables(self) -> Tables:
        return {"": self._header.columns}

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        positions = {column.name: self._header.columns.index(column) for column in columns}
        try:
            values = self._parse(list(positions.values()), strict=True)
        except ValueError:
            # Blanks around numbers, or invalid numbers: slower, but errors name the line.
            values = self._parse(list(positions.values()), strict=False)
        return {name: values[position] for name, position in positions.items()}

    def remarks(self) -> tuple[str, ...]:
        """Return which rows are left out."""
        cut = ("the last row is cut short: left out",) if self._rows.is_cut else ()
        repeated = self._rows.repeated_headers
        return (*cut, f"{repeated} repeated headers skipped") if repeated else cut

    @cached_property
    def _rows(self) -> TextRows:
        with self._opened() as file:
            return survey(self.path, file, self._header)

    @contextmanager
    def _opened(self) -> Iterator[IO[bytes]]:
        try:
            with self.path.open("rb") as plain:
                compressed = plain.read(2) == _GZIP
                plain.seek(0)
                file = cast(IO[bytes], gzip.GzipFile(fileobj=plain)) if compressed else plain
                head = file.read(2)
                file.seek(0)
                if head in UTF_16:
                    file = BytesIO(file.read().decode("utf-16").encode())
                yield file if self._max_bytes is None else self._beginning(file, self._max_bytes)
        except UnicodeDecodeError as error:
            raise FileError(f"{self.path}: byte {error.start}: damaged UTF-16 text: save it as UTF-8") from error
        except (OSError, EOFError, zlib.error) as error:
            raise FileError(f"{self.path}: cannot be read: {error}") from error

    def _beginning(self, file: IO[bytes], max_bytes: int) -> IO[bytes]:
        """Return the whole lines of the first bytes of a file."""
        content = file.read(max_bytes)
        self.is_cut = len(content) == max_bytes
        return BytesIO(content[: content.rfind(b"\n") + 1] if self.is_cut else content)

    def _parse(self, positions: Sequence[int], strict: bool) -> dict[int, ColumnValues]:
        """Return columns by position; if strict, ValueError for numbers that pandas does not parse."""
        header, rows = self._header, self._rows
        count = rows.lines - header.line - len(rows.filler)
        numeric = {k: np.empty(count) for k in positions if not header.columns[k].is_text}
        text: dict[int, list[NDArray[np.str_]]] = {k: [] for k in positions if header.columns[k].is_text}
        fast = {k for k in numeric if strict and not header.is_flag[k] and not header.suffixes[k]}
        start = 0
        for chunk in self._chunks(positions, fast):
            stop = start + len(chunk)
            if stop > count:
                break
            for k, values in numeric.items():
                values[start:stop] = chunk[str(k)].to_numpy() if k in fast else self._numbers(chunk[str(k)], k, start)
            for k, parts in text.items():
                parts.append(np.strings.strip(chunk[str(k)].to_numpy(dtype=str)))
            start = stop
        if start != count:
            raise FileError(f"{self.path}: {_OPEN_QUOTE} ({start} rows on {count} lines)")
        texts = {k: np.concatenate(parts) if parts else np.empty(0, dtype=str) for k, parts in text.items()}
        return {**numeric, **texts}

    def _chunks(self, positions: Sequence[int], fast: set[int]) -> Iterator[pd.DataFrame]:
        """Yield rows in chunks; columns in `fast` as numbers, others as text."""
        header, rows = self._header, self._rows
        if rows.lines == header.line + len(rows.filler):
            return
        try:
            with self._opened() as file:
                yield from pd.read_csv(
                    file,
                    sep=r"\s+" if header.delimiter == BLANKS else header.delimiter,
                    header=None,
                    index_col=False,
                    names=[str(k) for k in range(header.fields)],
                    usecols=[str(k) for k in sorted(set(positions))],
                    dtype={str(k): np.float64 if k in fast else str for k in positions},
                    skiprows=[*range(header.line), *(number - 1 for number in rows.filler)],
                    skipinitialspace=True,
                    na_values={str(k): self._missing for k in fast},
                    keep_default_na=False,
                    decimal=header.decimal,
                    encoding=rows.encoding,
                    chunksize=_CHUNK_ROWS,
                )
        except pd.errors.ParserError as error:
            raise FileError(f"{self.path}: {_OPEN_QUOTE} ({error})") from error

    def _numbers(self, fields: Iterable[str], position: int, start: int) -> NDArray[np.float64]:
        """Convert a column's fields, from the row `start`, to numbers; errors name the line."""
        column, is_flag = self._header.columns[position], self._header.is_flag[position]
        suffix, decimal = self._header.suffixes[position], self._header.decimal
        numbers = []
        for row, padded in enumerate(fields, start):
            field = padded.strip()
            number = field.removesuffix(suffix).rstrip() if suffix else field
            if field in self._missing or (suffix and number in self._missing):
                numbers.append(np.nan)
            elif is_flag and field.lower() in FLAGS:
                numbers.append(FLAGS[field.lower()])
            elif is_number(number, decimal) and not is_flag and (not suffix or number != field):
                numbers.append(float(number.replace(decimal, ".")))
            else:
                lines = np.arange(self._header.line + 1, self._rows.lines + 1)
                line = np.setdiff1d(lines, list(self._rows.filler))[row]
                expected = "true or false" if is_flag else f"a number in {suffix}" if suffix else "a number"
                raise FileError(f"{self.path}:{line}: {column.name!r} is {field!r}; expected {expected}")
        return np.array(numbers)


def _decode(head: bytes) -> str:
    try:
        return head.decode("utf-8-sig")
    except UnicodeDecodeError:
        return head.decode("latin-1")
