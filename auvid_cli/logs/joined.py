"""Logs that continue each other, such as the files that a recorder begins anew every hour."""

from collections.abc import Sequence
from typing import cast

import numpy as np

from auvid_cli.errors import FileError
from auvid_cli.logs.log import Column, ColumnValues, Log
from auvid_cli.logs.lookup import look_up


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

    def tables(self) -> dict[str, tuple[Column, ...]]:
        """Columns of each table."""
        found: dict[str, tuple[Column, ...]] = {}
        for part in self._parts:
            for table, columns in part.tables().items():
                others = {column.name: column for column in columns}
                found[table] = tuple(c for c in found.get(table, columns) if c.name in others)
                for column in found[table]:
                    if others[column.name] != column:
                        raise FileError(
                            f"{part.path}: column {column.name!r} is in {others[column.name].unit or 'no unit'}, in "
                            f"{self.path} before it in {column.unit or 'no unit'}: they do not continue each other"
                        )
        return found

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Columns of a table by name."""
        look_up(self, table, columns)
        having = [part.read(table, columns) for part in self._parts if table in part.tables()]
        return {c: cast(ColumnValues, np.concatenate([values[c] for values in having])) for c in columns}
