"""Extended Kalman filter based on filterpy, with the linear measurements of one event stacked.

Sabet et al. 2018, Table A1. Events are filtered in blocks and checked afterwards, many at once. If a block fails, it is
filtered again event by event, to stop at the last good one.
"""

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

from auvid_cli.arrays import Array, wrap
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
)

# Sensor of a measurement, and its missing components as bits: bit c for component c.
Kind = tuple[int, int]
# Events from one check for a positive definite covariance to the next.
_CHECK_INTERVAL = 50
# Events that are checked together; results do not depend on it.
BLOCK = 500
# Raised by the inversion or factorisation of a matrix that is singular, not positive definite or not finite.
_MATRIX_ERRORS = (np.linalg.LinAlgError, ValueError)


class Stack:
    """Measurement model of stacked measurements, for given sensors and missing components.

    Parameters
    ----------
    sensors : Sensors
    kinds : tuple of (int, int)
        One nonlinear sensor, or any number of linear ones; each with its missing components.

    Attributes
    ----------
    width : int
        Maximum number of components of a sensor.
    size : int
        Number of measurements.
    sensors, measurements : list of int
        Sensors with any component present, and the indices of their measurements in the stack.
    begins : ndarray of int
        Index of the first component of each of these sensors.
    places : slice or ndarray of int
        Indices of the present components in the concatenated measurements.
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
        # Indexing by a slice is several times faster than by a list.
        places = [k * width + c for k, c in present]
        self.places = slice(len(places)) if places == list(range(len(places))) else np.array(places)
        rows = [kinds[k][0] for k, _ in present], [c for _, c in present]
        self.nonlinear = any(sensors.nonlinear[sensor] for sensor in self.sensors)
        self.matrix = sensors.matrix[rows]
        self.noise = np.diag(sensors.variance[rows])
        self._angular = np.flatnonzero(sensors.angular[rows]).tolist()

    def derivative(self, state: Array) -> Array:
        """Return the measurement matrix of linear sensors."""
        return self.matrix

    def residual(self, measurement: Array, predicted: Array) -> Array:
        """Return measured less predicted components, angles wrapped to [-pi, pi)."""
        difference = measurement - predicted
        for component in self._angular:
            angle = difference.item(component)
            # Wrapping takes twelve times as long as the test.
            if not -pi <= angle < pi:
                difference[component] = wrap(angle)
        return difference

    def sequential(self, innovation: Array, covariance: Array) -> tuple[Array, Array, Array]:
        """Return the innovations of sequential updates, one measurement after another.

        With the Cholesky factor L of the covariance of the innovation y, ``L^-1 y`` is white. The product of a
        measurement's part of it with the diagonal block of L is the innovation given the measurements before.

        Parameters
        ----------
        innovation : ndarray, shape (k, m)
            At k times.
        covariance : ndarray, shape (k, m, m)
            Covariance of each.

        Returns
        -------
        innovation, variance : ndarray, shape (k, m)
        nis : ndarray, shape (k, n)
            Normalised innovation squared of each sensor.

        Raises
        ------
        numpy.linalg.LinAlgError
            For a covariance that is not positive definite.
        """
        factor = np.linalg.cholesky(covariance)
        white = np.zeros_like(innovation)
        for i in range(innovation.shape[1]):
            explained = np.einsum("kj,kj->k", factor[:, i, :i], white[:, :i])
            white[:, i] = (innovation[:, i] - explained) / factor[:, i, i]
        blocks = factor * self._same_measurement
        variance = np.einsum("kij,kij->ki", blocks, blocks)
        return np.einsum("kij,kj->ki", blocks, white), variance, np.add.reduceat(white**2, self.begins, axis=1)

    def first_failure(self, innovation: Array, covariance: Array) -> int:
        """Return the first sensor whose innovation or its covariance is invalid; else the last sensor."""
        ends = [*self.begins[1:], len(covariance)]
        whole = (np.isfinite(innovation[:end]).all() and is_definite(covariance[:end, :end]) for end in ends)
        return next((s for s, sound in zip(self.sensors, whole, strict=True) if not sound), self.sensors[-1])


def is_definite(covariance: Array) -> bool:
    """Whether a matrix is positive definite after scaling to a unit diagonal."""
    scale = 1.0 / np.sqrt(np.diagonal(covariance))
    _, failed = dpotrf(covariance * np.outer(scale, scale), lower=True)
    return not failed


class ProcessEkf(ExtendedKalmanFilter):
    """filterpy's filter, with the mean predicted by the process instead of F.

    The state is a vector instead of filterpy's column, which a 1-d measurement would silently broadcast to a matrix.
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
        """Predict over consecutive substeps of constant input; `noise` is added to the moving variances."""
        self._substeps = inputs, substep_input, substep_duration
        self._noise[:] = noise
        self.predict()

    def hold(self, inputs: Array) -> None:
        """Set the inputs for nonlinear sensors."""
        self._inputs = inputs

    def start_from(self, mean: Array, covariance: Array) -> None:
        """Restart from a state."""
        self.x, self.P = mean.copy(), covariance
        self.x_prior, self.P_prior = mean, covariance

    def prediction_is_finite(self) -> bool:
        """Whether the last prediction was finite."""
        return isfinite(self.x_prior.sum() + self.P_prior.diagonal().sum())

    def outside_gate(self, gate: float, stack: Stack, measurement: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the innovation of each present component, and whether it is outside the gate."""
        predicted, matrix = self._predicted_measurement(stack)
        innovation = stack.residual(measurement, predicted)
        variance = np.einsum("ij,jk,ik->i", matrix, self.P, matrix) + stack.noise.diagonal()
        return innovation, innovation**2 > gate * variance

    def update_with(self, stack: Stack, measurement: Array) -> None:
        """Update with the present components of stacked measurements."""
        derivative, predict = stack.derivative, stack.matrix.dot
        if stack.nonlinear:
            predicted, matrix = self._predicted_measurement(stack)
            derivative, predict = (lambda _: matrix), (lambda _: predicted)
        self.update(measurement, HJacobian=derivative, Hx=predict, R=stack.noise, residual=stack.residual)

    def _predicted_measurement(self, stack: Stack) -> tuple[Array, Array]:
        """Return the predicted measurement and its derivative by the state."""
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
    """Filter of a chunk: filters several events, then checks all their innovations at once."""

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
        # With nonlinear sensors or a gate, an update depends on the previous one: nothing is stacked.
        self._holds = bool(sensors.nonlinear.any())
        spans = pairwise(self._measurements)
        if self._holds or self._gate < np.inf:
            together = ([(k, k + 1) for k in range(*span)] for span in spans)
        else:
            together = ([span] if span[0] < span[1] else [] for span in spans)
        # Stacks of each event, with the index of their first measurement.
        self._stacks = [[(stack_of(tuple(self._kinds[k:end])), k) for k, end in event] for event in together]
        # First measurement, innovation and its covariance of unchecked updates, by stack.
        self._unchecked: defaultdict[Stack, list[tuple[int, Array, Array]]] = defaultdict(list)

    def filter_block(self, first: int, last: int) -> bool:
        """Filter a block of events; False if any state or innovation is invalid."""
        self._records.nis[self._measurements[first] : self._measurements[last]] = 0.0
        try:
            for event in range(first, last):
                self._predict(event)
                for stack, k in self._stacks[event]:
                    self._update(self._accepted(stack, k), k)
                self._store_state(event)
                if event % _CHECK_INTERVAL == 0 and not is_definite(self._ekf.P):
                    return False
            self._store_innovations()
        except _MATRIX_ERRORS:
            return False
        return self._is_sound(first, last) and is_definite(self._ekf.P)

    def failure_at(self, event: int) -> int:
        """Filter one event with a check after each update; returns the failure, or `OK`."""
        ekf, sensor = self._ekf, PREDICTION
        self._predict(event)
        for whole, k in self._stacks[event]:
            stack = self._accepted(whole, k)
            self._records.nis[k : k + whole.size] = 0.0
            try:
                self._update(stack, k)
                self._store_innovations()
            except _MATRIX_ERRORS:
                self._clear(k, k + whole.size)
                return stack.first_failure(ekf.y, ekf.S) if ekf.prediction_is_finite() else PREDICTION
            sensor = stack.sensors[-1] if stack.sensors else sensor
        self._store_state(event)
        if not self._is_sound(event, event + 1):
            return sensor
        return OK if is_definite(ekf.P) else PREDICTION

    def clear(self, first: int, last: int) -> None:
        """Clear the innovations of a block of events."""
        self._clear(self._measurements[first], self._measurements[last])

    def until(self, n_good: int) -> Records:
        """Return the records of the good events, and of the measurements at the next one."""
        return self._records.truncate(n_good, self._measurements[min(n_good + 1, len(self._noise))])

    def _clear(self, first: int, last: int) -> None:
        self._unchecked.clear()
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
        """Return the stack without the components outside the gate."""
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
            self._unchecked[stack].append((k, self._ekf.y, self._ekf.S))

    def _store_state(self, event: int) -> None:
        self._records.mean[event] = self._ekf.x
        # Variances for now; `_is_sound` takes the square root of all at once.
        self._records.standard_deviation[event] = self._ekf.P.diagonal()

    def _store_innovations(self) -> None:
        """Store the innovations of all unchecked updates.

        Raises
        ------
        numpy.linalg.LinAlgError
            For an innovation whose covariance is not positive definite and finite.
        """
        for stack, updates in self._unchecked.items():
            first, y, covariance = zip(*updates, strict=True)
            shape = len(updates), stack.noise.shape[0]
            innovation, variance, nis = stack.sequential(
                np.concatenate(y).reshape(shape), np.concatenate(covariance).reshape(*shape, -1)
            )
            if not isfinite(nis.sum()):
                raise np.linalg.LinAlgError("an innovation is not finite")
            begin = np.array(first)[:, None]
            places = begin * self._width + np.arange(stack.size * self._width)[stack.places]
            self._records.innovation.reshape(-1)[places] = innovation
            self._records.innovation_variance.reshape(-1)[places] = variance
            self._records.nis[begin + stack.measurements] = nis
        self._unchecked.clear()

    def _is_sound(self, first: int, last: int) -> bool:
        """Whether all states and variances are finite, and variances positive; then stores standard deviations."""
        variance = self._records.standard_deviation[first:last]
        sound = isfinite(self._records.mean[first:last].sum() + variance.sum()) and variance.min() > 0.0
        np.sqrt(variance, out=variance)
        return sound


def run_extended_filter(
    process: Process, sensors: Sensors, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk
) -> FilterOutcome:
    """Filter data with the EKF; parameters and result as in `run_square_root_filter`.

    A measurement with missing components is shortened: filterpy's ``update(None)`` would skip all of it.
    """
    ekf = ProcessEkf(process, prior)
    stack_of = cache(partial(Stack, sensors))
    n_good, failure = 0, OK
    with np.errstate(all="ignore"), warnings.catch_warnings():
        # Overflow and singular matrices are found by the checks, and reported as divergence.
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
    """Filter a chunk; returns the number of good events, and the failure after them or `OK`."""
    for first in range(0, n_events, BLOCK):
        last = min(first + BLOCK, n_events)
        before = ekf.x.copy(), ekf.P
        if part.filter_block(first, last):
            continue
        # Again event by event, to find the failure.
        part.clear(first, last)
        ekf.start_from(*before)
        for event in range(first, last):
            before = ekf.x.copy(), ekf.P
            failure = part.failure_at(event)
            if failure != OK:
                ekf.start_from(*before)
                return event, failure
    return n_events, OK
