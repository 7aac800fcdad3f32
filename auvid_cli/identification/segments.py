"""Which parts of the data are used: stretches of time, each of which starts anew."""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Use
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.errors import DataError
from auvid_cli.identification.actuators import lagged
from auvid_cli.identification.timeline import PART, Timelines, initial_depth, initial_motion, measuring_sensors
from auvid_cli.vehicle.parameters import DEPTH, MOTION_SYMBOLS

Array = NDArray[np.float64]
Span = tuple[float, float]


def segments(dataset: Dataset) -> list[Dataset]:
    """The stretches of a dataset that its settings ask for, in time order; each has all sensors, some perhaps empty.

    Raises
    ------
    DataError
        If nothing is left, or the speed is asked for where nothing measures it.
    """
    use = dataset.experiment.identification.use
    return [_within(dataset, span) for span in used_spans(dataset, use)]


def the_only_segment(dataset: Dataset) -> Dataset:
    """The one stretch that is used.

    Raises
    ------
    DataError
        If there are several, or none.
    """
    found = segments(dataset)
    if len(found) > 1:
        raise DataError(f"one stretch of data is looked at here, and there are {len(found)}: name one with --use")
    return found[0]


class Stretch(NamedTuple):
    """A stretch of the data and where its motion starts.

    Attributes
    ----------
    timelines : Timelines
    measured : dict of float
        Motion and, where a sensor measures it, depth as measured by then, by symbol, SI.
    """

    timelines: Timelines
    measured: dict[str, float]

    @property
    def motion(self) -> Array:
        """The motion as measured by then, shape (9,)."""
        return np.array([self.measured[symbol] for symbol in MOTION_SYMBOLS])


def stretches(dataset: Dataset, part: int = PART) -> list[Stretch]:
    """Set out each of the `segments`, with the fins where they were.

    Parameters
    ----------
    dataset : Dataset
    part : int
        Most readings of one sensor that are worked on at once.
    """
    settings, measuring = dataset.experiment.identification, measuring_sensors(dataset)
    inputs = lagged(dataset.inputs, settings.fin_time_constant, settings.integration_step)
    found = []
    for data in segments(dataset):
        records = {name: data.sensors[name] for name in measuring}
        start, motion = initial_motion(data, records)
        measured = dict(zip(MOTION_SYMBOLS, motion.tolist(), strict=True))
        if "depth" in measuring:
            measured[DEPTH.symbol] = initial_depth(measuring["depth"], start)
        found.append(Stretch(Timelines(inputs, records, start, settings.integration_step, part), measured))
    return found


def used_part(dataset: Dataset) -> Dataset:
    """All that is used of a dataset, as one."""
    parts = segments(dataset)
    if len(parts) == 1:
        return parts[0]
    sensors = {
        name: SensorRecord(
            np.concatenate([part.sensors[name].time for part in parts]),
            np.concatenate([part.sensors[name].values for part in parts]),
            record.standard_deviation,
        )
        for name, record in dataset.sensors.items()
    }
    return replace(dataset, sensors=sensors)


def used_spans(dataset: Dataset, use: Use) -> list[Span]:
    """First and last time, s, of each stretch that is used."""
    measuring = measuring_sensors(dataset)
    everything = (
        min(float(record.time[0]) for record in measuring.values()),
        max(float(record.time[-1]) for record in measuring.values()),
    )
    if not use.spans and use.longest_gap is None and use.least_speed is None:
        return [everything]
    spans: list[Span] = sorted(use.spans) or [everything]
    if use.longest_gap is not None:
        for record in measuring.values():
            spans = _without(spans, _silences(record, use.longest_gap, everything))
    if use.least_speed is not None:
        if "dvl" not in measuring:
            raise DataError("identification.use.least_speed: no dvl measures the speed")
        spans = _without(spans, _slow(measuring["dvl"], use.least_speed))
    spans = [
        (max(begin, everything[0]), min(end, everything[1]))
        for begin, end in spans
        if min(end, everything[1]) - max(begin, everything[0]) >= use.shortest
    ]
    if not spans:
        raise DataError(
            f"identification.use leaves nothing of the data from t = {everything[0]:g} s to {everything[1]:g} s "
            f"that lasts {use.shortest:g} s"
        )
    return spans


def _within(dataset: Dataset, span: Span) -> Dataset:
    sensors = {}
    for name, record in dataset.sensors.items():
        own = slice(np.searchsorted(record.time, span[0]), np.searchsorted(record.time, span[1], side="right"))
        sensors[name] = SensorRecord(record.time[own], record.values[own], record.standard_deviation)
    return replace(dataset, sensors=sensors)


def _without(spans: Iterable[Span], holes: Iterable[Span]) -> list[Span]:
    """What is left of spans outside some holes, whose ends are not part of them."""
    left = list(spans)
    for hole_begin, hole_end in holes:
        cut = []
        for begin, end in left:
            if hole_end <= begin or end <= hole_begin:
                cut.append((begin, end))
            else:
                cut += [(begin, hole_begin)] * (begin <= hole_begin) + [(hole_end, end)] * (hole_end <= end)
        left = cut
    return left


def _silences(record: SensorRecord, longest: float, everything: Span) -> list[Span]:
    time = record.time[np.isfinite(record.values).any(axis=1)]
    ends = np.concatenate([everything[:1], time, everything[1:]])
    long = np.flatnonzero(np.diff(ends) > longest)
    return [(float(ends[i]), float(ends[i + 1])) for i in long]


def _slow(dvl: SensorRecord, least: float) -> list[Span]:
    """Where the surge velocity, smoothed over three readings against spikes, is too small."""
    known = np.isfinite(dvl.values[:, 0])
    time, surge = dvl.time[known], np.abs(dvl.values[known, 0])
    padded = np.concatenate([surge[:1], surge, surge[-1:]])
    is_slow = np.median(np.stack([padded[:-2], surge, padded[2:]]), axis=0) < least
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_slow, [False]]).astype(np.int8)))
    return [
        (float(time[first - 1]) if first else -np.inf, float(time[last]) if last < time.size else np.inf)
        for first, last in edges.reshape(-1, 2)
    ]
