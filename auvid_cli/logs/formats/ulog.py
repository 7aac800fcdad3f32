"""Logs of PX4 (ULog): a table for each topic, and for each further instance of it."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.files import damage_as_file_error
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, ColumnValues, Log, LogColumn, look_up

try:
    from pyulog import ULog
except ModuleNotFoundError as error:
    raise FileError("reading PX4 logs needs the package pyulog: pip install 'auvid[px4]'") from error

_TIMESTAMP = "timestamp"


class ULogLog(Log):
    """What PX4 writes on its card; `@log_time` is counted from when it was switched on."""

    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the fields of each topic, which state no units: PX4 logs SI."""
        return {
            table: (LogColumn(LOG_TIME), *(LogColumn(name) for name in fields if name != _TIMESTAMP))
            for table, fields in self._topics.items()
        }

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read fields by name."""
        look_up(self, table, columns)
        fields = self._topics[table]
        return {name: fields[_TIMESTAMP] * 1e-6 if name == LOG_TIME else fields[name] for name in columns}

    @cached_property
    def _topics(self) -> dict[str, dict[str, NDArray[np.float64]]]:
        refusing = damage_as_file_error(lambda reason: f"{self.path}: is a damaged ULog: {reason}")
        with self.path.open("rb") as file, refusing:
            topics = ULog(file).data_list
        return {
            topic.name if topic.multi_id == 0 else f"{topic.name}[{topic.multi_id}]": {
                name: np.asarray(values, np.float64) for name, values in topic.data.items()
            }
            for topic in topics
            if _TIMESTAMP in topic.data
        }
