"""Logs that continue each other, such as the files that a recorder begins anew every hour."""

from collections.abc import Sequence
from functools import cached_property
from typing import cast

import numpy as np

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import FILE, ColumnValues, Log, LogColumn
from auvid_cli.logs.formats.lookup import look_up


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
