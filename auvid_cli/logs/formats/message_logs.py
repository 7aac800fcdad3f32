"""Logs with a table for each kind of message: PX4 (ULog), MOOS (.alog), DataFlash as text, and JSON objects."""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from functools import cached_property
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, ColumnValues, FileLog, LogColumn, Tables
from auvid_cli.logs.formats.text_layout import is_number

T = TypeVar("T")
_TIMESTAMP = "timestamp"  # us, of PX4
_VALUE = "value"
# pyulog reads an undamaged log once, and tries every byte of a damaged part as the start of a message.
_MAX_READ = 4.0  # sizes of the file
_MAX_SEEKS = 200_000
_TICKS_PER_SECOND = {"TimeUS": 1e6, "TimeMS": 1e3}
_TEXT_FORMATS = "nNZ"
_INSTANCE = "I"  # column with the number of the sensor
_Rows = list[list[str]]
_KIND = "type"  # field with the kind of a message
_MAX_COLUMNS = 1000
_MAX_ELEMENTS = 100  # elements of a list that become columns


class _BoundedFile:
    """File that ends a reader after `_MAX_READ` times its size, or after `_MAX_SEEKS` jumps."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._rest = _MAX_READ * os.fstat(file.fileno()).st_size
        self._seeks = _MAX_SEEKS
        self.tell, self.close = file.tell, file.close

    def read(self, size: int = -1) -> bytes:
        content = self._file.read(size)
        self._rest -= len(content)
        return self._unless_endless(content)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._seeks -= 1
        return self._unless_endless(self._file.seek(offset, whence))

    def _unless_endless(self, result: T) -> T:
        if self._rest < 0 or self._seeks < 0:
            raise EOFError("most of the file is not messages")
        return result


class ULogLog(FileLog):
    """Log of PX4: a table for each instance of a topic, SI; `LOG_TIME` is the time since power-on, s."""

    def __init__(self, path: Path) -> None:
        from pyulog import ULog

        super().__init__(path)
        self._reader = ULog

    def _find_tables(self) -> Tables:
        return {
            table: (LogColumn(LOG_TIME), *(LogColumn(name) for name in fields if name != _TIMESTAMP))
            for table, fields in self._topics.items()
        }

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        fields = self._topics[table]
        return {name: fields[_TIMESTAMP] * 1e-6 if name == LOG_TIME else fields[name] for name, *_ in columns}

    @cached_property
    def _topics(self) -> dict[str, dict[str, NDArray[np.float64]]]:
        refusing = damage_as_file_error(lambda reason: f"{self.path}: is a damaged ULog: {reason}")
        # pyulog prints its warnings on the output; drop them.
        with self.path.open("rb") as file, refusing, redirect_stdout(None):
            topics = self._reader(_BoundedFile(file)).data_list
        return {
            topic.name if topic.multi_id == 0 else f"{topic.name}[{topic.multi_id}]": {
                name: np.asarray(values, np.float64) for name, values in topic.data.items()
            }
            for topic in topics
            if _TIMESTAMP in topic.data
        }


class AlogLog(FileLog):
    """Log of pLogger (MOOS): a table for each variable with the time since the start of the log and the value."""

    def _find_tables(self) -> Tables:
        return {
            name: (LogColumn(LOG_TIME), LogColumn(_VALUE, is_text=not self._is_numeric(name)))
            for name in self._variables
        }

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        times, values = self._variables[table]
        arrays: dict[str, ColumnValues] = {LOG_TIME: np.array(times)}
        arrays[_VALUE] = np.array(values, np.float64) if self._is_numeric(table) else np.array(values, np.str_)
        return {name: arrays[name] for name, *_ in columns}

    def _is_numeric(self, name: str) -> bool:
        return all(map(is_number, self._variables[name][1]))

    @cached_property
    def _variables(self) -> dict[str, tuple[list[float], list[str]]]:
        variables: dict[str, tuple[list[float], list[str]]] = {}
        with self.path.open(encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, 1):
                if line.startswith("%") or not line.strip():
                    continue
                time, *rest = line.split(maxsplit=3)
                if len(rest) < 2 or not is_number(time):
                    raise FileError(f"{self.path}:{number}: invalid row; expected time, variable, source and value")
                times, values = variables.setdefault(rest[0], ([], []))
                times.append(float(time))
                values.append(rest[2].strip() if len(rest) > 2 else "")
        return variables


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
