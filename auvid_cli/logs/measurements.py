"""Measurements of a request in SI, and the summary of an import."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.log_columns import LogSignal, RowChoice
from auvid_cli.config.source_positions import KeyPath
from auvid_cli.logs.clock import DAY, ClockDrift, Order, find_clock_drift, find_restarts, order_rows
from auvid_cli.logs.formats.log import ColumnValues, Overlap, find_overlaps, is_code, rows_of_zeros
from auvid_cli.logs.requests import ColumnReader, MapMismatchError, Request
from auvid_cli.text import one_line
from auvid_cli.vehicle.rigid_body import MAX_SPEED, MAX_TURN_RATE

# An underwater vehicle does not exceed these; larger numbers have another unit.
_MAX_PLAUSIBLE = {"rad": 2.0 * np.pi, "rad/s": MAX_TURN_RATE, "m/s": MAX_SPEED, "m/s^2": 500.0}
_MAX_INTERLEAVING = 1.0  # s, largest overlap of two files due to late messages
_SAME_TIME = 1e-6  # s, largest rounding error of a time that several tables share
_MIN_INTERVAL = 1e-4  # s, smallest median interval; a higher rate has another unit of time
_MIN_SPAN = 1.0  # s, shortest record
_MAX_AMBIGUOUS = 0.1  # largest share of rows with the time of another row, but other values


class MeasuredRows(NamedTuple):
    """Rows of a log for one sensor or input."""

    time: Array  # shape (n,); time of the log, s, strictly increasing
    values: dict[str, Array]  # SI by component, shape (n,); NaN if missing
    order: Order
    rollovers: int
    invalid: int  # rows that the log marks as invalid, or with a value beyond the limits of the map
    repeats: int  # omitted rows that repeat the one before
    clock_drift: ClockDrift | None  # drift of the clock if the other clock of the messages is better
    overlaps: list[Overlap]


def read_request(
    request: Request,
    signals: Mapping[str, LogSignal],
    columns: ColumnReader,
    validity: RowChoice | None = None,
    codes: Sequence[float] = (),
    drop_zeros: bool = False,
) -> MeasuredRows:
    """Read the rows of a request.

    Parameters
    ----------
    request : Request
    signals : mapping of str to LogSignal
        By component.
    columns : ColumnReader
    validity : RowChoice, optional
        Flag and its values in valid rows.
    codes : sequence of float
        Numbers of the log that mean a missing measurement.
    drop_zeros : bool
        Whether rows with zeros in all components are missing measurements.

    Raises
    ------
    MapMismatchError
        If times are invalid or constant, if tables have different lengths, or if files of one log interleave.
    FileError
        If the log is damaged.
    """
    raw = {c: np.asarray(columns.take(place), np.float64) for c, (place, *_) in request.values.items()}
    flags = columns.take(request.valid) if request.valid is not None else None
    length = next(iter(raw.values())).size
    zeros = rows_of_zeros(raw) if drop_zeros else np.zeros(length, np.bool_)
    marks = {component: zeros | is_code(own, codes) for component, own in raw.items()}
    try:
        seconds, rollovers, _ = columns.take_time(request)
    except ValueError as error:
        raise MapMismatchError((*request.path, "time"), one_line(str(error))) from None
    if seconds.size != length:
        raise MapMismatchError(
            (*request.path, "time"),
            f"{request.time.place.table} has {seconds.size} rows; expected times for {length} rows",
        )
    n_others = 0
    if request.chosen is not None:
        place, choice = request.chosen
        others = ~is_chosen(ids := columns.take(place), choice)
        if others.all():
            some = ", ".join(map(str, np.unique(ids)[:8].tolist()))
            raise MapMismatchError(
                (*request.path, "rows"), f"no row with such a {place.column!r}; expected one of {some}"
            )
        n_others = int(np.count_nonzero(others & np.isfinite(seconds)))
        seconds = np.where(others, np.nan, seconds)
    files = np.asarray(columns.take(request.time.file), np.float64) if request.time.file is not None else None
    is_other_run = _other_runs(request, seconds, files)
    seconds = np.where(is_other_run, np.nan, seconds)
    n_others += int(np.count_nonzero(is_other_run))
    order = order_rows(seconds)
    order = order._replace(without_time=order.without_time - n_others)
    time = seconds[order.rows]
    if time.size < 2:
        raise _no_times(request, seconds.size, time.size)
    _check_intervals(request, time)
    clock_drift, other = None, request.time.other
    if other is not None:
        names = request.time.place.column, other.column
        clock_drift = find_clock_drift(seconds, np.asarray(columns.take(other), np.float64), names)
    overlaps = _overlaps(request, seconds, raw, files)
    _check_stamps(request, seconds, order, raw)
    values, invalid = {}, np.zeros(time.size, dtype=bool)
    for component, (_, factor, _) in request.values.items():
        signal = signals[component]
        numbers = (raw.pop(component)[order.rows] - signal.centre) * (signal.sign * factor) + signal.offset
        # Infinite numbers mark missing measurements.
        outside = np.isinf(numbers) | marks[component][order.rows]
        if signal.limits is not None:
            outside |= (numbers < signal.limits[0]) | (numbers > signal.limits[1])
        invalid |= outside
        numbers[outside] = np.nan
        values[component] = numbers
    if flags is not None and validity is not None:
        wrong = ~is_chosen(flags[order.rows], validity)
        invalid |= wrong
        for numbers in values.values():
            numbers[wrong] = np.nan
    return MeasuredRows(time, values, order, rollovers, int(invalid.sum()), 0, clock_drift, overlaps)


def _other_runs(request: Request, seconds: Array, files: Array | None) -> NDArray[np.bool_]:
    """Return the rows of other runs of the clock; MapMismatchError if the map must choose a run."""
    starts = find_restarts(seconds)
    if files is not None:
        # Where a file ends, an earlier time means that files overlap.
        starts = starts[files[starts] == files[starts - 1]]
    path, run = (*request.path, "time"), request.time.run
    if run is None and starts.size:
        last, first = float(np.nanmax(seconds[: starts[0]])), float(seconds[starts[0]])
        raise MapMismatchError(
            path,
            f"the clock of {request.time.place.column!r} starts again in row {starts[0] + 1}, from "
            f"{last:.3f} back to {first:.3f} s: choose a `run`, 1 to {starts.size + 1}, one dataset for each",
        )
    if run is None:
        return np.zeros(seconds.size, np.bool_)
    if run > starts.size + 1:
        raise MapMismatchError((*path, "run"), f"no run {run}; the clock has {starts.size + 1}")
    edges = [0, *starts.tolist(), seconds.size]
    is_other = np.ones(seconds.size, np.bool_)
    is_other[edges[run - 1] : edges[run]] = False
    return is_other


def _check_intervals(request: Request, time: Array) -> None:
    interval, span = float(np.median(np.diff(time))), float(time[-1] - time[0])
    if interval < _MIN_INTERVAL or span < _MIN_SPAN:
        problem = f"rows every {interval:.3g} s" if interval < _MIN_INTERVAL else f"rows of only {span:.3g} s"
        hint = "check its `unit`; MATLAB and Excel count days"
        raise MapMismatchError((*request.path, "time"), f"{problem} by {request.time.place.column!r}: {hint}")


def _check_stamps(request: Request, seconds: Array, order: Order, raw: Mapping[str, Array]) -> None:
    """Raise MapMismatchError if many rows have the time of another row, but other values."""
    if order.duplicates <= _MAX_AMBIGUOUS * seconds.size:
        return
    rows = np.flatnonzero(np.isfinite(seconds))
    rows = rows[np.argsort(seconds[rows], kind="stable")]
    values = np.column_stack([own[rows] for own in raw.values()])
    same_time = np.diff(seconds[rows]) == 0.0
    differs = ((values[1:] != values[:-1]) & ~(np.isnan(values[1:]) & np.isnan(values[:-1]))).any(axis=1)
    if (ambiguous := int(np.count_nonzero(same_time & differs))) > _MAX_AMBIGUOUS * rows.size:
        raise MapMismatchError(
            (*request.path, "time"),
            f"{ambiguous} of {rows.size} rows share a time stamp with another row but differ: name a time with "
            "fractions of a second, its `nanoseconds`, or the `rows` of one sender",
        )


def _no_times(request: Request, rows: int, times: int) -> MapMismatchError:
    log, table, column = request.time.place
    if rows < 2:
        return MapMismatchError(("logs", log), f"{table or 'the log'} has {'only one row' if rows else 'no rows'}")
    problem = "never changes" if times else "has no valid times"
    return MapMismatchError((*request.path, "time"), f"{column!r} {problem}: name another time")


def _overlaps(request: Request, seconds: Array, raw: Mapping[str, Array], files: Array | None) -> list[Overlap]:
    """Return overlaps of the files of a log; MapMismatchError if they interleave for too long."""
    if files is None:
        return []
    overlaps = find_overlaps(seconds, files, np.column_stack([*raw.values()]))
    for file, begin, end, own in overlaps:
        if own and end - begin > _MAX_INTERLEAVING:
            span = f"{begin:.3f} to {end:.3f} s"
            reason = f"file {file} of the log and earlier files both have measurements from {span}"
            raise MapMismatchError(request.path, f"{reason}; expected consecutive files with one clock")
    return overlaps


def without_repeats(rows: MeasuredRows) -> MeasuredRows:
    """Return the first row and those in which a component differs from its last value."""
    is_new = np.zeros(rows.time.size, np.bool_)
    is_new[0] = True
    for numbers in rows.values.values():
        finite = np.flatnonzero(np.isfinite(numbers))
        is_new[finite[np.diff(numbers[finite], prepend=np.nan) != 0.0]] = True
    values = {component: numbers[is_new] for component, numbers in rows.values.items()}
    return rows._replace(time=rows.time[is_new], values=values, repeats=int(np.count_nonzero(~is_new)))


def together(parts: Sequence[MeasuredRows]) -> MeasuredRows:
    """Return components from several tables on the union of their times; NaN at times of other tables."""
    if len(parts) == 1:
        return parts[0]
    time = np.sort(np.concatenate([part.time for part in parts]))
    time = time[np.diff(time, prepend=-np.inf) > _SAME_TIME]
    values = {component: np.full(time.size, np.nan) for part in parts for component in part.values}
    for part in parts:
        at = np.searchsorted(time, part.time + _SAME_TIME, side="right") - 1
        for component, numbers in part.values.items():
            values[component][at] = numbers
    orders = [part.order for part in parts]
    return MeasuredRows(
        time,
        values,
        Order(
            slice(None),
            sum(order.without_time for order in orders),
            sum(order.backward for order in orders),
            max(order.furthest_back for order in orders),
            sum(order.duplicates for order in orders),
        ),
        sum(part.rollovers for part in parts),
        sum(part.invalid for part in parts),
        sum(part.repeats for part in parts),
        next((part.clock_drift for part in parts if part.clock_drift is not None), None),
        [overlap for part in parts for overlap in part.overlaps],
    )


def is_chosen(ids: ColumnValues, choice: RowChoice) -> NDArray[np.bool_]:
    """Return whether ids or flags are among the chosen values; case does not matter, and true equals 1."""
    if ids.dtype.kind == "U":
        wanted = [str(value).lower() for value in choice.values]
        return np.isin(np.char.lower(np.char.strip(np.asarray(ids, np.str_))), wanted)
    return np.isin(ids, [float(value) for value in choice.values if not isinstance(value, str)])


def check_plausible(path: KeyPath, numbers: Array, unit: str) -> None:
    """Raise MapMismatchError if the 99 % quantile of the size is implausible for an underwater vehicle."""
    sizes = np.abs(numbers[np.isfinite(numbers)])
    limit = _MAX_PLAUSIBLE.get(unit, np.inf)
    if sizes.size and (reached := float(np.quantile(sizes, 0.99))) > limit:
        hint = "state the `unit` or `scale` of the log's numbers"
        raise MapMismatchError(path, f"reaches {reached:.3g} {unit}; expected at most {limit:.3g}: {hint}")


class ImportSummary(NamedTuple):
    """Summary of the import of a sensor or input."""

    name: str
    samples: int
    rate: float  # Hz, by the median interval
    span: tuple[float, float]  # first and last time, s
    missing: int  # samples without any component
    duplicates: int  # omitted rows with the time of an earlier one
    remarks: tuple[str, ...]


def summary_of(
    name: str, time: Array, missing: int, rows: MeasuredRows, remarks: tuple[str, ...], interval: float | None = None
) -> ImportSummary:
    """Return the summary of a sensor or input with samples at `time`, s; `interval` as `sampling_interval` has it."""
    order, rollovers, drift = rows.order, rows.rollovers, rows.clock_drift
    treatment = (
        (order.backward, f"time went back in {order.backward} rows, by up to {order.furthest_back:.3g} s: sorted"),
        (order.without_time, f"{order.without_time} rows without a time left out"),
        (rollovers, f"{rollovers} rollovers of a clock without hours or date: continued"),
        (drift, _drift_text(drift) if drift else ""),
        *((True, _overlap_text(overlap)) for overlap in rows.overlaps),
    )
    of_rows = tuple(text for applies, text in treatment if applies)
    interval = interval or (float(np.median(np.diff(time))) if time.size > 1 else 0.0)
    rate = 1.0 / interval if interval else 0.0
    span = float(time[0]), float(time[-1])
    return ImportSummary(name, time.size, rate, span, missing, order.duplicates, (*of_rows, *remarks))


def sampling_interval(time: Array, values: Array) -> float:
    """Return the smallest median interval of a component, s; 0 if none has two values.

    Components from several tables have times of their own.
    """
    times = (time[np.isfinite(component)] for component in values.T)
    return min((float(np.median(np.diff(own))) for own in times if own.size > 1), default=0.0)


def _drift_text(drift: ClockDrift) -> str:
    if drift.unsteady:
        by = f"{_duration(drift.spread)} (5 to 95 %), at most {_duration(drift.furthest)}"
        return f"{drift.clock} drifts from {drift.other} by {by}: `time: '{drift.other}'` would be better"
    return (
        f"{drift.clock} is {_duration(drift.later)} after {drift.other}: the log was played back, or a clock was "
        "not set; use the same clock for all"
    )


def _duration(seconds: float) -> str:
    if seconds > 2.0 * DAY:
        return f"{seconds / DAY:.3g} days"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.4g} s"


def _overlap_text(overlap: Overlap) -> str:
    treatment = "sorted by time" if overlap.own else "same measurements in both, each used once"
    span = f"{overlap.begin:.3f} to {overlap.end:.3f} s by the log's clock"
    return f"file {overlap.file} of the log overlaps earlier files from {span}: {treatment}"
