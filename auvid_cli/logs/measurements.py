"""Measurements from columns of a log, and the report of the import."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.log_columns import LogSignal, RowChoice
from auvid_cli.config.source_positions import KeyPath
from auvid_cli.logs.clock import ClockDrift, Order, find_clock_drift, order_rows
from auvid_cli.logs.formats.log import ColumnValues, Overlap, find_overlaps
from auvid_cli.logs.requests import ColumnReader, MapMismatchError, Request
from auvid_cli.text import one_line

Array = NDArray[np.float64]
# What an underwater vehicle does not reach: more than that is another unit.
_IMPOSSIBLE = {"rad": 2.0 * np.pi, "rad/s": 20.0, "m/s": 50.0, "m/s^2": 500.0}
# s. At the border of two files messages may be out of order by what they were late.
_LONGEST_INTERLEAVING = 1.0
# s: what rounding makes of one time in several tables.
_SAME_TIME = 1e-6
_DAY = 86400.0


class MeasuredRows(NamedTuple):
    """Rows of a log for one sensor or input.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, by the log's clock, strictly increasing.
    values : dict of ndarray, each of shape (n,)
        SI by component, NaN where one is missing.
    order : Order
        What was sorted and left out.
    rollovers : int
        Of a clock without hours or date.
    invalid : int
        Rows that the log calls not valid, and values beyond the limits that the map sets.
    repeats : int
        Rows left out because they only repeat what was read before.
    clock_drift : ClockDrift or None
        Of a clock that the message's other one is better than.
    overlaps : list of Overlap
        Of files that continue each other.
    """

    time: Array
    values: dict[str, Array]
    order: Order
    rollovers: int
    invalid: int
    repeats: int
    clock_drift: ClockDrift | None
    overlaps: list[Overlap]


def read_request(
    request: Request, signals: Mapping[str, LogSignal], validity: RowChoice | None, columns: ColumnReader
) -> MeasuredRows:
    """Read what a request asks for.

    Raises
    ------
    MapMismatchError
        If its times are no times or never change, if tables that belong together are not of one length, or if files
        that should continue each other do not.
    FileError
        If the log is damaged.
    """
    raw = {component: columns.take(place) for component, (place, *_) in request.values.items()}
    flags = columns.take(request.valid) if request.valid is not None else None
    try:
        seconds, rollovers = columns.take_time(request)
    except ValueError as error:
        raise MapMismatchError((*request.path, "time"), one_line(str(error))) from None
    length = next(iter(raw.values())).size
    if seconds.size != length:
        raise MapMismatchError(
            (*request.path, "time"),
            f"{request.time.place.table} has {seconds.size} rows and cannot give times to the {length} rows here",
        )
    left_out = 0
    if request.chosen is not None:
        place, choice = request.chosen
        others = ~is_chosen(ids := columns.take(place), choice)
        if others.all():
            some = ", ".join(map(str, np.unique(ids)[:8].tolist()))
            raise MapMismatchError((*request.path, "rows"), f"no row has such a {place.column!r}; there is {some}")
        left_out = int(np.count_nonzero(others & np.isfinite(seconds)))
        seconds = np.where(others, np.nan, seconds)
    order = order_rows(seconds)
    order = order._replace(without_time=order.without_time - left_out)
    time = seconds[order.rows]
    if time.size < 2:
        raise _no_times(request, seconds.size, time.size)
    clock_drift, overlaps = _clock_drift(request, seconds, columns), _overlaps(request, seconds, raw, columns)
    values, invalid = {}, 0
    for component, (_, factor, _) in request.values.items():
        signal = signals[component]
        numbers = to_si(raw.pop(component)[order.rows], signal, factor)
        # What is infinite was not measured, and stands for that.
        outside = np.isinf(numbers)
        if signal.limits is not None:
            outside |= (numbers < signal.limits[0]) | (numbers > signal.limits[1])
        invalid += int(np.count_nonzero(outside))
        numbers[outside] = np.nan
        values[component] = numbers
    if flags is not None and validity is not None:
        wrong = ~is_chosen(flags[order.rows], validity)
        invalid += int(np.count_nonzero(wrong))
        for numbers in values.values():
            numbers[wrong] = np.nan
    return MeasuredRows(time, values, order, rollovers, invalid, 0, clock_drift, overlaps)


def _no_times(request: Request, rows: int, times: int) -> MapMismatchError:
    log, table, column = request.time.place
    if rows < 2:
        return MapMismatchError(("logs", log), f"{table or 'the log'} has {'only one row' if rows else 'no rows'}")
    complaint = "never changes" if times else "holds no time in any row"
    return MapMismatchError((*request.path, "time"), f"{column!r} {complaint}: name another time")


def _clock_drift(request: Request, seconds: Array, columns: ColumnReader) -> ClockDrift | None:
    taken, other = request.time.place, request.time.other
    if other is None:
        return None
    return find_clock_drift(seconds, np.asarray(columns.take(other), np.float64), (taken.column, other.column))


def _overlaps(
    request: Request, seconds: Array, raw: Mapping[str, ColumnValues], columns: ColumnReader
) -> list[Overlap]:
    """Find overlaps of the files of a log; MapMismatchError if they interleave for longer than disorder explains."""
    if request.time.file is None:
        return []
    files, values = columns.take(request.time.file), np.column_stack([*raw.values()])
    overlaps = find_overlaps(seconds, np.asarray(files, np.float64), np.asarray(values, np.float64))
    for file, begin, end, own in overlaps:
        if own and end - begin > _LONGEST_INTERLEAVING:
            span = f"{begin:.3f} to {end:.3f} s"
            reason = f"file {file} of the log and those before it both have measurements from {span}"
            raise MapMismatchError(request.path, f"{reason}, so they do not continue each other: is it one clock?")
    return overlaps


def without_repeats(rows: MeasuredRows) -> MeasuredRows:
    """Keep the first row, and those with a number that is another than the last one of its component."""
    fresh = np.zeros(rows.time.size, np.bool_)
    fresh[0] = True
    for numbers in rows.values.values():
        known = np.flatnonzero(np.isfinite(numbers))
        fresh[known[np.diff(numbers[known], prepend=np.nan) != 0.0]] = True
    values = {component: numbers[fresh] for component, numbers in rows.values.items()}
    return rows._replace(time=rows.time[fresh], values=values, repeats=int(np.count_nonzero(~fresh)))


def together(parts: Sequence[MeasuredRows]) -> MeasuredRows:
    """Put components that were read apart on the union of their times, each missing where only others were measured."""
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


def to_si(raw: ColumnValues, signal: LogSignal, factor: float) -> Array:
    """Convert a signal's numbers to SI: sign x (raw - centre) x factor + offset."""
    numbers = np.array(raw, np.float64)
    numbers -= signal.centre
    numbers *= signal.sign * factor
    numbers += signal.offset
    return numbers


