"""Data prepared for a filter: sensors and segments chosen, delays corrected, events in time order."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array, release_memory
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import FURTHER_STATES
from auvid_cli.config.identification import Identification, Use
from auvid_cli.data.acting_inputs import as_acting
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.data.signals import longer_intervals
from auvid_cli.errors import DataError
from auvid_cli.identification.timeline import Timelines, initial_motion, measuring_sensors, value_at_start
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

Span = tuple[float, float]


class FoundDelays(NamedTuple):
    """Estimated delays, SI. They shift times and are therefore not states of a filter."""

    symbols: tuple[str, ...]
    value: Array  # shape (d,); s
    covariance: Array  # shape (d, d); s^2
    effect: Array  # shape (n_parameters, d); derivative of the estimated parameters by the delays, SI per second

    @property
    def deviation(self) -> Array:
        """Return the standard deviations, s, shape (d,)."""
        return np.sqrt(np.diagonal(self.covariance))

    def along(self, mean: Array, deviation: Array) -> tuple[Array, Array]:
        """Append the delays to states, and add their uncertainty to that of the parameters.

        Parameters
        ----------
        mean, deviation : ndarray, shape (n, states)

        Returns
        -------
        mean, deviation : ndarray, shape (n, states + d)
        """
        n, parameters, wider = len(mean), slice(0, len(self.effect)), deviation.copy()
        wider[:, parameters] = self.widened(deviation[:, parameters])
        return np.hstack([mean, np.tile(self.value, (n, 1))]), np.hstack([wider, np.tile(self.deviation, (n, 1))])

    def widened(self, deviation: Array) -> Array:
        """Return standard deviations of the parameters, shape (..., n_parameters), with the delays' uncertainty."""
        effect = self.effect[: deviation.shape[-1]]
        return np.sqrt(deviation**2 + np.einsum("if,fg,ig->i", effect, self.covariance, effect))

    def joint(self, covariance: Array) -> Array:
        """Return the joint covariance of a state, parameters first, and the delays."""
        n, effect = len(covariance), np.zeros((len(covariance), len(self.symbols)))
        effect[: len(self.effect)] = self.effect
        whole = np.zeros((n + len(self.symbols),) * 2)
        whole[:n, :n] = covariance + effect @ self.covariance @ effect.T
        whole[:n, n:] = effect @ self.covariance
        whole[n:, :n] = whole[:n, n:].T
        whole[n:, n:] = self.covariance
        return whole


def used_data(dataset: Dataset) -> Dataset:
    """Return a dataset with the used segments alone."""
    segments = used_segments(dataset, measuring_sensors(dataset))
    if len(segments) == 1:
        return segments[0]
    sensors = {}
    for name, record in dataset.sensors.items():
        cut = [segment.sensors[name] for segment in segments]
        time, values = (np.concatenate([getattr(record, of) for record in cut]) for of in ("time", "values"))
        sensors[name] = replace(record, time=time, values=values)
    return replace(dataset, sensors=sensors)


def used_segments(dataset: Dataset, measuring: Mapping[str, SensorRecord]) -> list[Dataset]:
    """Return the used segments of a dataset; see `used_spans`."""
    spans = used_spans(measuring, dataset.experiment.identification.use)
    return [dataset.sensors_between(*span) for span in spans]


