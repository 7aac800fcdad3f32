"""When a sensor speaks, and the inputs: rate, jitter, clock jumps, missing values."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.data.signals import gap_limit, quantisation_step, repeats
from auvid_cli.inspection.inspection import judged

Array = NDArray[np.float64]

_LARGEST_JITTER = 0.5
# s between inputs, of any vehicle.
_LONGEST_HELD = 0.5
_MOST_MISSING, _HARDLY_ANY = 0.01, 0.5
# How much more a measurement changes over a long interval than from one sample to the next, where both tell apart, and
# how many of the latter a jump of the clock may show.
_DISTINCT, _CONTINUOUS = 3.0, 3.0


def new_measurement_rate(record: SensorRecord) -> float:
    """Return the rate of measurements that differ from the one before, 1/s; 0 if there are not two.

    The usual rate times the share of them that is new. Of measurements on a grid, which may be equal by chance, by the
    median interval between new ones.
    """
    starts = repeats(record)[:, 0]
    if starts.size < 2:
        return 0.0
    present = np.isfinite(record.values).any(axis=1)
    levels = (np.unique(column[np.isfinite(column)]) for column in record.values.T)
    if any(level.size > 2 and quantisation_step(level) > 0.0 for level in levels):
        return 1.0 / float(np.median(np.diff(starts)))
    return starts.size / int(present.sum()) / float(np.median(np.diff(record.time[present])))


def clock_jumps(record: SensorRecord) -> NDArray[np.int64]:
    """Find where the time leaps but the measurements go on as if it had not.

    Returns
    -------
    ndarray of int
        Indices of the samples before the leaps.
    """
    time = record.time
    intervals = np.diff(time)
    if not intervals.size:
        return np.zeros(0, np.int64)
    usual = float(np.median(intervals))
    long = np.flatnonzero(intervals > gap_limit(intervals))
    jumps = [at for at in long if _goes_on(record, int(at), round(float(intervals[at]) / usual))]
    return np.array(jumps, dtype=np.int64)


def _goes_on(record: SensorRecord, before: int, samples: int) -> bool:
    """Say whether the next measurement is where the very next sample would be, and not `samples` later."""
    around = record.values[max(before - 50 * samples, 0) : before + 50 * samples]
    distinct = False
    for component, step in enumerate(record.values[before + 1] - record.values[before]):
        column = around[:, component]
        if not np.isfinite(step) or column.size <= samples:
            continue
        over_one, over_many = _spread(column[1:] - column[:-1]), _spread(column[samples:] - column[:-samples])
        if over_many > _DISTINCT * over_one:
            if abs(step) > _CONTINUOUS * over_one:
                return False
            distinct = True
    return distinct


def _spread(values: Array) -> float:
    values = np.abs(values[np.isfinite(values)])
    return 1.4826 * float(np.median(values)) if values.size else np.inf


def timing_checks(name: str, record: SensorRecord, jumps: NDArray[np.int64]) -> list[Check]:
    """Judge rate, jitter, clock (from its `clock_jumps`) and missing values of a sensor with several samples."""
    intervals = np.diff(record.time)
    return [
        _rate(name, record, intervals),
        _jitter(name, intervals),
        _clock(name, record, jumps),
        _missing(name, record),
    ]


def input_end_check(acting: InputRecord, last: float) -> Check:
    """Judge whether the inputs last as long as the measurements, as estimators do.

    Parameters
    ----------
    acting : InputRecord
        As estimators take them to have acted.
    last : float
        s, of the last measurement that these listen to.
    """
    begin, end = float(acting.time[0]), float(acting.time[-1])
    leave_out = f"leave it out (`--use {begin:.6g}:{end:.6g}`, of `inspect` and `identify` alike), " * (begin < end)
    return judged(
        "inputs",
        "end",
        statistic=f"t = {end:.6g} s, the measurements go on to {last:.6g} s",
        threshold="at most 1 s before the measurements, or as long as an input held",
        passed=not acting.ends_before(last),
        advice=f"Every estimator refuses what comes after the last input: {leave_out}find the inputs of that time, or "
        "state what did not change as a `constant` in the map.",
    )


def input_timing_checks(inputs: InputRecord, time_constant: float | None) -> list[Check]:
    """Judge rate and longest gap of the inputs, each of which holds until the next; none if they never change.

    Parameters
    ----------
    inputs : InputRecord
    time_constant : float or None
        s, of the vehicle, if it is known.
    """
    intervals = np.diff(inputs.time)
    if not np.diff(inputs.values, axis=0).any():
        return []
    usual, longest = float(np.median(intervals)), int(intervals.argmax())
    limit = gap_limit(intervals)
    slowest = _LONGEST_HELD if time_constant is None else min(time_constant, _LONGEST_HELD)
    begin, end = inputs.time[longest], inputs.time[longest + 1]
    return [
        judged(
            "inputs",
            "rate",
            statistic=f"{1.0 / usual:.4g} Hz",
            threshold=f">= {1.0 / slowest:.3g} Hz",
            passed=True if usual <= slowest else None,
            advice="The inputs were logged more seldom than the vehicle answers them. If only changes were logged all "
            "is well; else what they did in between is lost: log them faster.",
        ),
        judged(
            "inputs",
            "gap",
            statistic=f"{end - begin:.4g} s from t = {begin:.6g} s on",
            threshold=f"<= {limit:.3g} s without an input",
            passed=True if intervals[longest] <= limit else None,
            advice=f"From t = {begin:.6g} s to {end:.6g} s the last inputs are taken to hold. If they were not logged "
            "then, leave that time out (`--use`).",
        ),
    ]


def _rate(name: str, record: SensorRecord, intervals: Array) -> Check:
    rate, new = 1.0 / float(np.median(intervals)), new_measurement_rate(record)
    repeated = new < 0.8 * rate
    return judged(
        name,
        "rate",
        statistic=f"{rate:.4g} Hz" + (f", new measurements at {new:.3g} Hz" if repeated else ""),
        threshold="every measurement new",
        passed=None if repeated else True,
        advice=f"{name} was logged more often than it measures. A filter takes each copy for a measurement of its own "
        "and becomes too sure: keep only new measurements.",
    )


def _jitter(name: str, intervals: Array) -> Check:
    usual = float(np.median(intervals))
    least, most = np.quantile(intervals, [0.01, 0.99])
    spread = float(most - least) / usual
    return judged(
        name,
        "jitter",
        statistic=f"98 % of intervals {least:.4g} to {most:.4g} s",
        threshold=f"within {_LARGEST_JITTER:.0%} of {usual:.4g} s",
        passed=True if spread <= _LARGEST_JITTER else None,
        advice=f"Times of {name} are those of a busy logger rather than of the measurement, or some are missing: if "
        "the device stamps its own, use those.",
    )


def _clock(name: str, record: SensorRecord, jumps: NDArray[np.int64]) -> Check:
    leaps = ", ".join(f"{record.time[i + 1] - record.time[i]:.4g} s at t = {record.time[i]:.6g} s" for i in jumps[:3])
    return judged(
        name,
        "clock",
        statistic=f"{jumps.size} jumps: {leaps}" if jumps.size else "no jump",
        threshold="no leap of the time without one of the measurements",
        passed=not jumps.size,
        advice=f"The clock of {name} was set while it ran: from there on its times do not fit those of the others. "
        "Shift them back, or use only one side of the jump.",
    )


def _missing_share(record: SensorRecord) -> float:
    """Return the share of values that are missing, of components that are measured at all.

    Components with times of their own are missing at those of the others, which is no loss: of each those count that
    its own rate would bring.
    """
    present = np.isfinite(record.values)
    of_rows = 1.0 - float(present.any(axis=1).mean())
    shares = []
    for component in present.T[present.any(axis=0)]:
        times = record.time[component]
        by_rate = 1.0 - times.size * np.median(np.diff(times)) / np.ptp(record.time) if times.size > 1 else 1.0
        shares.append(max(of_rows, min(1.0 - component.mean(), by_rate)))
    return float(np.mean(shares)) if shares else 1.0


def _missing(name: str, record: SensorRecord) -> Check:
    share = _missing_share(record)
    return judged(
        name,
        "missing",
        statistic=f"{share:.2%} of values",
        threshold=f"<= {_MOST_MISSING:.0%}",
        passed=True if share <= _MOST_MISSING else None if share <= _HARDLY_ANY else False,
        advice=f"{name} often has no valid value: look at what makes it fail (bottom lost, quality flags), and whether "
        "they are missing just when the vehicle manoeuvres.",
    )
