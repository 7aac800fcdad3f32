"""Extended Kalman filter on filterpy."""

import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import cache, partial
from itertools import pairwise
from math import isfinite

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning

from auvid_cli.filters.problem import (
    OK,
    PREDICTION,
    FilterOutcome,
    Gaussian,
    OnChunk,
    Process,
    Records,
    Sensors,
    Timeline,
    empty_records,
    until,
)
from auvid_cli.filters.process_ekf import ProcessEkf
from auvid_cli.filters.stacked import Stack, is_definite

Array = NDArray[np.float64]

# Events between two checks that the covariance is positive definite, and those that are judged together.
_CHECK, _BLOCK = 50, 500
# Of an inverse or a factor: a matrix that is singular, not definite or not finite.
_BROKEN = (np.linalg.LinAlgError, ValueError)


class _Part:
    """A filter on a part of the data: what it says of several events is written down, then judged all together."""

    def __init__(self, ekf: ProcessEkf, sensors: Sensors, stack_of: Callable[..., Stack], timeline: Timeline) -> None:
        self._ekf, self._gate, self._stack_of, self._timeline = ekf, sensors.gate, stack_of, timeline
        self._records = empty_records(timeline, ekf.x.size)
        self._substeps, self._measurements = timeline.substep_offset.tolist(), timeline.measurement_offset.tolist()
        self._readings, self._width = timeline.measurement.reshape(-1), timeline.measurement.shape[1]
        elapsed, leads = np.zeros(timeline.time.size), np.diff(timeline.substep_offset) > 0
        if leads.any():
            elapsed[leads] = np.add.reduceat(timeline.substep_duration, timeline.substep_offset[:-1][leads])
        self._noise = np.outer(elapsed, ekf.density)
        missing = np.isnan(timeline.measurement)
        patterns = (missing @ (1 << np.arange(self._width))).tolist()
        self._kinds = list(zip(timeline.measurement_sensor.tolist(), patterns, strict=True))
        # Where a nonlinear sensor is linearised, and what is rejected of a measurement, depends on those before it.
        self._holds = bool(sensors.nonlinear.any())
        spans = pairwise(self._measurements)
        if self._holds or self._gate < np.inf:
            together = ([(k, k + 1) for k in range(*span)] for span in spans)
        else:
            together = ([span] if span[0] < span[1] else [] for span in spans)
        # By event: stacks, each with its first measurement.
        self._heard = [[(stack_of(tuple(self._kinds[k:end])), k) for k, end in event] for event in together]
        # By stack: first measurement, innovation and its covariance of every update that is not judged yet.
        self._said: defaultdict[Stack, list[tuple[int, Array, Array]]] = defaultdict(list)

    def goes_well(self, first: int, last: int) -> bool:
        """Filter some events; whether all that comes of them is sound."""
        self._records.nis[self._measurements[first] : self._measurements[last]] = 0.0
        try:
            for event in range(first, last):
                self._predict(event)
                for stack, k in self._heard[event]:
                    self._update(self._accepted(stack, k), k)
                self._note(event)
                if event % _CHECK == 0 and not is_definite(self._ekf.P):
                    return False
            self._judge()
        except _BROKEN:
            return False
        return self._is_sound(first, last) and is_definite(self._ekf.P)

    def failure_at(self, event: int) -> int:
        """Filter one event and judge after every step; what failed, or `OK`."""
        ekf, sensor = self._ekf, PREDICTION
        self._predict(event)
        for every, k in self._heard[event]:
            stack = self._accepted(every, k)
            self._records.nis[k : k + every.size] = 0.0
            try:
                self._update(stack, k)
                self._judge()
            except _BROKEN:
                self._forget(k, k + every.size)
                return stack.first_broken(ekf.y, ekf.S) if ekf.was_sound() else PREDICTION
            sensor = stack.sensors[-1] if stack.sensors else sensor
        self._note(event)
        if not self._is_sound(event, event + 1):
            return sensor
        return OK if is_definite(ekf.P) else PREDICTION

    def forget(self, first: int, last: int) -> None:
        """Take back what was said of some events."""
        self._forget(self._measurements[first], self._measurements[last])

    def until(self, n_good: int) -> Records:
        """Return what was said of the events that went well, and of the measurements at the one after these."""
        return until(self._records, n_good, self._measurements[min(n_good + 1, len(self._noise))])

    def _forget(self, first: int, last: int) -> None:
        self._said.clear()
        for of_measurements in (self._records.nis, self._records.innovation, self._records.innovation_variance):
            of_measurements[first:last] = np.nan

    def _predict(self, event: int) -> None:
        first, last = self._substeps[event], self._substeps[event + 1]
        t = self._timeline
        if first < last:
            self._ekf.move(t.inputs, t.substep_input[first:last], t.substep_duration[first:last], self._noise[event])
        if self._holds:
            self._ekf.hold(t.inputs[t.event_input[event]])

    def _accepted(self, stack: Stack, k: int) -> Stack:
        """Return what a gate leaves of a measurement."""
        if self._gate == np.inf or not stack.sensors:
            return stack
        innovation, rejected = self._ekf.outside_gate(self._gate, stack, self._reading(stack, k))
        self._records.innovation[k, stack.places] = innovation
        sensor, missing = self._kinds[k]
        components = np.arange(self._width)[stack.places][rejected]
        return self._stack_of(((sensor, missing | int((1 << components).sum())),))

    def _reading(self, stack: Stack, k: int) -> Array:
        return self._readings[k * self._width : (k + stack.size) * self._width][stack.places]

    def _update(self, stack: Stack, k: int) -> None:
        if stack.sensors:
            self._ekf.update_with(stack, self._reading(stack, k))
            self._said[stack].append((k, self._ekf.y, self._ekf.S))

    def _note(self, event: int) -> None:
        self._records.mean[event] = self._ekf.x
        # The square root is taken of all at once.
        self._records.standard_deviation[event] = self._ekf.P.diagonal()

    def _judge(self) -> None:
        """Write down the innovations of all updates since the last time, stack by stack.

        Raises
        ------
        numpy.linalg.LinAlgError
            If one has no positive, finite covariance.
        """
        for stack, said in self._said.items():
            first, y, covariance = zip(*said, strict=True)
            shape = len(said), stack.noise.shape[0]
            innovation, variance, nis = stack.one_by_one(
                np.concatenate(y).reshape(shape), np.concatenate(covariance).reshape(*shape, -1)
            )
            if not isfinite(nis.sum()):
                raise np.linalg.LinAlgError("an innovation is not finite")
            begin = np.array(first)[:, None]
            places = begin * self._width + np.arange(stack.size * self._width)[stack.places]
            self._records.innovation.reshape(-1)[places] = innovation
            self._records.innovation_variance.reshape(-1)[places] = variance
            self._records.nis[begin + stack.measurements] = nis
        self._said.clear()

    def _is_sound(self, first: int, last: int) -> bool:
        """Say whether the states are finite, and the variances finite and positive."""
        variance = self._records.standard_deviation[first:last]
        sound = isfinite(self._records.mean[first:last].sum() + variance.sum()) and variance.min() > 0.0
        np.sqrt(variance, out=variance)
        return sound


