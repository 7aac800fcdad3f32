"""Verdicts on the readings themselves: what no filter can mend."""

import numpy as np

from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.evaluation.check import Check

# A sensor with noise does not repeat itself to the last bit; some quantised ones do for a while.
_LONGEST_REPEAT = 2.0
# s, and times the usual interval.
_LONGEST_GAP, _INTERVALS = 1.0, 10.0


def data_checks(dataset: Dataset, filter_name: str, sensors: list[str]) -> list[Check]:
    """Stuck values and gaps of the sensors that a filter used."""
    checks = []
    for name in sensors:
        record = dataset.sensors[name]
        present = np.asarray(np.isfinite(record.values).any(axis=1))
        if present.sum() > 1:
            checks.append(_stuck(filter_name, name, record, present))
            checks.append(_gap(filter_name, name, record, present))
    return checks


def _stuck(filter_name: str, name: str, record: SensorRecord, present: np.ndarray) -> Check:
    """The longest time over which a reading is repeated exactly."""
    time, values = record.time[present], record.values[present]
    moved = np.flatnonzero(np.any((values[1:] != values[:-1]) & np.isfinite(values[1:]), axis=1)) + 1
    edges = np.concatenate([[0], moved, [len(values)]])
    longest = int(np.argmax(time[edges[1:] - 1] - time[edges[:-1]]))
    start, end = time[edges[longest]], time[edges[longest + 1] - 1]
    return Check.of(
        filter_name,
        name,
        "stuck",
        f"{end - start:.4g} s from t = {start:.6g} s on",
        f"<= {_LONGEST_REPEAT:g} s of the same reading",
        bool(end - start <= _LONGEST_REPEAT),
        f"{name} repeats one reading from t = {start:.6g} s to {end:.6g} s: it has failed or was logged twice. "
        "Mark that time as not valid.",
    )


def _gap(filter_name: str, name: str, record: SensorRecord, present: np.ndarray) -> Check:
    time = record.time[present]
    gaps = np.diff(time)
    longest = int(gaps.argmax())
    limit = max(_LONGEST_GAP, _INTERVALS * float(np.median(gaps)))
    return Check.of(
        filter_name,
        name,
        "gap",
        f"{gaps[longest]:.4g} s from t = {time[longest]:.6g} s on",
        f"<= {limit:.3g} s without a reading",
        True if gaps[longest] <= limit else None,
        f"{name} is silent from t = {time[longest]:.6g} s to {time[longest + 1]:.6g} s. The filter bridges it with "
        "the model alone: see in the innovations whether it caught up.",
    )
