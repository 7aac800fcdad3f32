"""Measurements of all sensors merged into events in time order, chunk by chunk; nothing is resampled."""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array, release_memory, wrap
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord, shared_clock
from auvid_cli.errors import DataError
from auvid_cli.filters.problem import Indices, Sensors, Timeline
from auvid_cli.identification.states import StateLayout
from auvid_cli.vehicle.parameters import COMPASSES, MOTION_SYMBOLS, SENSORS, state_of
from auvid_cli.vehicle.rigid_body import GRAVITY, body_to_earth

# Times in whole nanoseconds.
Ticks = NDArray[np.int64]

_FORCES = tuple(quantity.symbol for quantity in SENSORS["accelerometer"])
_FIELDS = tuple(quantity.symbol for quantity in SENSORS["magnetic_field"])
# Angles, whose innovations are wrapped to [-pi, pi).
_ANGULAR = ("phi", "theta", "psi")
_NANOSECOND = 1e-9  # s
MAX_GAP = 1000.0  # s, without any measurement
# Largest number of measurements of one sensor in a chunk: some 15 ms of work for a sigma-point filter.
CHUNK = 2000


def measuring_sensors(dataset: Dataset) -> dict[str, SensorRecord]:
    """Return the records that estimators use: those with a valid sample that settings do not exclude.

    These are the sensors of motion states and of the depth. With ``attitude_from: inertial``, accelerometer and
    magnetometer (of one axis or three) replace the attitude.

    Raises
    ------
    DataError
        If there is none, an inertial one is missing, or one states no positive noise.
    """
    is_inertial = dataset.experiment.identification.attitude_from == "inertial"
    unused = dataset.experiment.identification.unused_sensors
    measuring = {}
    for name, record in dataset.sensors.items():
        if name not in unused and record.present.any():
            if not (record.standard_deviation > 0.0).all():
                raise DataError(f"sensor {name}: the standard deviation must be greater than 0 for a filter")
            factor = dataset.experiment.identification.measurement_noise.get(name, 1.0)
            measuring[name] = replace(record, standard_deviation=factor * record.standard_deviation)
    if is_inertial and not ("accelerometer" in measuring and any(name in measuring for name in COMPASSES)):
        missing = "accelerometer" if "accelerometer" not in measuring else " or ".join(COMPASSES)
        raise DataError(
            f"identification.attitude_from: inertial: the dataset has no valid sample of {missing}; expected "
            "accelerometer and magnetometer"
        )
    if not measuring:
        raise DataError("the dataset has no valid sample of a motion sensor (dvl, gyroscope, attitude)")
    return measuring


def measurement_model(
    measuring: dict[str, SensorRecord], layout: StateLayout, gate: float, threshold: float
) -> Sensors:
    """Return the matrix that selects measured states and additive errors, Sabet et al. 2018, eq. (14), and the noise.

    Parameters
    ----------
    measuring : dict of SensorRecord
    layout : StateLayout
        A sensor is nonlinear if it has an error that is not additive, or measures a quantity that is not a state.
    gate : float
        Largest innovation that is used, in standard deviations.
    threshold : float
        Largest residual with full weight, in standard deviations.

    Raises
    ------
    DataError
        If the sensor of an error is not in use.
    """
    width = max(record.values.shape[1] for record in measuring.values())
    matrix = np.zeros((len(measuring), width, len(layout.symbols)))
    variance = np.ones((len(measuring), width))
    angular = np.zeros((len(measuring), width), dtype=np.bool_)
    nonlinear = np.zeros(len(measuring), dtype=np.bool_)
    for sensor, (name, record) in enumerate(measuring.items()):
        for component, quantity in enumerate(SENSORS[name]):
            symbol = state_of(quantity)
            row = layout.row(symbol)
            if row is None:
                nonlinear[sensor] = True
            else:
                matrix[sensor, component, row] = 1.0
            variance[sensor, component] = record.standard_deviation[component] ** 2
            angular[sensor, component] = symbol in _ANGULAR
    for block in layout.blocks:
        if block.error is None or block.error.sensor is None:
            continue
        if block.error.sensor not in measuring:
            raise DataError(
                f"identification.estimate.biases: {block.quantities[0].symbol} needs {block.error.sensor}, of which "
                "the dataset has no valid sample"
            )
        sensor = list(measuring).index(block.error.sensor)
        if block.error.additive:
            rows = layout.rows_of(block.name)
            matrix[sensor, :, rows][: len(block.quantities)] = np.eye(len(block.quantities))
        else:
            nonlinear[sensor] = True
    return Sensors(matrix, variance, angular, nonlinear, gate**2, threshold)


