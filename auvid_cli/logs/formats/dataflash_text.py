"""DataFlash logs of ArduPilot that a ground station turned into text: a table for each kind of message."""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, ColumnValues, FileLog, LogColumn, Tables
from auvid_cli.logs.formats.text_layout import is_number

_TICKS_PER_SECOND = {"TimeUS": 1e6, "TimeMS": 1e3}
_TEXT_FORMATS = "nNZ"
_INSTANCE = "I"  # column with the number of the sensor
_Rows = list[list[str]]


class DataFlashTextLog(FileLog):
    """A log with lines such as ``ATT, 5000000, 0.00, -0.70``, whose columns the lines FMT name.

    A message with several instances, such as IMU, has a table with all of them and one for each: IMU[0]. The numbers
    are scaled already. A last line that is cut short is left out.
    """

    def remarks(self) -> tuple[str, ...]:
        """Return whether the last row is left out."""
        return ("the last row is cut short: left out",) if self._messages[2] else ()

    def _find_tables(self) -> Tables:
        formats, rows, _ = self._messages
        units = self._units(rows)
        tables: Tables = {}
        for kind, columns in formats.items():
            if kind not in rows or _TICKS_PER_SECOND.keys().isdisjoint(name for name, _ in columns):
                continue
            of_kind = [*units.get(kind, []), *[""] * len(columns)]
            named = zip(columns, of_kind[: len(columns)], strict=True)
            tables[kind] = (
                LogColumn(LOG_TIME, "s"),
                *(LogColumn(name, unit, is_text=code in _TEXT_FORMATS) for (name, code), unit in named),
            )
            position = [name for name, _ in columns].index(_INSTANCE) if (_INSTANCE, "B") in columns else None
            if position is not None:
                for instance in sorted({row[position] for row in rows[kind]}):
                    tables[f"{kind}[{instance}]"] = tables[kind]
        if not tables:
            raise FileError(f"{self.path}: no message with a time; expected lines such as 'ATT, 5000000, ...'")
        return tables

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        kind, _, instance = table.removesuffix("]").partition("[")
        formats, rows, _ = self._messages
        names = [name for name, _ in formats[kind]]
        of_table = rows[kind]
        if instance:
            of_table = [row for row in of_table if row[names.index(_INSTANCE)] == instance]
        values: dict[str, ColumnValues] = {}
        for column in columns:
            if column.name == LOG_TIME:
                time = next(name for name in _TICKS_PER_SECOND if name in names)
                values[LOG_TIME] = self._numbers(kind, time, of_table, names) / _TICKS_PER_SECOND[time]
            elif column.is_text:
                values[column.name] = np.array([row[names.index(column.name)] for row in of_table], np.str_)
            else:
                values[column.name] = self._numbers(kind, column.name, of_table, names)
        return values

    def _numbers(self, kind: str, name: str, rows: _Rows, names: Sequence[str]) -> np.ndarray:
        texts = [row[names.index(name)] for row in rows]
        wrong = next((text for text in texts if not is_number(text)), None)
        if wrong is not None:
            raise FileError(f"{self.path}: {name} of {kind} is {wrong!r}; expected a number")
        return np.array([float(text or "nan") for text in texts])

    def _units(self, rows: dict[str, _Rows]) -> dict[str, list[str]]:
        """Return the units of the columns of each kind of message by the lines UNIT and FMTU."""
        labels = {row[1]: row[2] for row in rows.get("UNIT", []) if len(row) > 2}
        # Lengths and angles have names such as "deg" or "m/s/s"; others have no name.
        labels = {mark: "" if label == "UNKNOWN" else label.replace("/s/s", "/s^2") for mark, label in labels.items()}
        of_number = {row[0]: row[2] for row in rows.get("FMT", []) if len(row) > 2}
        return {
            of_number[row[1]]: [labels.get(mark, "") for mark in row[2]]
            for row in rows.get("FMTU", [])
            if len(row) > 2 and row[1] in of_number
        }

    @cached_property
    def _messages(self) -> tuple[dict[str, list[tuple[str, str]]], dict[str, _Rows], bool]:
        """Return name and format code of the columns of each kind, the fields of its rows, and whether one is cut."""
        formats: dict[str, list[tuple[str, str]]] = {
            "FMT": [(name, "Z") for name in ("Type", "Length", "Name", "", "")]
        }
        rows: dict[str, _Rows] = {}
        is_cut = False
        for number, line, is_last in self._lines():
            kind, _, rest = line.partition(",")
            if kind not in formats:
                continue
            # The last column may be a text with commas.
            fields = [field.strip() for field in rest.split(",", len(formats[kind]) - 1)]
            if len(fields) < len(formats[kind]):
                if is_last:
                    is_cut = True
                    continue
                raise FileError(
                    f"{self.path}:{number}: {kind} with {len(fields)} fields; expected {len(formats[kind])}"
                )
            if kind == "FMT":
                names = [name.strip() for name in fields[4].split(",") if name.strip()]
                codes = fields[3].ljust(len(names), "f")
                # Its own line has other names in some logs.
                formats.setdefault(fields[2], list(zip(names, codes, strict=False)))
            rows.setdefault(kind, []).append(fields)
        return formats, rows, is_cut

    def _lines(self) -> Iterator[tuple[int, str, bool]]:
        """Yield number and text of each line, and whether it is the last one, without a line feed."""
        with self.path.open(encoding="utf-8", errors="replace", newline="\n") as file:
            for number, line in enumerate(file, 1):
                if line.strip():
                    yield number, line.rstrip("\r\n"), not line.endswith("\n")
