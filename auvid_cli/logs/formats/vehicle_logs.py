"""Logs of PX4 (ULog) and MOOS (.alog)."""

import os
from collections.abc import Sequence
from contextlib import redirect_stdout
from functools import cached_property
from pathlib import Path
from typing import IO, TypeVar

import numpy as np
from numpy.typing import NDArray

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
