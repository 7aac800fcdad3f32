"""Delimited text files: rows in their layout, to columns with units."""

import codecs
import gzip
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import IO, NamedTuple, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import ColumnValues, Log, LogColumn, look_up
from auvid_cli.logs.formats.text_layout import (
    BLANKS,
    COMMENT_MARKS,
    FLAGS,
    MISSING_VALUES,
    Header,
    TextLayout,
    is_filler,
    is_number,
    read_header,
    split_row,
)

_BLOCK_BYTES = 1 << 24
_LONGEST_LINE = 1 << 26
_WHITE = np.frombuffer(b" \t\r\n", np.uint8)
_GZIP = b"\x1f\x8b"
_OPEN_QUOTE = "a quotation mark is left open, or a field goes on in the next line"
_HEAD_BYTES = 1 << 17
_CHUNK_ROWS = 100_000


class TextRows(NamedTuple):
    """What is known of all rows of a text log.

    Attributes
    ----------
    lines : int
        Of the log.
    filler : frozenset of int
        Lines after the header that hold no values, counted from 1.
    encoding : str
    """

    lines: int
    filler: frozenset[int]
    encoding: str

    def numbers(self, header: Header) -> NDArray[np.int64]:
        """Return the lines that hold values, counted from 1."""
        return np.setdiff1d(np.arange(header.line + 1, self.lines + 1), list(self.filler))


def survey(path: Path, file: IO[bytes], header: Header) -> TextRows:
    """Count the rows, find the lines to leave out, and check that every row has its fields.

    Parameters
    ----------
    path : pathlib.Path
        Of the log, to be named in errors.
    file : binary file
        The log from its beginning.
    header : Header

    Raises
    ------
    FileError
        If a row has fields too many or too few, or zero bytes where power went off.
    """
    lines = 0
    filler: set[int] = set()
    utf8 = codecs.getincrementaldecoder("utf-8")()
    encoding = "utf-8"
    for block in _whole_lines(path, file):
        encoding = encoding if encoding == "latin-1" or _decodes(utf8, block) else "latin-1"
        data = np.frombuffer(block, np.uint8)
        ends = np.flatnonzero(data == ord("\n"))
        starts = np.concatenate(([0], ends[:-1] + 1))
        if (zero := block.find(0)) >= 0:
            number = lines + int(np.searchsorted(ends, zero)) + 1
            raise FileError(f"{path}:{number}: zero bytes, as after a power cut: delete this row and what follows it")
        fields = _count_fields(data, ends, header.delimiter)
        suspects = (fields != header.fields) | _may_be_filler(data[starts], header.delimiter)
        for k in np.flatnonzero(suspects):
            number = lines + int(k) + 1
            if number <= header.line:
                continue
            line = block[starts[k] : ends[k]].decode(encoding, errors="replace")
            if is_filler(line, header.delimiter):
                filler.add(number)
            elif (n_fields := len(split_row(line, header.delimiter))) != header.fields:
                raise FileError(f"{path}:{number}: a row of {n_fields} fields where the others have {header.fields}")
        lines += len(ends)
    return TextRows(lines, frozenset(filler), encoding)


def _whole_lines(path: Path, file: IO[bytes]) -> Iterator[bytes]:
    """Yield blocks of whole lines, each ended by a line feed."""
    rest = b""
    while block := file.read(_BLOCK_BYTES):
        whole, feed, rest = (rest + block).rpartition(b"\n")
        if feed:
            yield whole + feed
        elif len(rest) > _LONGEST_LINE:
            raise FileError(f"{path}: has a line of more than {_LONGEST_LINE >> 20} MB, and is no table")
    if rest:
        yield rest + b"\n"


def _decodes(decoder: codecs.IncrementalDecoder, block: bytes) -> bool:
    if block.isascii():
        return True
    try:
        decoder.decode(block)
    except UnicodeDecodeError:
        return False
    return True


def _count_fields(data: NDArray[np.uint8], ends: NDArray[np.int64], delimiter: str) -> NDArray[np.int64]:
    """Count the fields of each line, as if none were quoted."""
    if delimiter == BLANKS:
        blank = np.isin(data, _WHITE)
        marks = np.flatnonzero(~blank & np.concatenate(([True], blank[:-1])))
        return np.diff(np.searchsorted(marks, ends), prepend=0)
    marks = np.flatnonzero(data == ord(delimiter))
    return np.diff(np.searchsorted(marks, ends), prepend=0) + 1


def _may_be_filler(first: NDArray[np.uint8], delimiter: str) -> NDArray[np.bool_]:
    """Say whether lines begin like filler, by their first bytes."""
    signs = "".join(mark[0] for mark in COMMENT_MARKS) + delimiter + ' \t\r\n"'
    return np.isin(first, np.frombuffer(signs.encode(), np.uint8))


class DelimitedLog(Log):
    """A log of delimited text, plain or compressed with gzip.

    Parameters
    ----------
    path : pathlib.Path
    layout : TextLayout
        What its header does not tell.
    """

    def __init__(self, path: Path, layout: TextLayout) -> None:
        super().__init__(path)
        self._missing = (*MISSING_VALUES, *layout.missing)
        with self._opened() as file:
            head = file.read(_HEAD_BYTES)
        if len(head) == _HEAD_BYTES:
            head, feed, _ = head.rpartition(b"\n")
            if not feed:
                raise FileError(f"{path}:1: a line of more than {_HEAD_BYTES >> 10} kB where names should be")
        # As the rows are counted: at nothing but a line feed.
        lines = _decode(head).removesuffix("\n").split("\n")
        self._header: Header = read_header(path, lines, layout)

    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the columns by their headings."""
        return {"": self._header.columns}

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read columns by name, after every row has been checked for its fields."""
        positions = {column.name: self._header.columns.index(column) for column in look_up(self, table, columns)}
        try:
            values = self._read(list(positions.values()), strict=True)
        except ValueError:
            # Blanks around numbers, or what is no number: slower, but it knows the line.
            values = self._read(list(positions.values()), strict=False)
        return {name: values[position] for name, position in positions.items()}

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
                yield cast(IO[bytes], gzip.GzipFile(fileobj=plain)) if compressed else plain
        except (OSError, EOFError, zlib.error) as error:
            raise FileError(f"{self.path}: cannot be read: {error}") from error

    def _read(self, positions: Sequence[int], strict: bool) -> dict[int, ColumnValues]:
        """Read columns by position; if strict, numbers are what pandas takes for one, or it raises ValueError."""
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
        """Read some rows after the other, as numbers or, what is not fast, as text."""
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
        """Convert a column's fields, from the row `start` on, to numbers; a field that is none is named by its line."""
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
                line = self._rows.numbers(self._header)[row]
                expected = "true or false" if is_flag else f"a number in {suffix}" if suffix else "a number"
                others = ", as in the other rows" if suffix else ""
                raise FileError(f"{self.path}:{line}: {column.name!r} is {field!r}, which is not {expected}{others}")
        return np.array(numbers)


def _decode(head: bytes) -> str:
    try:
        return head.decode("utf-8-sig")
    except UnicodeDecodeError:
        return head.decode("latin-1")