def is_chosen(ids: ColumnValues, choice: RowChoice) -> NDArray[np.bool_]:
    """Say whether an id or a flag is one of those that are asked for; capitals do not matter, and true is 1."""
    if ids.dtype.kind == "U":
        wanted = [str(value).lower() for value in choice.values]
        return np.isin(np.char.lower(np.char.strip(np.asarray(ids, np.str_))), wanted)
    return np.isin(ids, [float(value) for value in choice.values if not isinstance(value, str)])


def check_plausible(path: KeyPath, numbers: Array, unit: str) -> None:
    """Raise MapMismatchError if most of the larger numbers are what no underwater vehicle does."""
    sizes = np.abs(numbers[np.isfinite(numbers)])
    limit = _IMPOSSIBLE.get(unit, np.inf)
    if sizes.size and (reached := float(np.quantile(sizes, 0.99))) > limit:
        raise MapMismatchError(
            path, f"reaches {reached:.3g} {unit}, which cannot be: state the `unit` (or `scale`) of the log's numbers"
        )


class ImportSummary(NamedTuple):
    """What became of one sensor or input.

    Attributes
    ----------
    name : str
    samples : int
    rate : float
        Hz, by the median interval.
    span : tuple of float
        s, first and last.
    missing : int
        Samples without any component.
    duplicates : int
        Rows at the time of an earlier one, left out.
    remarks : tuple of str
    """

    name: str
    samples: int
    rate: float
    span: tuple[float, float]
    missing: int
    duplicates: int
    remarks: tuple[str, ...]


def summary_of(
    name: str, time: NDArray[np.float64], missing: int, rows: MeasuredRows, remarks: tuple[str, ...]
) -> ImportSummary:
    """Summarise a sensor or input that kept samples at `time`, s, of the rows that were read."""
    order, rollovers, drift = rows.order, rows.rollovers, rows.clock_drift
    treatment = (
        (order.backward, f"time went back in {order.backward} rows, by up to {order.furthest_back:.3g} s: sorted"),
        (order.without_time, f"{order.without_time} rows without a time left out"),
        (rollovers, f"the hour or the day of the clock ended, {rollovers} in all: taken to go on"),
        (drift, _differing(drift) if drift else ""),
        *((True, _overlapping(overlap)) for overlap in rows.overlaps),
    )
    of_rows = tuple(text for applies, text in treatment if applies)
    rate = 1.0 / float(np.median(np.diff(time))) if time.size > 1 else 0.0
    span = float(time[0]), float(time[-1])
    return ImportSummary(name, time.size, rate, span, missing, order.duplicates, (*of_rows, *remarks))


def _differing(drift: ClockDrift) -> str:
    if drift.unsteady:
        by = f"{_duration(drift.spread)} (5 to 95 %), at most {_duration(drift.furthest)}"
        return f"{drift.clock} drifts from {drift.other} by {by}: `time: '{drift.other}'` would be right"
    return (
        f"{drift.clock} is {_duration(drift.later)} after {drift.other}: the log was played back, or a clock was "
        "not set; take the same one for all"
    )


def _duration(seconds: float) -> str:
    if seconds > 2.0 * _DAY:
        return f"{seconds / _DAY:.3g} days"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.4g} s"


def _overlapping(overlap: Overlap) -> str:
    done = "taken as they come in time" if overlap.own else "the same measurements in both, each taken once"
    span = f"{overlap.begin:.3f} to {overlap.end:.3f} s by the log's clock"
    return f"file {overlap.file} of the log overlaps those before it from {span}: {done}"
