"""Time stamps of sensors and inputs: rate, jitter, clock jumps, gaps, missing values."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check
from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.data.signals import gap_limit, repeats, rounding_steps
from auvid_cli.inspection.inspection import judged

_MAX_JITTER = 0.5  # share of the median interval
_MAX_INPUT_INTERVAL = 0.5  # s, for any vehicle
_MAX_MISSING_SHARE = 0.01  # above: a note
_FAILED_MISSING_SHARE = 0.5  # above: fails
# Smallest ratio of changes over a long interval to changes from sample to sample that distinguishes the two.
_MIN_CHANGE_RATIO = 3.0
_MAX_CONTINUOUS_CHANGE = 3.0  # robust standard deviations of a change from sample to sample


def new_measurement_rate(record: SensorRecord) -> float:
    """Return the rate of measurements that differ from the previous one, 1/s; 0 with fewer than two.

    It is the usual rate times the share of new measurements; for rounded measurements, which may be equal by chance, it
    is the inverse of the median interval between new ones.
    """
    starts = repeats(record)[:, 0]
    if starts.size < 2:
        return 0.0
    present = record.present.any(axis=1)
    if (rounding_steps(record) > 0.0).any():
        return 1.0 / float(np.median(np.diff(starts)))
    return starts.size / int(present.sum()) / float(np.median(np.diff(record.time[present])))


def clock_jumps(record: SensorRecord) -> NDArray[np.int64]:
    """Return the index of the sample before each jump of the time at which the measurements do not jump."""
    time = record.time
    intervals = np.diff(time)
    if not intervals.size:
        return np.zeros(0, np.int64)
    usual = float(np.median(intervals))
    long = np.flatnonzero(intervals > gap_limit(intervals))
    jumps = [at for at in long if _is_continuous(record, int(at), round(float(intervals[at]) / usual))]
    return np.array(jumps, dtype=np.int64)


def _is_continuous(record: SensorRecord, before: int, samples: int) -> bool:
    """Whether the next measurement is near enough for one sample later, and too near for `samples` later."""
    around = record.values[max(before - 50 * samples, 0) : before + 50 * samples]
    distinct = False
    for component, step in enumerate(record.values[before + 1] - record.values[before]):
        column = around[:, component]
        if not np.isfinite(step) or column.size <= samples:
            continue
        over_one, over_many = _spread(column[1:] - column[:-1]), _spread(column[samples:] - column[:-samples])
        if over_many > _MIN_CHANGE_RATIO * over_one:
            if abs(step) > _MAX_CONTINUOUS_CHANGE * over_one:
                return False
            distinct = True
    return distinct


def _spread(values: Array) -> float:
    values = np.abs(values[np.isfinite(values)])
    return 1.4826 * float(np.median(values)) if values.size else np.inf


def timing_checks(name: str, record: SensorRecord, jumps: NDArray[np.int64]) -> list[Check]:
    """Check rate, jitter, clock (given its `clock_jumps`) and missing values of a sensor with at least two samples."""
    by_clock = [np.diff(times) for times in _times_of_clocks(record)]
    usual = min(float(np.median(intervals)) for intervals in by_clock)
    return [
        _rate(name, record, 1.0 / usual),
        _jitter(name, max(by_clock, key=_spread_of_intervals)),
        _clock(name, record, jumps),
        _missing(name, record),
    ]


def _times_of_clocks(record: SensorRecord) -> list[Array]:
    """Return the times of all rows, or of each component if most rows have only some of them, of several devices."""
    present = record.present
    measured = present[:, present.any(axis=0)]
    if 2 * np.count_nonzero(measured.all(axis=1)) >= np.count_nonzero(measured.any(axis=1)):
        return [record.time]
    return [record.time[component] for component in measured.T if np.count_nonzero(component) > 1] or [record.time]


def _spread_of_intervals(intervals: Array) -> float:
    """Return the range of 98 % of intervals divided by their median."""
    least, most = np.quantile(intervals, [0.01, 0.99])
    return float(most - least) / float(np.median(intervals))


def input_end_check(acting: InputRecord, last: float) -> Check:
    """Check that the acting inputs last until the last used measurement, `last` in s; estimators require it."""
    begin, end = float(acting.time[0]), float(acting.time[-1])
    leave_out = f"leave this time out (`--use {begin:.6g}:{end:.6g}` for `inspect` and `identify`), " * (begin < end)
    return judged(
        "inputs",
        "end",
        statistic=f"t = {end:.6g} s, measurements until {last:.6g} s",
        threshold="at most 1 s, or the usual duration of an input, before the last measurement",
        passed=not acting.ends_before(last),
        advice=f"Every estimator refuses measurements after the last input: {leave_out}add the missing inputs, or set "
        "unchanged ones as `constant` in the map.",
    )


def input_timing_checks(inputs: InputRecord, time_constant: float | None) -> list[Check]:
    """Check rate and longest gap of the inputs, each of which holds until the next; none if they never change.

    `time_constant` is that of the vehicle, s, if known.
    """
    intervals = np.diff(inputs.time)
    if not np.diff(inputs.values, axis=0).any():
        return []
    usual, longest = float(np.median(intervals)), int(intervals.argmax())
    limit = gap_limit(intervals)
    slowest = _MAX_INPUT_INTERVAL if time_constant is None else min(time_constant, _MAX_INPUT_INTERVAL)
    begin, end = inputs.time[longest], inputs.time[longest + 1]
    return [
        judged(
            "inputs",
            "rate",
            statistic=f"{1.0 / usual:.4g} Hz",
            threshold=f">= {1.0 / slowest:.3g} Hz",
            passed=True if usual <= slowest else None,
            advice="Inputs were logged more slowly than the vehicle responds. If only changes were logged, ignore "
            "this. Otherwise changes in between are lost: log inputs faster next time.",
        ),
        judged(
            "inputs",
            "gap",
            statistic=f"{end - begin:.4g} s from t = {begin:.6g} s on",
            threshold=f"<= {limit:.3g} s without an input",
            passed=True if intervals[longest] <= limit else None,
            advice=f"From t = {begin:.6g} s to {end:.6g} s the last inputs are held. If they changed but were not "
            "logged, leave that time out (`--use`).",
        ),
    ]


def _rate(name: str, record: SensorRecord, rate: float) -> Check:
    new = new_measurement_rate(record)
    repeated = new < 0.8 * rate
    return judged(
        name,
        "rate",
        statistic=f"{rate:.4g} Hz" + (f", new measurements at {new:.3g} Hz" if repeated else ""),
        threshold="every measurement new",
        passed=None if repeated else True,
        advice=f"{name} was logged more often than it measures. A filter treats each copy as a measurement of its own "
        "and becomes overconfident: set `repeats: drop` in the map.",
    )


def _jitter(name: str, intervals: Array) -> Check:
    usual = float(np.median(intervals))
    least, most = np.quantile(intervals, [0.01, 0.99])
    spread = _spread_of_intervals(intervals)
    return judged(
        name,
        "jitter",
        statistic=f"98 % of intervals {least:.4g} to {most:.4g} s",
        threshold=f"within {_MAX_JITTER:.0%} of {usual:.4g} s",
        passed=True if spread <= _MAX_JITTER else None,
        advice=f"Time stamps of {name} are those of a busy logger instead of the sensor, or some are missing. If the "
        "device stamps its measurements, use its time stamps.",
    )


def _clock(name: str, record: SensorRecord, jumps: NDArray[np.int64]) -> Check:
    leaps = ", ".join(f"{record.time[i + 1] - record.time[i]:.4g} s at t = {record.time[i]:.6g} s" for i in jumps[:3])
    return judged(
        name,
        "clock",
        statistic=f"{jumps.size} jumps: {leaps}" if jumps.size else "no jump",
        threshold="no jump of the time without a jump of the measurements",
        passed=not jumps.size,
        advice=f"The clock of {name} was set during the run: after that its times do not match the other sensors. "
        "Shift them back, or use one side of the jump (`--use`).",
    )


def _missing_share(record: SensorRecord) -> float:
    """Return the share of missing values, among components that are measured at all.

    A component with time stamps of its own has no values at the time stamps of others. Therefore its share is at most
    that of the values missing from its own rate.
    """
    present = record.present
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
        threshold=f"<= {_MAX_MISSING_SHARE:.0%}",
        passed=True if share <= _MAX_MISSING_SHARE else None if share <= _FAILED_MISSING_SHARE else False,
        advice=f"{name} often has no valid value. Find the reason (lost bottom track, quality flags), and check if "
        "values are missing mainly during manoeuvres.",
    )
