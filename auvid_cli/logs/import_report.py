"""What was done to a sensor or an input on its way from the log, to be said."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.clock_drift import ClockDrift
from auvid_cli.logs.formats.overlap import Overlap
from auvid_cli.logs.measurements import MeasuredRows

_DAY = 86400.0


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
