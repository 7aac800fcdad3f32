"""Whether data are new to an estimate, and of the vehicle that it is of."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import ImportedRun
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import used_data, used_segments
from auvid_cli.identification.timeline import measuring_sensors

Array = NDArray[np.float64]

# Consecutive measurements that are the same only if they are copies, however fine; how many places are looked at for
# each sensor; and the chance that coarse ones are the same and no copies.
_RUN, _PLACES, _CHANCE = 8, 1000, 1e-6
# Relative difference between two values that are the same for a model.
_SAME = 1e-6


def unseen_segments(dataset: Dataset, estimate: Estimate, training: Dataset | None = None) -> list[Dataset]:
    """Return what is used of a dataset, segment by segment, if an estimate was not made from it.

    Parameters
    ----------
    dataset : Dataset
    estimate : Estimate
    training : Dataset, optional
        That the estimate was made from, with all that it left out.

    Raises
    ------
    DataError
        As of `check_unseen`, or if nothing of the dataset is used.
    """
    if training is not None:
        training = used_data(replace(training, experiment=estimate.experiment))
    segments = used_segments(dataset, measuring_sensors(dataset))
    for segment in segments:
        check_unseen(segment, estimate, training)
    return segments


def check_unseen(dataset: Dataset, estimate: Estimate, training: Dataset | None = None) -> None:
    """Refuse measurements that an estimate was made from.

    Parameters
    ----------
    dataset : Dataset
    estimate : Estimate
    training : Dataset, optional
        What of a dataset the estimate was made from, if it is at hand: a copy of it in another file, or a part, is
        found as well, and what it left out may be used.

    Raises
    ------
    DataError
        If the dataset is the estimate's own, or has measurements in common with it.
    """
    advice = "a model must be judged on data that it has not seen: name another run, or a time with --use"
    shift = _clock_shift(dataset, estimate)
    if shift is not None:
        times = [record.time for record in dataset.sensors.values() if record.time.size]
        begin, end = min(t[0] for t in times) + shift, max(t[-1] for t in times) + shift
        used = estimate.experiment.identification.use.spans or ((estimate.time[0], estimate.time[-1]),)
        # Where two segments meet, one measurement stands in both.
        if any(begin < last and first < end for first, last in used):
            raise DataError(f"the estimate was made from this time of these very data; {advice}")
    if training is None:
        return
    for name, record in dataset.sensors.items():
        if name in training.sensors and have_run_in_common(record.values, training.sensors[name].values):
            raise DataError(f"measurements of {name} are among those that the estimate was made from; {advice}")


def _clock_shift(dataset: Dataset, estimate: Estimate) -> float | None:
    """Return what turns a dataset's times, s, into those of an estimate of the same log; None if it is another."""
    if estimate.dataset_sha256 and estimate.dataset_sha256 == dataset.sha256:
        return 0.0
    here, there = dataset.experiment, estimate.experiment
    if not (isinstance(here, ImportedRun) and isinstance(there, ImportedRun)):
        return None
    if {f.sha256 for f in here.recording.files} & {f.sha256 for f in there.recording.files}:
        return here.recording.origin - there.recording.origin
    return None


def have_run_in_common(some: Array, others: Array) -> bool:
    """Say whether consecutive measurements of one record stand in another too, at whatever times.

    Components that one of them never has are not looked at, nor measurements that only repeat the one before.

    Parameters
    ----------
    some : ndarray, shape (n, c)
        Looked at in evenly spaced places.
    others : ndarray, shape (m, c)
    """
    both = np.isfinite(some).any(axis=0) & np.isfinite(others).any(axis=0)
    if not both.any():
        return False
    some, others = (_changing(record[:, both]) for record in (some, others))
    length = _telling_run(others)
    if min(len(some), len(others)) < length:
        return False
    order = np.argsort(others[:, 0], kind="stable")
    ordered = others[order, 0]
    for place in np.unique(np.linspace(0, len(some) - length, _PLACES).astype(np.int64)):
        run = some[place : place + length]
        same = slice(*(np.searchsorted(ordered, run[0, 0], side) for side in ("left", "right")))
        if any(np.array_equal(run, others[i : i + length]) for i in order[same]):
            return True
    return False


def _telling_run(record: Array) -> int:
    """Return how many consecutive measurements are hardly the same by chance: more of those that take few values."""
    if len(record) < _RUN:
        return _RUN
    _, value = np.unique(record, axis=0, return_inverse=True)
    value = value.ravel()
    once, twice = (_coincidence(names) for names in (value, value[:-1] * len(record) + value[1:]))
    if twice == 0.0:
        return _RUN
    # If one measurement is the same, so often is the next.
    again = min(twice / once, 1.0)
    if again == 1.0:
        return len(record) + 1
    return max(_RUN, int(np.ceil(np.log(_CHANCE / (_PLACES * len(record))) / np.log(again))))


def _coincidence(names: NDArray[np.int64]) -> float:
    """Return how often two different places have the same name."""
    counts = np.unique(names, return_counts=True)[1]
    return float((counts * (counts - 1)).sum() / (names.size * (names.size - 1)))


def _changing(record: Array) -> Array:
    """Return whole measurements, each other than the one before."""
    whole = record[np.isfinite(record).all(axis=1)]
    return whole[np.concatenate([[True], (np.diff(whole, axis=0) != 0.0).any(axis=1)])] if len(whole) else whole


def other_vehicle(dataset: Dataset, estimate: Estimate) -> list[str]:
    """Name known parameters and sizes that a dataset states otherwise than an estimate, by symbol."""
    ours, theirs = (
        settings.known_parameters() | settings.size.model_dump()
        for settings in (estimate.experiment.vehicle, dataset.experiment.vehicle)
    )
    return [symbol for symbol, value in ours.items() if not np.isclose(value, theirs[symbol], rtol=_SAME, atol=0.0)]
