"""Extended Kalman filter on filterpy, with the measurements of one instant stacked."""

import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import cache, partial
from itertools import pairwise
from math import isfinite, pi

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning
from scipy.linalg.lapack import dpotrf  # pyright: ignore[reportAttributeAccessIssue]

from auvid_cli.angles import wrap
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
    truncate,
)

Array = NDArray[np.float64]
# A sensor, and what its measurement lacks: bit c for component c.
Kind = tuple[int, int]
# Events between two checks that the covariance is positive definite, and those that are judged together.
_CHECK, _BLOCK = 50, 500
# Of an inverse or a factor: a matrix that is singular, not definite or not finite.
_BROKEN = (np.linalg.LinAlgError, ValueError)


class Stack:
    """What does not change between measurements of the same sensors with the same components missing.

    Parameters
    ----------
    sensors : Sensors
    kinds : tuple of (int, int)
        One nonlinear sensor, or any number of linear ones; each with what its measurement lacks.

    Attributes
    ----------
    width, size : int
        Most components of a sensor, and how many measurements there are.
    sensors, measurements : list of int
        Sensors that say anything, and the places of their measurements in the stack.
    begins : ndarray of int
        Where the components of each of them begin.
    places : slice or ndarray of int
        Of the components that are present, in measurements laid end to end.
    nonlinear : bool
    matrix, noise : ndarray
        Measurement matrix and noise covariance.
    """

    def __init__(self, sensors: Sensors, kinds: tuple[Kind, ...]) -> None:
        self.width, self.size = width, _ = sensors.variance.shape[1], len(kinds)
        present = [(k, c) for k, (_, missing) in enumerate(kinds) for c in range(width) if not missing >> c & 1]
        of_measurement = np.array([k for k, _ in present], dtype=np.int64)
        self.measurements = np.unique(of_measurement).tolist()
        self.sensors = [kinds[k][0] for k in self.measurements]
        self.begins = np.searchsorted(of_measurement, self.measurements)
        self._same_measurement = np.equal.outer(of_measurement, of_measurement).astype(np.float64)
        # A slice is several times faster than a list of places.
        places = [k * width + c for k, c in present]
        self.places = slice(len(places)) if places == list(range(len(places))) else np.array(places)
        rows = [kinds[k][0] for k, _ in present], [c for _, c in present]
        self.nonlinear = any(sensors.nonlinear[sensor] for sensor in self.sensors)
        self.matrix = sensors.matrix[rows]
        self.noise = np.diag(sensors.variance[rows])
        self._angular = np.flatnonzero(sensors.angular[rows]).tolist()

    def derivative(self, state: Array) -> Array:
        """Return the measurement matrix of linear sensors, whatever the state is."""
        return self.matrix

    def residual(self, measurement: Array, predicted: Array) -> Array:
        """Subtract the components present, angles wrapped to [-pi, pi)."""
        difference = measurement - predicted
        for component in self._angular:
            angle = difference.item(component)
            # Wrapping is a dozen times as slow as seeing that there is nothing to wrap.
            if not -pi <= angle < pi:
                difference[component] = wrap(angle)
        return difference

    def one_by_one(self, innovation: Array, covariance: Array) -> tuple[Array, Array, Array]:
        """Find what the innovations would have been, had the measurements been used one after the other.

        With the factor L of their covariance, L^-1 y is white, and its part of a measurement is what this says beyond
        those before; the diagonal block of L carries it back to the units of the measurement.

        Parameters
        ----------
        innovation : ndarray, shape (k, m)
            At k times.
        covariance : ndarray, shape (k, m, m)
            Of each.

        Returns
        -------
        innovation, variance : ndarray, shape (k, m)
        nis : ndarray, shape (k, n)
            Normalised innovation squared of each of the n `sensors`.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a covariance is not positive definite.
        """
        factor = np.linalg.cholesky(covariance)
        white = np.zeros_like(innovation)
        for i in range(innovation.shape[1]):
            explained = np.einsum("kj,kj->k", factor[:, i, :i], white[:, :i])
            white[:, i] = (innovation[:, i] - explained) / factor[:, i, i]
        alone = factor * self._same_measurement
        variance = np.einsum("kij,kij->ki", alone, alone)
        return np.einsum("kij,kj->ki", alone, white), variance, np.add.reduceat(white**2, self.begins, axis=1)

    def first_broken(self, innovation: Array, covariance: Array) -> int:
        """Find the first of `sensors` up to which innovations are not finite or not definite; else the last."""
        ends = [*self.begins[1:], len(covariance)]
        whole = (np.isfinite(innovation[:end]).all() and is_definite(covariance[:end, :end]) for end in ends)
        return next((s for s, sound in zip(self.sensors, whole, strict=True) if not sound), self.sensors[-1])


