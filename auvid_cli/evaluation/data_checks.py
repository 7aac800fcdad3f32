"""Verdicts on the measurements themselves: what no filter can mend."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.gaps import gap_limit
from auvid_cli.evaluation.check import Check

Array = NDArray[np.float64]

# A sensor with noise does not repeat itself to the last bit; some quantised ones do for a while.
_LONGEST_REPEAT = 2.0


def data_checks(segments: Sequence[Dataset], filter_name: str, sensors: Sequence[str]) -> list[Check]:
    """Judge stuck values and gaps of the sensors that a filter used; time between two segments is no gap."""
    checks = []
    for name in sensors:
        records = [segment.sensors[name] for segment in segments]
        measured = [record for record in records if np.isfinite(record.values).any(axis=1).sum() > 1]
        if measured:
            for judge in (_stuck, _gap):
                _, worst = max((judge(filter_name, name, record) for record in measured), key=lambda judged: judged[0])
                checks.append(worst)
    return checks


def repeats(record: SensorRecord) -> Array:
    """Find first and last time, s, of every run of the same measurement, shape (n, 2); one alone is a run, too."""
    present = np.isfinite(record.values).any(axis=1)
    time, values = record.time[present], record.values[present]
    moved = np.flatnonzero(np.any((values[1:] != values[:-1]) & np.isfinite(values[1:]), axis=1)) + 1
    edges = np.concatenate([[0], moved, [len(values)]])
    return np.stack([time[edges[:-1]], time[edges[1:] - 1]], axis=1)


def stuck_times(record: SensorRecord) -> Array:
    """Return those of the `repeats` that last too long."""
    runs = repeats(record)
    return runs[runs[:, 1] - runs[:, 0] > _LONGEST_REPEAT]


def gaps(record: SensorRecord) -> Array:
    """Find begin and end, s, of every time without a measurement, shape (n, 2)."""
    time = record.time[np.isfinite(record.values).any(axis=1)]
    intervals = np.diff(time)
    long = np.flatnonzero(intervals > gap_limit(intervals)) if intervals.size else []
    return np.stack([time[:-1][long], time[1:][long]], axis=1)


def _stuck(filter_name: str, name: str, record: SensorRecord) -> tuple[float, Check]:
    """Return the longest time over which a measurement is repeated exactly, s, and the verdict on it."""
    runs = repeats(record)
    start, end = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return float(end - start), Check.of(
        filter_name,
        name,
        "stuck",
        statistic=f"{end - start:.4g} s from t = {start:.6g} s on",
        threshold=f"<= {_LONGEST_REPEAT:g} s of the same measurement",
        passed=bool(end - start <= _LONGEST_REPEAT),
        advice=f"{name} repeats one measurement from t = {start:.6g} s to {end:.6g} s: it has failed or was logged "
        "twice. Mark that time as not valid.",
    )


def _gap(filter_name: str, name: str, record: SensorRecord) -> tuple[float, Check]:
    """Return the longest time without a measurement, s, and the verdict on it."""
    time = record.time[np.isfinite(record.values).any(axis=1)]
    intervals = np.diff(time)
    longest = int(intervals.argmax())
    limit = gap_limit(intervals)
    return float(intervals[longest]), Check.of(
        filter_name,
        name,
        "gap",
        statistic=f"{intervals[longest]:.4g} s from t = {time[longest]:.6g} s on",
        threshold=f"<= {limit:.3g} s without a measurement",
        passed=True if intervals[longest] <= limit else None,
        advice=f"{name} is silent from t = {time[longest]:.6g} s to {time[longest + 1]:.6g} s. The filter bridges it "
        "with the model alone: see in the innovations whether it caught up.",
    )
