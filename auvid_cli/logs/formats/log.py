"""Interface of a log: tables of columns with units, several files joined to one, and codes for missing measurements."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.errors import FileError

# Columns that readers add, times in s since 1970 or since the log's own zero.
LOG_TIME = "@log_time"  # time of recording
HEADER_STAMP = "@header_stamp"  # time of measurement by the sender
FILE = "@file"  # number of the file of a row, from 1, in a log of several files
ColumnValues = Array | NDArray[np.str_]
# Usual codes without their sign; 32.768 is the smallest 16-bit number in mm, written in m.
_CODES = (32.768, 999.0, 9999.0, 32768.0, 99999.0)
_MAX_OTHERS = 0.9  # largest other number divided by the code
_PRECISION = 1e-6  # of numbers stored in single precision
_MAX_ZEROS = 0.9  # share of rows of zeros


class LogColumn(NamedTuple):
    """A column of a table."""

    name: str  # name without unit, or dotted path of a message's field, such as ``pose.position.x``
    unit: str = ""  # unit that the log states; empty without one
    is_text: bool = False  # whether the values are text, such as ``12:03.5``


Tables = dict[str, tuple[LogColumn, ...]]


class Log(ABC):
    """An opened log, of which only requested columns are read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_cut = False  # whether only the beginning is read
        # Files such as ``dvl_msgs/msg/DVL.msg`` for the messages that a bag does not define.
        self.definitions: Sequence[Path] = ()
        # For a suggested map, by table: column with the times, and offset to a common clock, s, with the reason.
        self.clocks: dict[str, str] = {}
        self.clock_offsets: dict[str, tuple[float, str]] = {}
        self.senders: dict[str, tuple[str, str | float] | None] = {}  # column and value of the rows of one sender

    def remarks(self) -> tuple[str, ...]:
        """Return parts of the log that are left out, such as damaged ones, with their number."""
        return ()

    @abstractmethod
    def tables(self) -> Tables:
        """Return the columns of each table (topic or kind of message); a single table has an empty name.

        Message logs have the columns `LOG_TIME` and, if messages have a header, `HEADER_STAMP`.
        """

    @abstractmethod
    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Return columns of equal length in the order of the log; NaN if a number is missing.

        Raises
        ------
        FileError
            If a table or column is missing, or the file is damaged.
        """


def look_up(log: Log, table: str, names: Sequence[str]) -> tuple[LogColumn, ...]:
    """Return columns of a table by name; FileError if the table or one of them is missing."""
    tables = log.tables()
    if table not in tables:
        raise FileError(missing(log, "table", table, tables))
    columns = {column.name: column for column in tables[table]}
    for name in names:
        if name not in columns:
            raise FileError(missing(log, f"column in {table}" if table else "column", name, columns))
    return tuple(columns[name] for name in names)


def missing(log: Log, what: str, name: str, names: Collection[str]) -> str:
    """Return the message for a missing name, with similar names."""
    near = get_close_matches(name, names, n=3, cutoff=0.5)
    some = near or list(names)[:5]
    of = "" if len(some) == len(names) else f" ({'nearest' if near else 'first'} of {len(names)})"
    return f"{log.path}: no {what} named {name!r}; expected {', '.join(map(repr, some)) or 'none'}{of}"


class FileLog(Log):
    """A log that finds its tables once, and looks up the columns before it reads them."""

    def tables(self) -> Tables:
        """Return the columns of each table."""
        return self._tables

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Return columns by name, in their stated units."""
        return self._read(table, look_up(self, table, columns))

    @cached_property
    def _tables(self) -> Tables:
        return self._find_tables()

    @abstractmethod
    def _find_tables(self) -> Tables: ...

    @abstractmethod
    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]: ...


