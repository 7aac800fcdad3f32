"""Columns that a map requests from logs, and errors that point into the map."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from auvid_cli.config.locate import at_value
from auvid_cli.config.log_columns import LogRows, LogSignal, PlacedSignal, RowChoice, TimeSource, unit_factor
from auvid_cli.config.log_map import LogMap
from auvid_cli.config.source_positions import KeyPath, Mistake, Tree, mistakes_text
from auvid_cli.config.units import expected
from auvid_cli.errors import ConfigError
from auvid_cli.logs.clock import Clock, to_seconds
from auvid_cli.logs.formats.log import FILE, HEADER_STAMP, LOG_TIME, ColumnValues, Log, LogColumn, missing


class MapMismatchError(Exception):
    """A setting of the map, at `path`, does not fit the log."""

    def __init__(self, path: KeyPath, message: str) -> None:
        super().__init__(message)
        self.path = path


class MapErrors:
    """Collected errors of a map with their positions in its source `tree`."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._mistakes: list[Mistake] = []
        self._count = 0

    def add(self, path: KeyPath, message: str) -> None:
        """Collect an error; one with several causes is reported once."""
        mistake = at_value(self._tree, path, message)
        if mistake not in self._mistakes:
            self._mistakes.append(mistake)
        self._count += 1

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Collect the MapMismatchError that ends the block, and continue after it."""
        try:
            yield
        except MapMismatchError as error:
            self.add(error.path, str(error))

    def stop_if_any(self) -> None:
        """Raise ConfigError with all errors so far."""
        if self._mistakes:
            raise ConfigError(mistakes_text(self._mistakes))

    def __len__(self) -> int:
        return self._count


class Place(NamedTuple):
    """A column of a log."""

    log: str
    table: str
    column: str


class ComponentSource(NamedTuple):
    """Column of a component, size of its unit in SI, and whether the log or the map states the unit."""

    place: Place
    factor: float
    has_unit: bool


class Times(NamedTuple):
    """Column with the times of rows."""

    place: Place
    factor: float  # s per unit of numeric times
    offset: float  # s, added to the times
    nanoseconds: Place | None  # column with nanoseconds next to whole seconds
    date_format: str | None  # format of dates as text
    run: int | None  # run to use if the clock starts again, from 1
    other: Place | None  # second clock of the messages
    file: Place | None  # number of the file of a row, in a log of several files


class Request(NamedTuple):
    """Columns of a sensor or an input in one table."""

    path: KeyPath  # path of the request in the map
    values: dict[str, ComponentSource]  # source of each component
    valid: Place | None  # column that flags valid rows
    time: Times
    chosen: tuple[Place, RowChoice] | None  # column with an id, and its values in the requested rows

    def places(self) -> Iterator[Place]:
        """Yield all columns of the request."""
        yield from (source.place for source in self.values.values())
        of_time = (self.time.place, self.time.nanoseconds, self.time.other, self.time.file)
        optional = (self.valid, *of_time, self.chosen and self.chosen[0])
        yield from (place for place in optional if place is not None)


def find_requests(settings: LogMap, tree: Tree, logs: Mapping[str, Log], errors: MapErrors) -> dict[KeyPath, Request]:
    """Return the requests of a map by their paths in it.

    Missing tables and columns, text instead of numbers and wrong units are collected in `errors`. A sensor has the
    path ``("sensors", name)``. Components in another table have their own request, at the path of the first component.
    """
    finder = _Finder(settings, tree, logs, errors)
    requests: dict[KeyPath, Request | None] = {}
    for name, sensor in settings.sensors.given().items():
        path: KeyPath = ("sensors", name)
        under = "columns" if getattr(sensor, "quaternion", None) is None else "quaternion"
        signals: dict[KeyPath, LogSignal] = {
            (*path, under, symbol): signal for symbol, signal in sensor.signals().items()
        }
        places = _by_place(signals)
        if sensor.valid is not None and None not in places:
            errors.add((*path, "valid"), "no component in the sensor's own table; expected one next to this column")
        for place, of_place in places.items():
            at, rows = (path, [sensor]) if place is None else (next(iter(of_place)), [place, sensor])
            valid = sensor.valid.column if sensor.valid is not None and place is None else None
            requests[at] = finder.request(at, rows, of_place, sensor.unit, valid)
    for key, signal in settings.inputs.channels().items():
        path = ("inputs", *key)
        requests[path] = finder.request(path, [signal, settings.inputs], {path: signal}, None, None)
    return {path: request for path, request in requests.items() if request is not None}


def _by_place(signals: Mapping[KeyPath, LogSignal]) -> dict[LogRows | None, dict[KeyPath, LogSignal]]:
    """Return the components of a sensor by their place; None is the sensor's own place."""
    places: dict[LogRows | None, dict[KeyPath, LogSignal]] = {}
    for path, signal in signals.items():
        place = None
        if isinstance(signal, PlacedSignal):
            stated = {key: getattr(signal, key) for key in LogRows.model_fields}
            place = LogRows(**stated) if any(value is not None for value in stated.values()) else None
        places.setdefault(place, {})[path] = signal
    return places


