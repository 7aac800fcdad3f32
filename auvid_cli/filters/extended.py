"""Extended Kalman filter on filterpy."""

import warnings
from collections.abc import Iterable
from functools import cache, partial
from math import isfinite

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
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
from auvid_cli.filters.stacked import Stack, is_definite

Array = NDArray[np.float64]

# Events between two checks that the covariance is positive definite.
_CHECK = 10


class _ProcessEkf(ExtendedKalmanFilter):
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
        # A view of the moving part of the diagonal.
        self._noise = self.Q.reshape(-1)[-1 - (process.noise_density.size - 1) * (n + 1) :: n + 1]
        self._density = process.noise_density**2
        self._scratch = np.zeros(process.scratch_size)
        self._inputs = np.zeros(0)

    def move(self, inputs: Array, substep_input: NDArray[np.int64], substep_duration: Array) -> None:
        """Predict over consecutive substeps of constant input."""
        self._substeps = inputs, substep_input, substep_duration
        self._noise[:] = self._density * substep_duration.sum()
        self.predict()

    def hold(self, inputs: Array) -> None:
        """Take the inputs that hold from now on, which nonlinear sensors may depend on."""
        self._inputs = inputs

    def outside_gate(self, gate: float, stack: Stack, measurement: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the innovation of each present component, and whether it lies outside the gate."""
        predicted, matrix = self._predicted_measurement(stack)
        innovation = stack.residual(measurement, predicted)
        variance = np.einsum("ij,jk,ik->i", matrix, self.P, matrix) + stack.noise.diagonal()
        return innovation, innovation**2 > gate * variance

    def update_with(self, stack: Stack, measurement: Array) -> None:
        """Update with the present components of some measurements."""
        predicted, matrix = self._predicted_measurement(stack)
        self.update(
            measurement, HJacobian=lambda x: matrix, Hx=lambda x: predicted, R=stack.noise, residual=stack.residual
        )

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


class _BrokenError(Exception):
    """A measurement left nothing to go on with."""

    def __init__(self, sensor: int) -> None:
        super().__init__(sensor)
        self.sensor = sensor


class _Listener:
    """Updates a filter with the measurements of a timeline, and writes down what they say."""

    def __init__(self, ekf: _ProcessEkf, sensors: Sensors, timeline: Timeline, records: Records) -> None:
        self._ekf = ekf
        self._gate = sensors.gate
        self._measurement = timeline.measurement
        self._records = records
        self._stack_of = cache(partial(Stack, sensors))
        missing = np.isnan(timeline.measurement)
        patterns = (missing @ (1 << np.arange(missing.shape[1]))).tolist()
        self._kinds = list(zip(timeline.measurement_sensor.tolist(), patterns, strict=True))
        # What is rejected of a measurement, and where a nonlinear sensor is linearised, depends on those before it.
        self._at_once = sensors.gate == np.inf and not sensors.nonlinear.any()

    def update_with(self, begin: int, end: int) -> int:
        """Update with consecutive measurements of one moment; the last sensor used, `PREDICTION` if there was none.

        Raises
        ------
        _BrokenError
            If a measurement has no positive, finite innovation covariance.
        """
        spans = [(begin, end)] if self._at_once else [(k, k + 1) for k in range(begin, end)]
        last_sensor = PREDICTION
        for first, last in spans:
            stack = self._stack_of(tuple(self._kinds[first:last]))
            if self._gate < np.inf:
                stack = self._accepted(stack, first)
            self._records.nis[first:last] = 0.0
            if stack.sensors:
                last_sensor = stack.sensors[-1]
                self._update(stack, slice(first, last))
        return last_sensor

    def _accepted(self, stack: Stack, k: int) -> Stack:
        """Return what a gate leaves of a measurement."""
        if not stack.sensors:
            return stack
        innovation, rejected = self._ekf.outside_gate(self._gate, stack, self._measurement[k, stack.places])
        self._records.innovation[k, stack.places] = innovation
        sensor, missing = self._kinds[k]
        components = np.arange(self._measurement.shape[1])[stack.places][rejected]
        return self._stack_of(((sensor, missing | int((1 << components).sum())),))

    def _update(self, stack: Stack, span: slice) -> None:
        ekf, places = self._ekf, stack.places
        try:
            ekf.update_with(stack, self._measurement[span].reshape(-1)[places])
            innovation, variance, nis = stack.one_by_one(ekf.y, ekf.S, ekf.SI)
        except (np.linalg.LinAlgError, ValueError):
            # Of scipy's inverse: a singular matrix, or one that is not finite.
            nis = np.full(len(stack.sensors), np.nan)
        else:
            self._records.innovation[span].reshape(-1)[places] = innovation
            self._records.innovation_variance[span].reshape(-1)[places] = variance
        self._records.nis[span][stack.measurements] = nis
        if not isfinite(nis.sum()):
            raise _BrokenError(stack.first_broken(ekf.y, ekf.S))


def run_extended_filter(
    process: Process, sensors: Sensors, timelines: Iterable[Timeline], prior: Gaussian, on_chunk: OnChunk
) -> FilterOutcome:
    """Filter data with the EKF; arguments and result as of `run_square_root_filter`.

    Sabet et al. 2018, Table A1. A measurement with missing components is shortened to the rest:
    filterpy's ``update(None)`` would skip all of it.
    """
    ekf = _ProcessEkf(process, prior)
    n_good, outcome = 0, FilterOutcome(ekf.P, 0, OK)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        # What overflows or is nearly singular is judged after every step, and reported as divergence.
        warnings.simplefilter("ignore", LinAlgWarning)
        for timeline in timelines:
            outcome = _run(ekf, sensors, timeline, on_chunk)
            n_good += outcome.n_good
            if outcome.failure != OK:
                break
    return outcome._replace(n_good=n_good)


def _run(ekf: _ProcessEkf, sensors: Sensors, timeline: Timeline, on_chunk: OnChunk) -> FilterOutcome:
    """Filter a part; its end is sound, or the end of all."""
    n_events = timeline.time.size
    sound, covariance = 0, ekf.P
    records = empty_records(timeline, ekf.x.size)
    listener = _Listener(ekf, sensors, timeline, records)
    failure, event = OK, 0
    for event in range(n_events):
        before = ekf.P
        failure = _step(ekf, listener, timeline, event)
        if failure != OK:
            if is_definite(before):
                sound, covariance = event, before
            break
        records.mean[event] = ekf.x
        records.standard_deviation[event] = np.sqrt(ekf.P.diagonal())
        if event % _CHECK == _CHECK - 1 or event == n_events - 1:
            if not is_definite(ekf.P):
                failure = PREDICTION
                break
            sound, covariance = event + 1, ekf.P
    on_chunk(timeline, until(records, sound, timeline.measurement_offset[min(event + 1, n_events)]))
    return FilterOutcome(covariance, sound, failure)


def _step(ekf: _ProcessEkf, listener: _Listener, timeline: Timeline, event: int) -> int:
    """Predict to an event and update with its measurements; what failed, or `OK`."""
    first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
    if last > first:
        ekf.move(timeline.inputs, timeline.substep_input[first:last], timeline.substep_duration[first:last])
    ekf.hold(timeline.inputs[timeline.event_input[event]])
    try:
        last_sensor = listener.update_with(timeline.measurement_offset[event], timeline.measurement_offset[event + 1])
    except _BrokenError as broken:
        return broken.sensor if _was_sound(ekf) else PREDICTION
    return OK if _is_sound(ekf) else last_sensor


def _was_sound(ekf: _ProcessEkf) -> bool:
    """Say whether the last prediction, at least, was finite."""
    return isfinite(ekf.x_prior.sum() + ekf.P_prior.diagonal().sum())


def _is_sound(ekf: _ProcessEkf) -> bool:
    """Say whether the state is finite, and the variances finite and positive."""
    variances = ekf.P.diagonal()
    return isfinite(ekf.x.sum() + variances.sum()) and variances.min() > 0.0
