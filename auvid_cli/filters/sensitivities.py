"""The motion left to itself, and how what the sensors measure depends on the state from which it starts.

Parameters are constant, so that of the sensitivities ``X_k = dx_k / dx_0`` only the moving rows are kept.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.filters.problem import (
    LINEARISATION_SIGNATURE,
    MODEL_DATA,
    TIMELINE,
    TRANSITION_SIGNATURE,
    ModelData,
    Process,
    Sensors,
    Timeline,
)
from auvid_cli.filters.sigma_points import wrapped
from auvid_cli.numerics import compiled

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]

# Beyond this a motion counts as blown up: squares, and their sums over a long run, stay finite.
_LARGEST = 1e100


class Response(NamedTuple):
    """Consecutive events of the motion left to itself, and their measurements; fewer than asked for where it blew up.

    Attributes
    ----------
    timeline : Timeline
        The chunk of the data that was asked for.
    mean : ndarray, shape (events, n)
        State after each event.
    sensitivity : ndarray, shape (events, n_moving, n)
        Derivative of its moving part by the state at the start.
    innovation : ndarray, shape (measurements, c)
        Measured less predicted; NaN where missing.
    whitened : ndarray, shape (measurements, c, n + 1)
        Of each component the derivative of what is predicted, then the innovation, over the standard deviation of
        the noise; zero where missing.
    """

    timeline: Timeline
    mean: Array
    sensitivity: Array
    innovation: Array
    whitened: Array

    @property
    def blew_up(self) -> bool:
        """Say whether the motion is not finite, or beyond all measure, before the end of the chunk."""
        return len(self.mean) < self.timeline.time.size

    def truncate(self, n_events: int) -> "Response":
        """Keep the first events and their measurements."""
        n_measurements = self.timeline.measurement_offset[n_events]
        return Response(
            self.timeline,
            *(of_event[:n_events] for of_event in (self.mean, self.sensitivity)),
            *(of_measurement[:n_measurements] for of_measurement in (self.innovation, self.whitened)),
        )


def responses(
    process: Process,
    sensors: Sensors,
    timelines: Iterable[Timeline],
    start: Array,
    along: Callable[[Array], Array] | None = None,
) -> Iterator[Response]:
    """Move a state along the data without correction, chunk by chunk, until the end or until the motion blows up.

    Parameters
    ----------
    process, sensors
        See `auvid_cli.filters.problem`. The process noise is not looked at, and the transition must be exact.
    timelines : iterable of Timeline
        Parts of the data in time order.
    start : ndarray, shape (n,)
        State at the first event.
    along : callable, optional
        From times to the moving states, shape (events, n_moving), to which the motion is brought back after each event,
        NaN for those that are left free. A motion that is unstable in open loop does not stay near them by itself.
    """
    n, n_moving, n_components = start.size, process.noise_density.size, sensors.matrix.shape[1]
    data, here = (
        ModelData.of(process, sensors),
        _SegmentState(np.array(start, dtype=np.float64), np.eye(n)[n - n_moving :].copy()),
    )
    work = _Workspace(
        np.eye(n),
        np.empty((n_moving, n)),
        np.empty(n_components),
        np.empty((n_components, n)),
        np.zeros(process.scratch_size),
    )
    for timeline in timelines:
        n_events, n_measurements = timeline.time.size, timeline.measurement_sensor.size
        whole = Response(
            timeline,
            np.empty((n_events, n)),
            np.empty((n_events, n_moving, n)),
            np.empty((n_measurements, n_components)),
            np.zeros((n_measurements, n_components, n + 1)),
        )
        path = np.full((n_events, n_moving), np.nan) if along is None else along(timeline.time)
        response = whole.truncate(_move(process.transition, data, here, path, whole, work))
        _predict_measurements(process.linearise, data, response, work)
        yield response
        if response.blew_up:
            return


class _SegmentState(NamedTuple):
    """The state where a chunk of the data begins and, afterwards, where it ends.

    Attributes
    ----------
    mean : ndarray, shape (n,)
    sensitivity : ndarray, shape (n_moving, n)
        Derivative of its moving part by the state at the start.
    """

    mean: Array
    sensitivity: Array


class _Workspace(NamedTuple):
    """Arrays that hold nothing from one use to the next.

    Attributes
    ----------
    matrix : ndarray, shape (n, n)
        Transition matrix, the identity above its moving rows.
    moved : ndarray, shape (n_moving, n)
    predictions : ndarray, shape (c,)
        What a sensor sees of a state.
    derivative : ndarray, shape (c, n)
        Of that, by the state.
    process : ndarray
        For the process itself.
    """

    matrix: Array
    moved: Array
    predictions: Array
    derivative: Array
    process: Array


_RESPONSE = types.NamedTuple((TIMELINE, _matrix, _stack, _matrix, _stack), Response)
_HERE = types.NamedTuple((_vector, _matrix), _SegmentState)
_WORKSPACE = types.NamedTuple((_matrix, _matrix, _vector, _matrix, _vector), _Workspace)


@compiled(types.int64(types.FunctionType(TRANSITION_SIGNATURE), MODEL_DATA, _HERE, _matrix, _RESPONSE, _WORKSPACE))
def _move(transition, data, here, path, response, work):
    """Fill in state and sensitivities of every event; returns how many are sound."""
    timeline, mean, sensitivity, matrix, moved = response.timeline, here.mean, here.sensitivity, work.matrix, work.moved
    n_moving, n = sensitivity.shape
    n_parameters = n - n_moving
    for event in range(timeline.time.size):
        first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
        if last > first:
            substeps = timeline.substep_input[first:last], timeline.substep_duration[first:last]
            inputs, constants, selection = timeline.inputs, data.constants, data.selection
            transition(mean, inputs, substeps[0], substeps[1], constants, selection, matrix, work.process)
            size = 0.0
            for i in range(n_moving):
                row = matrix[n_parameters + i]
                for j in range(n):
                    moved[i, j] = row[j] if j < n_parameters else 0.0
                for k in range(n_moving):
                    for j in range(n):
                        moved[i, j] += row[n_parameters + k] * sensitivity[k, j]
                size += abs(mean[n_parameters + i])
                for j in range(n):
                    size += abs(moved[i, j])
            if not size < _LARGEST:
                return event
            for i in range(n_moving):
                for j in range(n):
                    sensitivity[i, j] = moved[i, j]
        for i in range(n_moving):
            if not np.isnan(path[event, i]):
                mean[n_parameters + i] = path[event, i]
        for j in range(n):
            response.mean[event, j] = mean[j]
            for i in range(n_moving):
                response.sensitivity[event, i, j] = sensitivity[i, j]
    return timeline.time.size


@compiled(types.void(types.FunctionType(LINEARISATION_SIGNATURE), MODEL_DATA, _RESPONSE, _WORKSPACE))
def _predict_measurements(linearise, data, response, work):
    """Fill in what the sensors say at the events."""
    timeline, innovation, sensors = response.timeline, response.innovation, data.sensors
    n = response.mean.shape[1]
    n_parameters = n - response.sensitivity.shape[1]
    for event in range(response.mean.shape[0]):
        mean = response.mean[event]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            sensor = timeline.measurement_sensor[k]
            nonlinear, rows = sensors.nonlinear[sensor], sensors.matrix[sensor]
            if nonlinear:
                inputs, model = timeline.inputs[timeline.event_input[event]], (data.constants, data.selection)
                linearise(mean, sensor, inputs, model[0], model[1], work.predictions, work.derivative, work.process)
                rows = work.derivative
            for c in range(innovation.shape[1]):
                measured = timeline.measurement[k, c]
                innovation[k, c] = np.nan
                if np.isnan(measured):
                    continue
                weight, row = 1.0 / np.sqrt(sensors.variance[sensor, c]), response.whitened[k, c]
                predicted = 0.0
                for i in range(n):
                    h = rows[c, i]
                    if h != 0.0:
                        predicted += h * mean[i]
                        if i < n_parameters:
                            row[i] += weight * h
                        else:
                            of_state = response.sensitivity[event, i - n_parameters]
                            for j in range(n):
                                row[j] += weight * h * of_state[j]
                if nonlinear:
                    predicted = work.predictions[c]
                innovation[k, c] = wrapped(measured - predicted, sensors.angular[sensor, c])
                row[n] = weight * innovation[k, c]
