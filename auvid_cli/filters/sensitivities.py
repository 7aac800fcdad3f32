"""Free motion without correction by measurements, and the sensitivities of its measurements to the initial state.

Only the moving rows of the sensitivities ``X_k = dx_k / dx_0`` are stored, because parameters are constant.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
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
from auvid_cli.numerics import compiled, types

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]

# Largest state of a motion that has not diverged: sums of squares over a long run stay finite.
_LARGEST = 1e100


class Response(NamedTuple):
    """Free motion over a chunk of the data, up to its end or until the motion diverges."""

    timeline: Timeline  # the whole chunk
    mean: Array  # shape (events, n); state after each event
    sensitivity: Array  # shape (events, n_moving, n); derivative of the moving states by the initial state
    innovation: Array  # shape (measurements, c); measured less predicted; NaN if missing
    # Shape (measurements, c, n + 1); derivative of each predicted component by the initial state, then the innovation,
    # both divided by the standard deviation of the noise; zero if missing
    whitened: Array

    @property
    def diverged(self) -> bool:
        """Whether the motion diverges before the end of the chunk."""
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
    path: Callable[[Array], Array] | None = None,
) -> Iterator[Response]:
    """Simulate the motion along the data without correction, chunk by chunk, until it diverges.

    Parameters
    ----------
    process : Process
        With an exact transition; its noise is ignored.
    sensors : Sensors
    timelines : iterable of Timeline
        Chunks in time order.
    start : ndarray, shape (n,)
        Initial state.
    path : callable, optional
        Maps times to the moving states, shape (events, n_moving), that replace those of the motion after each event;
        NaN for free ones. An open-loop unstable motion stays near its path only in this way.
    """
    n, n_moving, n_components = start.size, process.noise_density.size, sensors.matrix.shape[1]
    data = ModelData.of(process, sensors)
    state = _SegmentState(np.array(start, dtype=np.float64), np.eye(n)[n - n_moving :].copy())
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
        imposed = np.full((n_events, n_moving), np.nan) if path is None else path(timeline.time)
        response = whole.truncate(_move(process.transition, data, state, imposed, whole, work))
        _predict_measurements(process.linearise, data, response, work)
        yield response
        if response.diverged:
            return


class _SegmentState(NamedTuple):
    """State at the beginning of a chunk; afterwards at its end."""

    mean: Array  # shape (n,)
    sensitivity: Array  # shape (n_moving, n); as in `Response`


class _Workspace(NamedTuple):
    """Scratch arrays."""

    matrix: Array  # shape (n, n); transition matrix
    moved: Array  # shape (n_moving, n)
    predictions: Array  # shape (c,); predicted measurement of a sensor
    derivative: Array  # shape (c, n); its derivative by the state
    process: Array  # scratch of the process


_RESPONSE = types.NamedTuple((TIMELINE, _matrix, _stack, _matrix, _stack), Response)
_STATE = types.NamedTuple((_vector, _matrix), _SegmentState)
_WORKSPACE = types.NamedTuple((_matrix, _matrix, _vector, _matrix, _vector), _Workspace)


@compiled(types.int64(types.FunctionType(TRANSITION_SIGNATURE), MODEL_DATA, _STATE, _matrix, _RESPONSE, _WORKSPACE))
def _move(transition, data, state, path, response, work):
    """Fill in states and sensitivities; returns the number of events until the motion diverges."""
    timeline, mean, sensitivity, moved = response.timeline, state.mean, state.sensitivity, work.moved
    matrix = work.matrix
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
    """Fill in innovations and whitened rows."""
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