def initial_motion(dataset: Dataset, measuring: dict[str, SensorRecord]) -> tuple[float, Array]:
    """Return the start time of a filter, when every sensor has measured, and the last measurements by then.

    Returns
    -------
    time : float
        s, not before the first input.
    motion : ndarray, shape (9,)
        SI; zero for a state that no sensor measures. Roll and pitch follow from gravity if an accelerometer is used.
    """
    finite = [record.present for record in measuring.values()]
    # Components that a sensor never measures are ignored.
    complete = [rows[:, rows.any(axis=0)].all(axis=1) & rows.any(axis=1) for rows in finite]
    firsts = [record.time[rows] for record, rows in zip(measuring.values(), complete, strict=True)]
    start = max([float(dataset.inputs.time[0]), *(float(times[0]) for times in firsts if times.size)])
    motion = dict.fromkeys((*MOTION_SYMBOLS, *_FORCES, *_FIELDS), 0.0) | {_FORCES[2]: -GRAVITY}
    for name, record in measuring.items():
        past = np.searchsorted(record.time, start, side="right")
        for component, quantity in enumerate(SENSORS[name]):
            symbol, values = state_of(quantity), record.values[:past, component]
            measured = values[np.isfinite(values)]
            if measured.size and symbol in motion:
                motion[symbol] = float(measured[-1])
    values = np.array([motion[symbol] for symbol in MOTION_SYMBOLS])
    if "accelerometer" in measuring:
        values[6:8] = _levelled(np.array([motion[symbol] for symbol in _FORCES]), values)
    if "magnetic_field" in measuring and "magnetometer" not in measuring:
        field = np.array([motion[symbol] for symbol in _FIELDS])
        values[8] = _heading(field, values[6:8], np.array(measuring["magnetic_field"].earth_field))
    return start, values


def _levelled(force: Array, motion: Array) -> tuple[float, float]:
    """Return roll and pitch, rad, from the specific force of a vehicle at constant velocity in body axes."""
    x, y, z = np.cross(motion[3:6], motion[:3]) - force
    return float(np.arctan2(y, z)), float(np.arctan2(-x, np.hypot(y, z)))


def _heading(field: Array, tilt: Array, earth: Array) -> float:
    """Return the yaw, rad, for which the horizontal part of a measured field has the direction of the earth's."""
    ahead, aside, _ = body_to_earth(np.append(tilt, 0.0)[None], field[None])[0]
    return float(wrap(np.arctan2(earth[1], earth[0]) - np.arctan2(aside, ahead)))


def value_at_start(record: SensorRecord, start: float) -> float:
    """Return the last value of a one-component sensor by a start time, s; its first value if there is none."""
    time, measured = (values[np.isfinite(record.values[:, 0])] for values in (record.time, record.values[:, 0]))
    return float(measured[max(np.searchsorted(time, start, side="right") - 1, 0)])


class Timelines:
    """All measurements from a start on, merged chunk by chunk in each iteration.

    Parameters
    ----------
    inputs : InputRecord
        Constant from each of their times to the next.
    measuring : dict of SensorRecord
    start : float
        s.
    step : float
        Longest substep of integration, s. Times are compared in whole nanoseconds, so that equal times of two clocks
        are one event.
    chunk : int
        Largest number of measurements of one sensor in a chunk; it limits the memory of a long run.

    Attributes
    ----------
    span : tuple of float
        First and last time, s.
    chunk : int
        Largest number of measurements of one sensor in a chunk.

    Raises
    ------
    DataError
        If there is no measurement after the start, or the inputs end long before the measurements.
    """

    def __init__(
        self, inputs: InputRecord, measuring: dict[str, SensorRecord], start: float, step: float, chunk: int = CHUNK
    ) -> None:
        self.span = start, float(max(record.measured_times.max(initial=-np.inf) for record in measuring.values()))
        begin, end = _nanoseconds(np.array(self.span))
        if end < begin:
            raise DataError(
                f"no measurement at or after t = {start:g} s, the first time at which inputs and all sensors have data"
            )
        self._records = tuple(measuring.values())
        self._inputs = np.ascontiguousarray(inputs.values)
        self._changes = _nanoseconds(inputs.time)
        self._ticks: list[NDArray[np.int64]] = []
        for record in self._records:
            self._ticks.append(shared_clock(_nanoseconds(record.time), (self._changes, *self._ticks)))
        if inputs.ends_before(self.span[1]):
            raise DataError(
                f"inputs end at t = {inputs.time[-1]:g} s, measurements at t = {self.span[1]:g} s; cut the "
                "measurements (--use) or extend the inputs"
            )
        self._step, self.chunk = step, chunk

    def input_rate(self, first: int = 0, last: int | None = None) -> Array:
        """Return the time derivative of the rows `first` to before `last` of the inputs, SI per second."""
        last = len(self._inputs) if last is None else last
        before = max(first - 1, 0)
        inputs, time = self._inputs[before : last + 1], self._changes[before : last + 1] * _NANOSECOND
        rate = np.gradient(inputs, time, axis=0) if time.size > 1 else np.zeros_like(inputs)
        return rate[first - before : last - before]

    def in_chunks_of(self, n: int) -> "Timelines":
        """Return the same measurements with at most `n` of one sensor in a chunk."""
        other = copy(self)
        other.chunk = n
        return other

    def between(self, begin: float, end: float) -> "Timelines":
        """Return the measurements from `begin` to `end`, s, both included and within the span."""
        other = copy(self)
        other.span = begin, end
        return other

    def __iter__(self) -> Iterator[Timeline]:
        before = self._span_ticks[0]
        for since, until in pairwise(self._cuts()):
            merged = self._merged(since, until)
            if merged.events.size:
                yield self._timeline(before, merged)
                before = merged.events[-1]
            release_memory()

    def __reversed__(self) -> Iterator[Timeline]:
        later: _Merged | None = None
        for until, since in pairwise(self._cuts()[::-1]):
            merged = self._merged(since, until)
            if merged.events.size:
                if later is not None:
                    yield self._timeline(merged.events[-1], later)
                later = merged
            release_memory()
        if later is not None:
            yield self._timeline(self._span_ticks[0], later)

    @property
    def _span_ticks(self) -> Ticks:
        return _nanoseconds(np.array(self.span))

    def _cuts(self) -> Ticks:
        """Return the boundaries of the chunks."""
        begin, end = self._span_ticks
        used = [ticks[slice(*np.searchsorted(ticks, [begin + 1, end + 1]))] for ticks in self._ticks]
        return np.unique(np.concatenate([[begin, end + 1], *(ticks[self.chunk :: self.chunk] for ticks in used)]))

    def _merged(self, since: np.int64, until: np.int64) -> "_Merged":
        spans = [slice(*np.searchsorted(ticks, [since, until])) for ticks in self._ticks]
        return _merge(self._records, self._ticks, spans)

    def _timeline(self, before: np.int64, merged: "_Merged") -> Timeline:
        """Return a chunk after the event `before`."""
        substeps = _substeps(self._changes, before, merged.events, self._step)
        time, held = merged.events.astype(np.float64) * _NANOSECOND, _held(self._changes, merged.events)
        return Timeline(time, *substeps, self._inputs, held, *merged[1:])