class _Finder:
    """Finds logs, tables and columns, and collects errors."""

    def __init__(self, settings: LogMap, tree: Tree, logs: Mapping[str, Log], errors: MapErrors) -> None:
        self._settings, self._tree, self._logs, self._errors = settings, tree, logs, errors
        self._tables = {name: log.tables() for name, log in logs.items()}

    def request(
        self,
        path: KeyPath,
        rows: Sequence[LogRows],
        signals: Mapping[KeyPath, LogSignal],
        unit: str | None,
        valid: str | None,
    ) -> Request | None:
        """Return the request of a sensor or input; the first of `rows` with a setting counts. None after an error."""
        before = len(self._errors)
        log = self._log(path, next((r.log for r in rows if r.log is not None), None))
        if log is None:
            return None
        table = self._table(path, log, next((r.table for r in rows if r.table is not None), None))
        if table is None:
            return None
        values = {}
        for place, signal in signals.items():
            column = self._column((*place, "column"), log, table, signal.column, numbers=True)
            if column is not None:
                has_unit = bool(signal.scale is not None or signal.unit or unit or column.unit)
                factor = self._factor(place, signal, unit, column)
                values[str(place[-1])] = ComponentSource(Place(log, table, column.name), factor, has_unit)
        flag = valid and self._column((*path, "valid", "column"), log, table, valid, numbers=False)
        choice = next((r.rows for r in rows if r.rows is not None), None)
        ids = choice and self._column((*path, "rows", "column"), log, table, choice.column, numbers=False)
        time = self._time(path, log, table, [r.time for r in rows])
        if len(self._errors) > before or time is None:
            return None
        chosen = (Place(log, table, ids.name), choice) if ids and choice else None
        return Request(path, values, Place(log, table, flag.name) if flag else None, time, chosen)

    def _log(self, path: KeyPath, name: str | None) -> str | None:
        if name is None and len(self._logs) == 1:
            return next(iter(self._logs))
        if name in self._logs:
            return name
        if name is None:
            self._errors.add(path, f"missing key 'log': one of {', '.join(self._logs)}")
        else:
            self._errors.add((*path, "log"), f"no log named {name!r} in `logs`; expected {', '.join(self._logs)}")
        return None

    def _table(self, path: KeyPath, log: str, name: str | None) -> str | None:
        tables = self._tables[log]
        if name is None and len(tables) == 1:
            return next(iter(tables))
        if name in tables:
            return name
        if name is None:
            some = ", ".join(list(tables)[:5]) + (", ..." if len(tables) > 5 else "")
            self._errors.add(path, f"missing key 'table': one of those in {self._logs[log].path}: {some}")
        else:
            self._errors.add((*path, "table"), missing(self._logs[log], "table", name, tables))
        return None

    def _column(self, path: KeyPath, log: str, table: str, name: str, numbers: bool) -> LogColumn | None:
        columns = self._tables[log][table]
        for column in columns:
            # The name with its unit, as in the log's header, is accepted too.
            if name in (column.name, f"{column.name} ({column.unit})", f"{column.name} [{column.unit}]"):
                if numbers and column.is_text:
                    self._errors.add(path, f"column {name!r} of {self._logs[log].path} has text; expected numbers")
                    return None
                return column
        what = f"column in {table}" if table else "column"
        self._errors.add(path, missing(self._logs[log], what, name, [column.name for column in columns]))
        return None

    def _factor(self, path: KeyPath, signal: LogSignal, unit: str | None, column: LogColumn) -> float:
        """Return the SI units per unit of the log's numbers."""
        if signal.scale is not None:
            return signal.scale
        if stated := signal.unit or unit:
            return unit_factor(stated, signal.si)
        return self._header_factor(path, column, signal.si)

    def _header_factor(self, path: KeyPath, column: LogColumn, si: str) -> float:
        try:
            return unit_factor(column.unit, si) if column.unit else 1.0
        except ValueError:
            reason = f"the log states the unit {column.unit!r} of {column.name!r}; expected {expected(si)}"
            self._errors.add(path, f"{reason}: state the right `unit`")
            return 1.0

    def _time(self, path: KeyPath, log: str, table: str, sources: list[TimeSource | None]) -> Times | None:
        """Return column, unit and offset of the times; None after an error."""
        nearest = next((source for source in sources if source is not None), None)
        source = nearest or self._settings.time
        names = [column.name for column in self._tables[log][table]]
        if source is None:
            default = next((name for name in (HEADER_STAMP, LOG_TIME) if name in names), None)
            if default is None:
                self._errors.add(path, "missing key 'time'; expected the column with the times of the rows")
                return None
            source = TimeSource(column=default)
        # An input may inherit the time from all inputs, or from the map.
        candidates: list[KeyPath] = [(*path[:length], "time") for length in range(len(path), 0, -1)]
        at = next((p for p in candidates if len(list(self._tree.descend(p))) == len(p) + 1), ("time",))
        of_times = self._table(at, log, table if source.table is None else source.table)
        if of_times is None:
            return None
        column = self._column((*at, "column"), log, of_times, source.column, numbers=False)
        if column is None:
            return None
        factor = unit_factor(source.unit, "s") if source.unit else 1.0
        if not source.unit and not column.is_text:
            factor = self._header_factor(at, column, "s")
        names = [column.name for column in self._tables[log][of_times]]
        other = {LOG_TIME: HEADER_STAMP, HEADER_STAMP: LOG_TIME}.get(column.name, "")
        more = (Place(log, of_times, name) if name in names else None for name in (other, FILE))
        fine = source.nanoseconds and self._column(
            (*at, "nanoseconds"), log, of_times, source.nanoseconds, numbers=True
        )
        nanoseconds = Place(log, of_times, fine.name) if fine else None
        place = Place(log, of_times, column.name)
        return Times(place, factor, source.offset, nanoseconds, source.format, source.run, *more)