class LoadedLog(FileLog):
    """A log that is loaded as a whole before its tables are known."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._remarks: list[str] = []

    def remarks(self) -> tuple[str, ...]:
        """Return parts of the log that are left out."""
        return tuple(self._remarks) if self._contents else ()

    def _find_tables(self) -> Tables:
        return {
            table: tuple(LogColumn(name, is_text=values.dtype.kind == "U") for name, values in columns.items())
            for table, columns in self._contents.items()
        }

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        return {column.name: self._contents[table][column.name] for column in columns}

    @cached_property
    def _contents(self) -> Mapping[str, Mapping[str, ColumnValues]]:
        return self._load()

    @abstractmethod
    def _load(self) -> Mapping[str, Mapping[str, ColumnValues]]:
        """Return the columns of each table by name; add to `_remarks` what is left out."""


class JoinedLog(FileLog):
    """Several logs as one; the rows of a table follow each other in the order of the logs, with their number in `FILE`.

    Parameters
    ----------
    parts : sequence of Log
        A table may be missing in some of them. Its columns are those that all parts with this table have.

    Raises
    ------
    FileError
        If a column has different units, or is text in only some parts.
    """

    def __init__(self, parts: Sequence[Log]) -> None:
        super().__init__(parts[0].path)
        self._parts = tuple(parts)

    def remarks(self) -> tuple[str, ...]:
        """Return the remarks of all parts, each with its file."""
        return tuple(f"{part.path.name}: {remark}" for part in self._parts for remark in part.remarks())

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        # At least one stored column, for the number of rows.
        stored = [column.name for column in columns if column.name != FILE] or [self._tables[table][0].name]
        parts = enumerate(zip(self._parts, self._contents, strict=True), 1)
        by_part = {k: part.read(table, stored) for k, (part, content) in parts if table in content}
        joined = {c: cast(ColumnValues, np.concatenate([values[c] for values in by_part.values()])) for c in stored}
        joined[FILE] = np.repeat(
            np.array([*by_part], np.float64), [values[stored[0]].size for values in by_part.values()]
        )
        return {column.name: joined[column.name] for column in columns}

    @cached_property
    def _contents(self) -> list[Tables]:
        return [part.tables() for part in self._parts]

    def _find_tables(self) -> Tables:
        common: Tables = {}
        for part, content in zip(self._parts, self._contents, strict=True):
            for table, columns in content.items():
                others = {column.name: column for column in columns}
                common[table] = tuple(c for c in common.get(table, columns) if c.name in others)
                for column in common[table]:
                    if others[column.name] != column:
                        unit, usual = others[column.name].unit or "no unit", column.unit or "no unit"
                        problem = f"column {column.name!r} is in {unit}"
                        raise FileError(f"{part.path}: {problem}; expected {usual} as in {self.path}")
        return {table: (*columns, LogColumn(FILE)) for table, columns in common.items()}


class Overlap(NamedTuple):
    """Time span, s, in which a file (counted from 1) and earlier files both have rows.

    `own` tells whether both have measurements of their own; otherwise one repeats the other.
    """

    file: int
    begin: float
    end: float
    own: bool


def find_overlaps(time: Array, files: Array, values: Array) -> list[Overlap]:
    """Return the overlaps of each file with all files before it.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, NaN if missing.
    files : ndarray, shape (n,)
        File of each row, from 1, not decreasing.
    values : ndarray, shape (n, c)
    """
    timed = np.isfinite(time)
    time, files, values = time[timed], files[timed], values[timed]
    starts = np.flatnonzero(np.diff(files, prepend=files[:1]))
    overlaps = []
    for start, stop in zip(starts, (*starts[1:], time.size), strict=True):
        begin = max(time[:start].min(), time[start:stop].min())
        end = min(time[:start].max(), time[start:stop].max())
        inside = (time >= begin) & (time <= end)
        before, after = np.flatnonzero(inside[:start]), start + np.flatnonzero(inside[start:stop])
        # A common row at the border of two files does not count.
        if begin < end and before.size and after.size:
            common, first, second = np.intersect1d(time[before], time[after], return_indices=True)
            repeats = np.array_equal(values[before[first]], values[after[second]], equal_nan=True)
            is_own = not repeats or common.size < min(np.unique(time[before]).size, np.unique(time[after]).size)
            overlaps.append(Overlap(int(files[start]), float(begin), float(end), is_own))
    return overlaps


def is_code(numbers: Array, codes: Collection[float]) -> NDArray[np.bool_]:
    """Return whether numbers are one of the codes, to single precision."""
    found = np.zeros(numbers.shape, np.bool_)
    for code in codes:
        found |= np.isclose(numbers, code, rtol=_PRECISION, atol=_PRECISION)
    return found


def find_codes(numbers: Mapping[str, Array]) -> tuple[float, ...]:
    """Return the codes for missing measurements in the columns of a sensor: usual ones, far from all other numbers."""
    signed = [sign * code for code in _CODES for sign in (-1.0, 1.0)]
    codes = set[float]()
    for values in numbers.values():
        own = [code for code in signed if is_code(values, [code]).any()]
        others = np.abs(values[np.isfinite(values) & ~is_code(values, own)])
        codes |= {code for code in own if others.size and others.max() < _MAX_OTHERS * abs(code)}
    return tuple(sorted(codes))


def rows_of_zeros(numbers: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Return the rows in which all components are exactly zero, as of a DVL without bottom lock."""
    return np.all([values == 0.0 for values in numbers.values()], axis=0)


def has_rows_of_zeros(numbers: Mapping[str, Array]) -> bool:
    """Whether exact zeros in all of several components mark missing measurements: some rows, but not most."""
    zeros = rows_of_zeros(numbers)
    return len(numbers) > 1 and bool(zeros.any()) and float(zeros.mean()) < _MAX_ZEROS
