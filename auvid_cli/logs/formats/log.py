"""What every reader of a log gives: topics with columns and units, joined or trimmed where several files overlap."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from auvid_cli.errors import FileError

# s since the epoch, or since the log's own zero: when a row was recorded, and when its sender says it was measured.
LOG_TIME, HEADER_STAMP = "@log_time", "@header_stamp"
# Of a log that consists of several files: which of them a row is from, counted from 1.
FILE = "@file"
ColumnValues = NDArray[np.float64] | NDArray[np.str_]
Array = NDArray[np.float64]


class LogColumn(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    name : str
        Without its unit, if the log writes that into it; of a message's field the dotted path, ``pose.position.x``.
    unit : str
        As the log states it; empty if it does not.
    is_text : bool
        Whether its values are text, such as ``12:03.5``.
    """

    name: str
    unit: str = ""
    is_text: bool = False


class Log(ABC):
    """An opened log, of which only what is asked for is read.

    Attributes
    ----------
    path : pathlib.Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @abstractmethod
    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the columns of each table: a topic, a kind of message; where all is one table its name is empty.

        Bags and message logs have the columns `LOG_TIME` and, where messages have a header, `HEADER_STAMP`.
        """

    @abstractmethod
    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read columns of a table by name, all of one length, in the order of the log; NaN where a number is missing.

        Raises
        ------
        FileError
            If there is no such table or column, or if the file is damaged; the message says where.
        """


def look_up(log: Log, table: str, names: Sequence[str]) -> tuple[LogColumn, ...]:
    """Find columns of a log's table by name.

    Raises
    ------
    FileError
        If there is no such table, or no such column in it.
    """
    tables = log.tables()
    if table not in tables:
        raise FileError(missing(log, "table", table, tables))
    columns = {column.name: column for column in tables[table]}
    for name in names:
        if name not in columns:
            raise FileError(missing(log, f"column in {table}" if table else "column", name, columns))
    return tuple(columns[name] for name in names)


def missing(log: Log, what: str, name: str, known: Collection[str]) -> str:
    """Say that a name is not there, and which is near."""
    near = get_close_matches(name, known, n=3, cutoff=0.5)
    some = near or list(known)[:5]
    of = "" if len(some) == len(known) else f" ({'nearest' if near else 'first'} of {len(known)})"
    return f"{log.path}: there is no {what} named {name!r}; there is {', '.join(map(repr, some)) or 'none at all'}{of}"


class JoinedLog(Log):
    """Several logs as one; the rows of a table follow each other in the order of the logs.

    Parameters
    ----------
    parts : sequence of Log
        A table need not be in all of them; of its columns those count that are wherever it is.

    Raises
    ------
    FileError
        If a column has another unit, or is text, in only some of them.
    """

    def __init__(self, parts: Sequence[Log]) -> None:
        super().__init__(parts[0].path)
        self._parts = tuple(parts)

    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the columns of each table, and `FILE`."""
        return self._tables

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read columns of a table by name."""
        look_up(self, table, columns)
        # Without any other column a part would not say how many rows it has.
        stored = [name for name in columns if name != FILE] or [self._tables[table][0].name]
        parts = enumerate(zip(self._parts, self._contents, strict=True), 1)
        having = {k: part.read(table, stored) for k, (part, content) in parts if table in content}
        joined = {c: cast(ColumnValues, np.concatenate([values[c] for values in having.values()])) for c in stored}
        joined[FILE] = np.repeat(
            np.array([*having], np.float64), [values[stored[0]].size for values in having.values()]
        )
        return {name: joined[name] for name in columns}

    @cached_property
    def _contents(self) -> list[dict[str, tuple[LogColumn, ...]]]:
        return [part.tables() for part in self._parts]

    @cached_property
    def _tables(self) -> dict[str, tuple[LogColumn, ...]]:
        common: dict[str, tuple[LogColumn, ...]] = {}
        for part, content in zip(self._parts, self._contents, strict=True):
            for table, columns in content.items():
                others = {column.name: column for column in columns}
                common[table] = tuple(c for c in common.get(table, columns) if c.name in others)
                for column in common[table]:
                    if others[column.name] != column:
                        raise FileError(
                            f"{part.path}: column {column.name!r} is in {others[column.name].unit or 'no unit'}, in "
                            f"{self.path} before it in {column.unit or 'no unit'}: they do not continue each other"
                        )
        return {table: (*columns, LogColumn(FILE)) for table, columns in common.items()}


class Overlap(NamedTuple):
    """Span in which a file and those before it both have rows.

    Attributes
    ----------
    file : int
        Place of the later file among all, from 1.
    begin, end : float
        s.
    own : bool
        Whether each has measurements of its own there; else one repeats the other.
    """

    file: int
    begin: float
    end: float
    own: bool


def find_overlaps(time: Array, files: Array, values: Array) -> list[Overlap]:
    """Find the files that begin before those before them end.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, NaN where there is none.
    files : ndarray, shape (n,)
        File of each row, counted from 1, never falling.
    values : ndarray, shape (n, c)
    """
    known = np.isfinite(time)
    time, files, values = time[known], files[known], values[known]
    starts = np.flatnonzero(np.diff(files, prepend=files[:1]))
    overlaps = []
    for start, stop in zip(starts, (*starts[1:], time.size), strict=True):
        begin = max(time[:start].min(), time[start:stop].min())
        end = min(time[:start].max(), time[start:stop].max())
        inside = (time >= begin) & (time <= end)
        before, after = np.flatnonzero(inside[:start]), start + np.flatnonzero(inside[start:stop])
        # A row at the end of one file and at the beginning of the next is no span.
        if begin < end and before.size and after.size:
            common, first, second = np.intersect1d(time[before], time[after], return_indices=True)
            repeats = np.array_equal(values[before[first]], values[after[second]], equal_nan=True)
            is_own = not repeats or common.size < min(np.unique(time[before]).size, np.unique(time[after]).size)
            overlaps.append(Overlap(int(files[start]), float(begin), float(end), is_own))
    return overlaps
