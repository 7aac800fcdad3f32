"""Which segments of the data are used; each of them starts anew."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.identification import Use
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.gaps import longer_intervals
from auvid_cli.errors import DataError
from auvid_cli.identification.timeline import measuring_sensors

Array = NDArray[np.float64]
Span = tuple[float, float]


def used_data(dataset: Dataset) -> Dataset:
    """Return all that is used of a dataset, as one."""
    segments = used_segments(dataset, measuring_sensors(dataset))
    sensors = {}
    for name, record in dataset.sensors.items():
        cut = [segment.sensors[name] for segment in segments]
        time, values = (np.concatenate([getattr(record, of) for record in cut]) for of in ("time", "values"))
        sensors[name] = replace(record, time=time, values=values)
    return replace(dataset, sensors=sensors)


def used_segments(dataset: Dataset, measuring: Mapping[str, SensorRecord]) -> list[Dataset]:
    """Return what is used of a dataset, a segment each; see `used_spans`."""
    spans = used_spans(measuring, dataset.experiment.identification.use)
    return [dataset.sensors_between(*span) for span in spans]


def used_spans(measuring: Mapping[str, SensorRecord], use: Use) -> list[Span]:
    """Return the first and last time, s, of each segment that is used, in time order.

    Raises
    ------
    DataError
        If nothing is left, or the speed is asked for where nothing measures it.
    """
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


def _without(spans: Iterable[Span], holes: Iterable[Span]) -> list[Span]:
    """Cut holes, whose ends are not part of them, out of spans."""
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
    ends = np.concatenate([everything[:1], record.measured_times, everything[1:]])
    return [(begin, end) for begin, end in longer_intervals(ends, longest).tolist()]


def _slow(dvl: SensorRecord, least: float) -> list[Span]:
    """Find where the surge velocity, smoothed over three measurements against spikes, is too small."""
    known = np.isfinite(dvl.values[:, 0])
    time, surge = dvl.time[known], np.abs(dvl.values[known, 0])
    padded = np.concatenate([surge[:1], surge, surge[-1:]])
    is_slow = np.median(np.stack([padded[:-2], surge, padded[2:]]), axis=0) < least
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_slow, [False]]).astype(np.int8)))
    return [
        (float(time[first - 1]) if first else -np.inf, float(time[last]) if last < time.size else np.inf)
        for first, last in edges.reshape(-1, 2)
    ]
