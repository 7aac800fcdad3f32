"""Logs of MOOS (.alog): a table for each variable."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, ColumnValues, Log, LogColumn, look_up
from auvid_cli.logs.formats.text_layout import is_number

_VALUE = "value"


class AlogLog(Log):
    """What pLogger writes: a time, a variable, who posted it, and its value. A table is called by the variable."""

    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the variables, each with its time since the log began and its value."""
        return {
            name: (LogColumn(LOG_TIME), LogColumn(_VALUE, is_text=not self._are_numbers(name)))
            for name in self._variables
        }

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read times and values by name."""
        look_up(self, table, columns)
        times, values = self._variables[table]
        found: dict[str, ColumnValues] = {LOG_TIME: np.array(times)}
        found[_VALUE] = np.array(values, np.float64) if self._are_numbers(table) else np.array(values, np.str_)
        return {name: found[name] for name in columns}

    def _are_numbers(self, name: str) -> bool:
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
                    raise FileError(f"{self.path}:{number}: expected a time, a variable, who posted it, and its value")
                times, values = variables.setdefault(rest[0], ([], []))
                times.append(float(time))
                values.append(rest[2].strip() if len(rest) > 2 else "")
        return variables