class ColumnReader:
    """Reads the columns of `requests`, and releases each column after the last request that needs it."""

    def __init__(self, logs: Mapping[str, Log], requests: Iterable[Request]) -> None:
        self._logs = logs
        self._wanted = Counter(place for request in requests for place in request.places())
        self._held: dict[Place, ColumnValues] = {}
        self._clocks: dict[tuple[object, ...], Clock] = {}

    def take(self, place: Place) -> ColumnValues:
        """Return a column; call this once for each request that needs it."""
        if place not in self._held:
            together = [other for other in self._wanted if other[:2] == place[:2] and self._wanted[other] > 0]
            values = self._logs[place.log].read(place.table, [other.column for other in together])
            self._held |= {other: values[other.column] for other in together}
        self._wanted[place] -= 1
        return self._held[place] if self._wanted[place] else self._held.pop(place)

    def take_time(self, request: Request) -> Clock:
        """Return the times of a request; the array may be shared. ValueError if a text is not a time."""
        times = request.time
        key = times.place, times.factor, times.nanoseconds, times.date_format
        values = self.take(times.place)
        fine = self.take(times.nanoseconds) if times.nanoseconds is not None else None
        if key not in self._clocks:
            clock = to_seconds(values, times.factor, times.date_format)
            if fine is not None:
                clock = clock._replace(seconds=clock.seconds + 1e-9 * np.asarray(fine, np.float64))
            self._clocks[key] = clock
        clock = self._clocks[key]
        if not self._wanted[times.place]:
            del self._clocks[key]
        if not times.offset:
            return clock
        return Clock(np.add(clock.seconds, times.offset), clock.rollovers)
