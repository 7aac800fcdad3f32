"""What a log looks like to whoever converts it: named tables of named columns."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# s since the epoch, or since the log's own zero: when a row was recorded, and when its sender says it was measured.
LOG_TIME, HEADER_STAMP = "@log_time", "@header_stamp"
# Of a log that consists of several files: which of them a row is from, counted from 1.
FILE = "@file"

ColumnValues = NDArray[np.float64] | NDArray[np.str_]


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
