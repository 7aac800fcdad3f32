"""Columns of logs as they are asked for: a table is read once, and what nobody needs any more is let go."""

from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np

from auvid_cli.logs.clock import Clock, to_seconds
from auvid_cli.logs.formats.log import ColumnValues, Log
from auvid_cli.logs.requests import Place, Request


class ColumnReader:
    """Reads what requests need.

    Parameters
    ----------
    logs : mapping of str to Log
    requests : iterable of Request
        All that will be asked for, each once.
    """

    def __init__(self, logs: Mapping[str, Log], requests: Iterable[Request]) -> None:
        self._logs = logs
        self._wanted = Counter(place for request in requests for place in request.places())
        self._held: dict[Place, ColumnValues] = {}
        self._clocks: dict[tuple[Place, float], Clock] = {}

    def take(self, place: Place) -> ColumnValues:
        """Hand out a column, once for each request that needs it.

        Raises
        ------
        FileError
            If the log is damaged.
        """
        if place not in self._held:
            together = [other for other in self._wanted if other[:2] == place[:2] and self._wanted[other] > 0]
            values = self._logs[place.log].read(place.table, [other.column for other in together])
            self._held |= {other: values[other.column] for other in together}
        self._wanted[place] -= 1
        return self._held[place] if self._wanted[place] else self._held.pop(place)

    def take_time(self, request: Request) -> Clock:
        """Hand out the times of a request's rows, s; the array may be shared with others.

        Raises
        ------
        ValueError
            If a text is no time.
        """
        times = request.time
        key = times.place, times.factor
        values = self.take(times.place)
        if key not in self._clocks:
            self._clocks[key] = to_seconds(values, times.factor)
        clock = self._clocks[key]
        if not self._wanted[times.place]:
            del self._clocks[key]
        if not times.offset:
            return clock
        return Clock(np.add(clock.seconds, times.offset), clock.rollovers)