def used_spans(measuring: Mapping[str, SensorRecord], use: Use) -> list[Span]:
    """Return the first and last time, s, of each used segment, in time order.

    Raises
    ------
    DataError
        If no segment remains, or settings limit the speed without a DVL.
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
            raise DataError("identification.use.least_speed: no sensor measures the speed; expected a dvl")
        spans = _without(spans, _slow(measuring["dvl"], use.least_speed))
    spans = [
        (max(begin, everything[0]), min(end, everything[1]))
        for begin, end in spans
        if min(end, everything[1]) - max(begin, everything[0]) >= use.shortest
    ]
    if not spans:
        raise DataError(
            f"identification.use leaves no segment of at least {use.shortest:g} s of the data from "
            f"t = {everything[0]:g} s to {everything[1]:g} s"
        )
    return spans


def _without(spans: Iterable[Span], holes: Iterable[Span]) -> list[Span]:
    """Return spans without open intervals."""
    remaining = list(spans)
    for hole_begin, hole_end in holes:
        cut = []
        for begin, end in remaining:
            if hole_end <= begin or end <= hole_begin:
                cut.append((begin, end))
            else:
                cut += [(begin, hole_begin)] * (begin <= hole_begin) + [(hole_end, end)] * (hole_end <= end)
        remaining = cut
    return remaining


def _silences(record: SensorRecord, longest: float, everything: Span) -> list[Span]:
    ends = np.concatenate([everything[:1], record.measured_times, everything[1:]])
    return [(begin, end) for begin, end in longer_intervals(ends, longest).tolist()]


def _slow(dvl: SensorRecord, least: float) -> list[Span]:
    """Return intervals in which the surge velocity, as the median of three measurements, is too small."""
    known = np.isfinite(dvl.values[:, 0])
    time, surge = dvl.time[known], np.abs(dvl.values[known, 0])
    padded = np.concatenate([surge[:1], surge, surge[-1:]])
    is_slow = np.median(np.stack([padded[:-2], surge, padded[2:]]), axis=0) < least
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_slow, [False]]).astype(np.int8)))
    return [
        (float(time[first - 1]) if first else -np.inf, float(time[last]) if last < time.size else np.inf)
        for first, last in edges.reshape(-1, 2)
    ]


class Segment(NamedTuple):
    """A used segment of the data and its initial motion."""

    dataset: Dataset  # samples of all sensors within the segment
    timelines: Timelines  # measurements of the sensors in use, and acting inputs
    measured: dict[str, float]  # first measurements of motion and depth by symbol, SI

    @property
    def motion(self) -> Array:
        """Return the measured initial motion, shape (9,), SI."""
        return np.array([self.measured[symbol] for symbol in MOTION_SYMBOLS])


@dataclass(frozen=True)
class PreparedData:
    """The part of a dataset that filters use."""

    dataset: Dataset
    measuring: dict[str, SensorRecord]  # the sensors in use by name, with all of their samples
    segments: tuple[Segment, ...]  # at least one, in time order
    delays: FoundDelays | None = None  # estimated delays, which the settings then state

    @property
    def experiment(self) -> RunSettings:
        """Return the settings for which the data are prepared."""
        return self.dataset.experiment

    def with_settings(self, experiment: RunSettings) -> "PreparedData":
        """Return the data prepared for other settings; segments and events are kept if these settings permit."""
        if _preparation_settings(experiment) != _preparation_settings(self.experiment):
            return prepare(self.dataset.with_settings(experiment))
        segments = tuple(s._replace(dataset=s.dataset.with_settings(experiment)) for s in self.segments)
        return replace(self, dataset=self.dataset.with_settings(experiment), segments=segments)

    def with_identification(self, **changes: object) -> "PreparedData":
        """Return the data prepared for other settings below `identification`."""
        return self.with_settings(self.experiment.with_identification(**changes))


def prepare(dataset: Dataset) -> PreparedData:
    """Choose sensors and segments by the settings, and merge the samples of each segment in time order.

    Raises
    ------
    DataError
        If no sensor measures motion, an input of the vehicle's own terms is missing, a sensor states no positive noise,
        or no segment remains.
    """
    settings = dataset.experiment.identification
    dataset.inputs.check_for(dataset.experiment.vehicle.coefficient_set)
    on_time = replace(dataset, sensors=corrected_records(dataset.sensors, settings))
    measuring, inputs = measuring_sensors(on_time), as_acting(dataset.inputs, dataset.experiment)
    segments = []
    for data in used_segments(on_time, measuring):
        records = {name: data.sensors[name] for name in measuring}
        start, motion = initial_motion(data, records)
        measured = dict(zip(MOTION_SYMBOLS, motion.tolist(), strict=True))
        for state in FURTHER_STATES:
            if state.sensor in measuring:
                measured[state.quantity.symbol] = value_at_start(measuring[state.sensor], start)
        segments.append(Segment(data, Timelines(inputs, records, start, settings.integration_step), measured))
        release_memory()
    return PreparedData(dataset, measuring, tuple(segments))


def corrected_records(sensors: dict[str, SensorRecord], settings: Identification) -> dict[str, SensorRecord]:
    """Return records with time stamps corrected by the delays of the settings."""
    return {
        name: replace(record, time=record.time - settings.delays[name]) if name in settings.delays else record
        for name, record in sensors.items()
    }


def _preparation_settings(experiment: RunSettings) -> tuple[object, ...]:
    """Return the settings on which segments and events depend."""
    settings = experiment.identification
    moved = settings.inputs, settings.delays, experiment.vehicle.actuators, settings.integration_step
    return settings.attitude_from, settings.use, settings.measurement_noise, *moved
