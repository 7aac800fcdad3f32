"""Whether data are independent of an estimate, and of the same vehicle."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array, release_memory
from auvid_cli.config.experiment import ImportedRun
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import used_data, used_segments
from auvid_cli.identification.timeline import measuring_sensors

_MIN_RUN = 8  # consecutive equal measurements that are copies, for finely resolved values
_MAX_PLACES = 1000  # runs of a record that are searched for in the other
_MAX_COUNTED = 100_000  # measurements in which equal ones are counted
_COINCIDENCE = 1e-6  # probability of an equal run without copying
_SAME_VALUE = 1e-6  # relative difference of equal parameters
_ADVICE = "validate on data that are new to the model: name another run, or another time with --use"


def unseen_segments(dataset: Dataset, estimate: Estimate, training: Dataset | None = None) -> list[Dataset]:
    """Return the used segments of a dataset; DataError if the estimate was made from one, or if there are none.

    `training` is the complete dataset that the estimate was made from, see `check_unseen`.
    """
    if training is not None:
        training = used_data(training.with_settings(estimate.experiment))
    segments = used_segments(dataset, measuring_sensors(dataset))
    for segment in segments:
        check_unseen(segment, estimate, training)
    return segments


def check_unseen(dataset: Dataset, estimate: Estimate, training: Dataset | None = None) -> None:
    """Raise DataError if an estimate was made from these measurements.

    Parameters
    ----------
    dataset : Dataset
    estimate : Estimate
    training : Dataset, optional
        Part of a dataset that the estimate was made from. With it, copies in other files are found too.
    """
    shift = _clock_shift(dataset, estimate)
    if shift is not None:
        times = [record.time for record in dataset.sensors.values() if record.time.size]
        begin, end = min(t[0] for t in times) + shift, max(t[-1] for t in times) + shift
        used = estimate.experiment.identification.use.spans or ((estimate.time[0], estimate.time[-1]),)
        # Successive segments share one measurement.
        if any(begin < last and first < end for first, last in used):
            raise DataError(f"the estimate was made from this time of the same data; {_ADVICE}")
    if training is None:
        return
    for name, record in dataset.sensors.items():
        if name in training.sensors and have_run_in_common(record.values, training.sensors[name].values):
            raise DataError(f"the estimate was made from some of these measurements of {name}; {_ADVICE}")


def _clock_shift(dataset: Dataset, estimate: Estimate) -> float | None:
    """Return the offset from a dataset's times to those of an estimate, s; None if they are not of the same log."""
    if estimate.dataset_sha256 and estimate.dataset_sha256 == dataset.sha256:
        return 0.0
    run, other = dataset.experiment, estimate.experiment
    if not (isinstance(run, ImportedRun) and isinstance(other, ImportedRun)):
        return None
    if {f.sha256 for f in run.recording.files} & {f.sha256 for f in other.recording.files}:
        return run.recording.origin - other.recording.origin
    return None


def have_run_in_common(some: Array, others: Array) -> bool:
    """Whether two records, shape (n, c) and (m, c), share consecutive measurements, at any times.

    Repeated measurements, and components that one record never has, are ignored. Runs at evenly spaced places
    of `some` are searched for in `others`.
    """
    both = np.isfinite(some).any(axis=0) & np.isfinite(others).any(axis=0)
    if not both.any():
        return False
    some, others = (_distinct(record[:, both]) for record in (some, others))
    length = _significant_run(others)
    if min(len(some), len(others)) < length:
        return False
    order = np.argsort(others[:, 0], kind="stable")
    ordered = others[order, 0]
    for place in np.unique(np.linspace(0, len(some) - length, _MAX_PLACES).astype(np.int64)):
        run = some[place : place + length]
        same = slice(*(np.searchsorted(ordered, run[0, 0], side) for side in ("left", "right")))
        if any(np.array_equal(run, others[i : i + length]) for i in order[same]):
            return True
    return False


def _significant_run(record: Array) -> int:
    """Return the length of an equal run that is hardly a coincidence: longer for records with few different values."""
    if len(record) < _MIN_RUN:
        return _MIN_RUN
    _, value = np.unique(record[:_MAX_COUNTED], axis=0, return_inverse=True)
    value = value.ravel()
    once, twice = (_coincidence(names) for names in (value, value[:-1] * value.size + value[1:]))
    if twice == 0.0:
        return _MIN_RUN
    # Probability that the next measurements are equal too.
    again = min(twice / once, 1.0)
    if again == 1.0:
        return len(record) + 1
    return max(_MIN_RUN, int(np.ceil(np.log(_COINCIDENCE / (_MAX_PLACES * len(record))) / np.log(again))))


def _coincidence(names: NDArray[np.int64]) -> float:
    """Return the probability that two measurements at random places are equal; `names` numbers the distinct ones."""
    counts = np.unique(names, return_counts=True)[1]
    return float((counts * (counts - 1)).sum() / (names.size * (names.size - 1)))


def _distinct(record: Array) -> Array:
    """Return the complete measurements that differ from the previous one."""
    whole = record[np.isfinite(record).all(axis=1)]
    release_memory()
    return whole[np.concatenate([[True], (np.diff(whole, axis=0) != 0.0).any(axis=1)])] if len(whole) else whole


def other_vehicle(dataset: Dataset, estimate: Estimate) -> list[str]:
    """Return the symbols of known parameters and sizes in which the vehicles of dataset and estimate differ."""
    ours, theirs = (
        settings.known_parameters() | settings.size.model_dump()
        for settings in (estimate.experiment.vehicle, dataset.experiment.vehicle)
    )
    return [symbol for symbol, value in ours.items() if not np.isclose(value, theirs[symbol], rtol=_SAME_VALUE, atol=0)]