class _Merged(NamedTuple):
    """Merged measurements of a chunk."""

    events: Ticks
    measurement_offset: Indices  # measurements of each event, as in `Timeline`
    measurement_sensor: NDArray[np.int8]
    measurement: Array


def _merge(records: Sequence[SensorRecord], times: Sequence[Ticks], spans: Sequence[slice]) -> _Merged:
    """Return the merged measurements of the rows `spans` of each record."""
    ticks, values = [], []
    width = max(record.values.shape[1] for record in records)
    for record, time, span in zip(records, times, spans, strict=True):
        padded = np.full((span.stop - span.start, width), np.nan)
        padded[:, : record.values.shape[1]] = record.values[span]
        padded[~np.isfinite(padded)] = np.nan
        used = ~np.isnan(padded).all(axis=1)
        ticks.append(time[span][used])
        values.append(padded[used])
    tick = np.concatenate(ticks)
    # Stable: at equal times the sensors keep their order.
    order = np.argsort(tick, kind="stable")
    sensor = np.repeat(np.arange(len(ticks), dtype=np.int8), [times.size for times in ticks])
    events, first_measurement = np.unique(tick[order], return_index=True)
    return _Merged(events, np.append(first_measurement, tick.size), sensor[order], np.concatenate(values)[order])


def _substeps(changes: Ticks, before: np.int64, events: Ticks, step: float) -> tuple[Indices, Array, Indices]:
    """Return the substeps between events: offset of each event's substeps, durations in s, and rows of the inputs."""
    inside = slice(*np.searchsorted(changes, [before + 1, events[-1]]))
    # Two sorted runs are merged at once; np.unique takes twenty times as long.
    cuts = np.sort(np.concatenate([[before], events, changes[inside]]), kind="stable")
    cuts = cuts[np.append(True, cuts[1:] > cuts[:-1])]
    gaps = np.diff(cuts)
    if gaps.size and gaps.max() * _NANOSECOND > MAX_GAP:
        k = int(gaps.argmax())
        raise DataError(
            f"no measurement from t = {cuts[k] * _NANOSECOND:.6g} s to {cuts[k + 1] * _NANOSECOND:.6g} s; expected "
            f"gaps of at most {MAX_GAP:g} s; split the data there (identification.use.longest_gap)"
        )
    n_substeps = np.maximum(np.ceil(gaps * _NANOSECOND / step - 1e-6).astype(np.int64), 1)
    held = _held(changes, cuts[:-1])
    substeps_before_cut = np.append(0, np.cumsum(n_substeps))
    offset = np.append(0, substeps_before_cut[np.searchsorted(cuts, events)])
    return offset, np.repeat(gaps * _NANOSECOND / n_substeps, n_substeps), np.repeat(held, n_substeps)


def _held(changes: Ticks, times: Ticks) -> Indices:
    """Return the row of the inputs that holds from each time on; the first row for earlier times."""
    return np.maximum(np.searchsorted(changes, times, side="right") - 1, 0)


def _nanoseconds(time: Array) -> Ticks:
    return np.rint(time / _NANOSECOND).astype(np.int64)