def run_extended_filter(
    process: Process, sensors: Sensors, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk
) -> FilterOutcome:
    """Filter data with the EKF; arguments and result as of `run_square_root_filter`.

    Sabet et al. 2018, Table A1. A measurement with missing components is shortened to the rest:
    filterpy's ``update(None)`` would skip all of it.
    """
    ekf = ProcessEkf(process, prior)
    stack_of = cache(partial(Stack, sensors))
    n_good, failure = 0, OK
    with np.errstate(all="ignore"), warnings.catch_warnings():
        # What overflows or is nearly singular is judged afterwards, and reported as divergence.
        warnings.simplefilter("ignore", LinAlgWarning)
        for timeline in timelines:
            part = _Part(ekf, sensors, stack_of, timeline)
            n_sound, failure = _run(ekf, part, timeline.time.size)
            on_chunk(timeline, part.until(n_sound))
            n_good += n_sound
            if failure != OK:
                break
    return FilterOutcome(ekf.P, n_good, failure)


def _run(ekf: ProcessEkf, part: _Part, n_events: int) -> tuple[int, int]:
    """Filter a part up to the last good state; how many events that are, and what failed after them, or `OK`."""
    for first in range(0, n_events, _BLOCK):
        last = min(first + _BLOCK, n_events)
        before = ekf.x.copy(), ekf.P
        if part.goes_well(first, last):
            continue
        # Once more, event by event, to find what failed.
        part.forget(first, last)
        ekf.start_from(*before)
        for event in range(first, last):
            before = ekf.x.copy(), ekf.P
            failure = part.failure_at(event)
            if failure != OK:
                ekf.start_from(*before)
                return event, failure
    return n_events, OK
