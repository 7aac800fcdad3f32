"""The motion left to itself, and how what the sensors measure depends on the state from which it starts.

Parameters are constant, so that of the sensitivities ``X_k = dx_k / dx_0`` only the moving rows are kept.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.measurement import SENSORS_TYPE, wrapped
from auvid_cli.filters.problem import (
    LINEARISATION_SIGNATURE,
    TIMELINE,
    TRANSITION_SIGNATURE,
    Process,
    Sensors,
    Timeline,
)

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
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


def responses(process: Process, sensors: Sensors, timelines: Iterable[Timeline], start: Array) -> Iterator[Response]:
    """Move a state along the data without correction, chunk by chunk, until the end or until the motion blows up.

    Parameters
    ----------
    process, sensors
        See `auvid_cli.filters.problem`. The process noise is not looked at, and the transition must be exact.
    timelines : iterable of Timeline
        Parts of the data in time order.
    start : ndarray, shape (n,)
        State at the first event.
    """
    n, n_moving = start.size, process.noise_density.size
    mean, matrix = np.array(start, dtype=np.float64), np.eye(n)
    sensitivity = np.eye(n)[n - n_moving :].copy()
    moved, scratch = np.empty((n_moving, n)), np.zeros(process.scratch_size)
    for timeline in timelines:
        n_events, (n_measurements, n_components) = timeline.time.size, timeline.measurement.shape
        means, sensitivities = np.empty((n_events, n)), np.empty((n_events, n_moving, n))
        innovation, whitened = np.empty((n_measurements, n_components)), np.zeros((n_measurements, n_components, n + 1))
        model = process.transition, process.constants, process.selection
        good = _move(*model, timeline, mean, sensitivity, matrix, moved, scratch, means, sensitivities)
        n_measured = timeline.measurement_offset[good]
        observation = process.linearise, process.constants, process.selection, sensors
        work = np.empty(n_components), np.empty((n_components, n)), scratch
        _predict_measurements(*observation, timeline, good, means, sensitivities, innovation, whitened, *work)
        yield Response(timeline, means[:good], sensitivities[:good], innovation[:n_measured], whitened[:n_measured])
        if good < n_events:
            return


@compiled(
    types.int64(
        types.FunctionType(TRANSITION_SIGNATURE),
        *(_vector, _indices, TIMELINE, _vector, _matrix, _matrix, _matrix, _vector, _matrix, _stack),
    ),
)
def _move(transition, constants, selection, timeline, mean, sensitivity, matrix, moved, scratch, means, sensitivities):
    """Fill in state and sensitivities of every event; returns how many are sound.

    `mean` and `sensitivity` are where it starts and, afterwards, where it ends.
    """
    n_moving, n = sensitivity.shape
    n_parameters = n - n_moving
    for event in range(timeline.time.size):
        first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
        if last > first:
            substeps = timeline.substep_input[first:last], timeline.substep_duration[first:last]
            transition(mean, timeline.inputs, substeps[0], substeps[1], constants, selection, matrix, scratch)
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
        for j in range(n):
            means[event, j] = mean[j]
            for i in range(n_moving):
                sensitivities[event, i, j] = sensitivity[i, j]
    return timeline.time.size


@compiled(
    types.void(
        types.FunctionType(LINEARISATION_SIGNATURE),
        *(_vector, _indices, SENSORS_TYPE, TIMELINE, types.int64, _matrix, _stack, _matrix, _stack),
        *(_vector, _matrix, _vector),
    ),
)
def _predict_measurements(
    linearise,
    constants,
    selection,
    sensors,
    timeline,
    n_events,
    means,
    sensitivities,
    innovation,
    whitened,
    predictions,
    derivative,
    scratch,
):
    """Fill in what the sensors say at the first events."""
    n = means.shape[1]
    n_parameters = n - sensitivities.shape[1]
    for event in range(n_events):
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            sensor = timeline.measurement_sensor[k]
            nonlinear, rows = sensors.nonlinear[sensor], sensors.matrix[sensor]
            if nonlinear:
                inputs = timeline.inputs[timeline.event_input[event]]
                linearise(means[event], sensor, inputs, constants, selection, predictions, derivative, scratch)
                rows = derivative
            for c in range(innovation.shape[1]):
                measured = timeline.measurement[k, c]
                innovation[k, c] = np.nan
                if np.isnan(measured):
                    continue
                weight, row = 1.0 / np.sqrt(sensors.variance[sensor, c]), whitened[k, c]
                predicted = 0.0
                for i in range(n):
                    h = rows[c, i]
                    if h != 0.0:
                        predicted += h * means[event, i]
                        if i < n_parameters:
                            row[i] += weight * h
                        else:
                            of_state = sensitivities[event, i - n_parameters]
                            for j in range(n):
                                row[j] += weight * h * of_state[j]
                if nonlinear:
                    predicted = predictions[c]
                innovation[k, c] = wrapped(measured - predicted, sensors.angular[sensor, c])
                row[n] = weight * innovation[k, c]
