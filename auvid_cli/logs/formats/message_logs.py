"""Logs with a table for each kind of message: PX4 (ULog), MOOS (.alog), DataFlash as text, and JSON objects."""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from functools import cached_property
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, ColumnValues, FileLog, LoadedLog, LogColumn, Tables
from auvid_cli.logs.formats.text_layout import MISSING_VALUES, is_number

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
_CUT = "the last row is cut short: left out"
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


class ULogLog(LoadedLog):
    """Log of PX4: a table for each instance of a topic, SI; `LOG_TIME` is the time since power-on, s."""

    def __init__(self, path: Path) -> None:
        from pyulog import ULog

        super().__init__(path)
        self._reader = ULog

    def _load(self) -> dict[str, dict[str, Array]]:
        refusing = damage_as_file_error(lambda reason: f"{self.path}: is a damaged ULog: {reason}")
        # pyulog prints its warnings on the output; drop them.
        with self.path.open("rb") as file, refusing, redirect_stdout(None):
            topics = self._reader(_BoundedFile(file)).data_list
        tables: dict[str, dict[str, Array]] = {}
        for topic in topics:
            fields = {name: np.asarray(values, np.float64) for name, values in topic.data.items()}
            if _TIMESTAMP in fields:
                name = topic.name if topic.multi_id == 0 else f"{topic.name}[{topic.multi_id}]"
                tables[name] = {LOG_TIME: fields.pop(_TIMESTAMP) * 1e-6, **fields}
        return tables


class AlogLog(LoadedLog):
    """Log of pLogger (MOOS): a table for each variable with the time since the start of the log and the value."""

    def _load(self) -> dict[str, dict[str, ColumnValues]]:
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
        return {
            name: {LOG_TIME: np.array(times), _VALUE: _values_of(texts)} for name, (times, texts) in variables.items()
        }


def _values_of(texts: Sequence[str]) -> ColumnValues:
    return _numbers_of(texts) if all(map(is_number, texts)) else np.array(texts)


def _numbers_of(texts: Sequence[str]) -> Array:
    return np.array([np.nan if text in MISSING_VALUES else float(text) for text in texts], np.float64)


class DataFlashTextLog(FileLog):
    """A log with lines such as ``ATT, 5000000, 0.00, -0.70``, whose columns the lines FMT name.

    A message with several instances, such as IMU, has a table with all of them and one for each: IMU[0]. The numbers
    are scaled already. A last line that is cut short is left out.
    """

    def remarks(self) -> tuple[str, ...]:
        """Return whether the last row is left out."""
        return (_CUT,) if self._messages[2] else ()

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
            is_time = column.name == LOG_TIME
            name = next(name for name in _TICKS_PER_SECOND if name in names) if is_time else column.name
            texts = [row[names.index(name)] for row in of_table]
            if column.is_text:
                values[name] = np.array(texts, np.str_)
            elif wrong := [text for text in texts if not is_number(text)]:
                raise FileError(f"{self.path}: {name} of {kind} is {wrong[0]!r}; expected a number")
            else:
                values[column.name] = _numbers_of(texts) / (_TICKS_PER_SECOND[name] if is_time else 1.0)
        return values

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


class JsonLinesLog(LoadedLog):
    """A log with a table for each `type` of object; nested numbers have paths such as ``transducers[0].distance``.

    Flags are 1 and 0. Objects without numbers, such as answers to commands, are left out, as is a last line that is cut
    short.
    """

    def _load(self) -> dict[str, dict[str, Array]]:
        rows: dict[str, list[dict[str, float]]] = {}
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
                    self._remarks.append(_CUT)
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
        return tables


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