def is_definite(covariance: Array) -> bool:
    """Say whether a matrix is positive definite, each row judged by its own size."""
    # Scaled to unit diagonal first, so that rounding is judged against each state's own size.
    scale = 1.0 / np.sqrt(np.diagonal(covariance))
    _, failed = dpotrf(covariance * np.outer(scale, scale), lower=True)
    return not failed


class ProcessEkf(ExtendedKalmanFilter):
    """filterpy's filter with the mean moved by the process instead of by F.

    The state is a vector, not filterpy's default column: a column with a 1-d measurement broadcasts
    to a matrix without an error.
    """

    def __init__(self, process: Process, gaussian: Gaussian) -> None:
        n = gaussian.mean.size
        super().__init__(dim_x=n, dim_z=1)
        self.x = gaussian.mean.copy()
        self.P = gaussian.factor @ gaussian.factor.T
        self.F = np.eye(n)
        self.Q = np.zeros((n, n))
        self._process = process
        self.density = process.noise_density**2
        # A view of the moving part of the diagonal.
        self._noise = self.Q.reshape(-1)[-1 - (process.noise_density.size - 1) * (n + 1) :: n + 1]
        self._scratch = np.zeros(process.scratch_size)
        self._inputs = np.zeros(0)

    def move(self, inputs: Array, substep_input: NDArray[np.int64], substep_duration: Array, noise: Array) -> None:
        """Predict over consecutive substeps of constant input, which add so much to the moving variances."""
        self._substeps = inputs, substep_input, substep_duration
        self._noise[:] = noise
        self.predict()

    def hold(self, inputs: Array) -> None:
        """Take the inputs that hold from now on, which nonlinear sensors may depend on."""
        self._inputs = inputs

    def start_from(self, mean: Array, covariance: Array) -> None:
        """Go back to a state, as if nothing had come after it."""
        self.x, self.P = mean.copy(), covariance
        self.x_prior, self.P_prior = mean, covariance

    def was_sound(self) -> bool:
        """Say whether the last prediction, at least, was finite."""
        return isfinite(self.x_prior.sum() + self.P_prior.diagonal().sum())

    def outside_gate(self, gate: float, stack: Stack, measurement: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the innovation of each present component, and whether it lies outside the gate."""
        predicted, matrix = self._predicted_measurement(stack)
        innovation = stack.residual(measurement, predicted)
        variance = np.einsum("ij,jk,ik->i", matrix, self.P, matrix) + stack.noise.diagonal()
        return innovation, innovation**2 > gate * variance

    def update_with(self, stack: Stack, measurement: Array) -> None:
        """Update with the present components of some measurements."""
        derivative, predict = stack.derivative, stack.matrix.dot
        if stack.nonlinear:
            predicted, matrix = self._predicted_measurement(stack)
            derivative, predict = (lambda _: matrix), (lambda _: predicted)
        self.update(measurement, HJacobian=derivative, Hx=predict, R=stack.noise, residual=stack.residual)

    def _predicted_measurement(self, stack: Stack) -> tuple[Array, Array]:
        """Predict a measurement, and its derivative by the state."""
        if stack.nonlinear:
            process, width = self._process, stack.width
            predicted, matrix = np.zeros(width), np.zeros((width, self.x.size))
            model = process.constants, process.selection
            process.linearise(self.x, stack.sensors[0], self._inputs, *model, predicted, matrix, self._scratch)
            return predicted[stack.places], matrix[stack.places]
        return stack.matrix @ self.x, stack.matrix

    def predict_x(self, u: float = 0) -> None:
        """Integrate the mean and set F to its transition matrix."""
        process = self._process
        process.transition(self.x, *self._substeps, process.constants, process.selection, self.F, self._scratch)


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
        return truncate(self._records, n_good, self._measurements[min(n_good + 1, len(self._noise))])

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
