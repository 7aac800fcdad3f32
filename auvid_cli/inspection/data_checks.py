"""Verdicts on the measurements themselves: what no filter can mend."""

from collections.abc import Sequence

import numpy as np

from auvid_cli.data.check import Check
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.gaps import LONGEST_REPEAT, gap_limit, repeats


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


def _stuck(filter_name: str, name: str, record: SensorRecord) -> tuple[float, Check]:
    """Return the longest time over which a measurement is repeated exactly, s, and the verdict on it."""
    runs = repeats(record)
    start, end = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return float(end - start), Check.of(
        filter_name,
        name,
        "stuck",
        statistic=f"{end - start:.4g} s from t = {start:.6g} s on",
        threshold=f"<= {LONGEST_REPEAT:g} s of the same measurement",
        passed=bool(end - start <= LONGEST_REPEAT),
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
