"""Logs of JSON objects, one a line, such as those of the DVL A50 and A125 (Water Linked, ``dvl-protocol.md``)."""

import json
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import ColumnValues, FileLog, LogColumn, Tables

_KIND = "type"  # field with the kind of a message
_MAX_COLUMNS = 1000
_MAX_ELEMENTS = 100  # elements of a list that become columns


class JsonLinesLog(FileLog):
    """A log with a table for each `type` of object; nested numbers have paths such as ``transducers[0].distance``.

    Flags are 1 and 0. Objects without numbers, such as answers to commands, are left out, as is a last line that is cut
    short.
    """

    def remarks(self) -> tuple[str, ...]:
        """Return whether the last row is left out."""
        return ("the last row is cut short: left out",) if self._messages[1] else ()

    def _find_tables(self) -> Tables:
        return {table: tuple(map(LogColumn, columns)) for table, columns in self._messages[0].items()}

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        return {column.name: self._messages[0][table][column.name] for column in columns}

    @cached_property
    def _messages(self) -> tuple[dict[str, dict[str, Array]], bool]:
        rows: dict[str, list[dict[str, float]]] = {}
        is_cut = False
        with self.path.open(encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, 1):
                if not line.strip():
                    continue
                try:
                    message = json.loads(line)
                    numbers = dict(_numbers("", message))
                except (ValueError, RecursionError, OverflowError) as error:
                    if line.endswith("\n"):
                        raise FileError(f"{self.path}:{number}: no JSON object in this line: {error}") from error
                    is_cut = True
                    continue
                if not isinstance(message, dict):
                    raise FileError(f"{self.path}:{number}: a JSON {type(message).__name__}; expected an object")
                if numbers:
                    rows.setdefault(str(message.get(_KIND, "")), []).append(numbers)
        if not rows:
            raise FileError(f"{self.path}: no JSON objects with numbers")
        tables: dict[str, dict[str, Array]] = {}
        for table, of_table in rows.items():
            names = dict.fromkeys(name for row in of_table for name in row)
            if len(names) > _MAX_COLUMNS:
                raise FileError(f"{self.path}: {table or 'objects'} with {len(names)} numbers; expected at most 1000")
            tables[table] = {name: np.array([row.get(name, np.nan) for row in of_table]) for name in names}
        return tables, is_cut


def _numbers(path: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield path and value of each number and flag in an object."""
    match value:
        case bool() | int() | float():
            yield path, float(value)
        case dict():
            for key, item in value.items():
                yield from _numbers(f"{path}.{key}" if path else str(key), item)
        case list() if len(value) <= _MAX_ELEMENTS:
            for k, item in enumerate(value):
                yield from _numbers(f"{path}[{k}]", item)
