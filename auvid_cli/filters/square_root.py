"""One square-root filter for every antipodal sigma-point set: CKF, TUKF and UKF.

Points are drawn anew from the factor for each prediction. Measurements are linear, where every set that
integrates degree two gives the Kalman update; it is applied to the factor one scalar at a time.
"""

from collections.abc import Callable

import numpy as np
from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.factor import carlson_update
from auvid_cli.filters.point_sets import PointSet
from auvid_cli.filters.problem import (
    OK,
    PREDICTION,
    PROCESS_SIGNATURE,
    Belief,
    History,
    Process,
    Records,
    Sensors,
    Timeline,
    empty_records,
)
from auvid_cli.filters.sigma_points import POINT_SET, predict

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
_SENSORS = types.NamedTuple((types.float64[:, :, ::1], _matrix, types.boolean[:, ::1]), Sensors)
_TIMELINE = types.NamedTuple((_vector, _indices, _vector, _indices, _matrix, _indices, _indices, _matrix), Timeline)
_RECORDS = types.NamedTuple((_matrix, _matrix, _matrix, _matrix, _vector), Records)

# Events between two reports of progress: about 20 ms of work.
CHUNK = 2000


@compiled(types.float64(_vector, _matrix, _vector, _vector, types.boolean, types.float64), reassociate=True)
def project(mean, columns, row, projection, angular, reading):
    """Innovation ``reading - h mean`` and the projection ``S' h`` of a measurement row h."""
    n = mean.size
    predicted = 0.0
    for j in range(n):
        projection[j] = 0.0
    for i in range(n):
        h = row[i]
        if h != 0.0:
            predicted += h * mean[i]
            for j in range(i + 1):
                projection[j] += h * columns[j, i]
    innovation = reading - predicted
    if angular:
        innovation -= 2.0 * np.pi * np.floor(innovation / (2.0 * np.pi) + 0.5)
    return innovation


@compiled(types.float64(_SENSORS, types.int64, _vector, _vector, _matrix, _vector, _vector), reassociate=True)
def update(sensors, sensor, reading, mean, columns, innovation, variance):
    """Condition on one reading, component by component; missing components are left out.

    Parameters
    ----------
    innovation, variance : ndarray, shape (c,)
        Filled with the joint innovation before the update and the variance of each component.

    Returns
    -------
    float
        Normalised innovation squared of the whole reading; NaN or negative where the update failed.
    """
    n = mean.size
    projection, gain, scratch = np.empty(n), np.empty(n), np.empty(n)
    for c in range(reading.size):
        innovation[c] = np.nan
        variance[c] = np.nan
        if not np.isnan(reading[c]):
            angular = sensors.angular[sensor, c]
            innovation[c] = project(mean, columns, sensors.matrix[sensor, c], projection, angular, reading[c])
            total = sensors.variance[sensor, c]
            for j in range(n):
                total += projection[j] * projection[j]
            variance[c] = total
    nis = 0.0
    for c in range(reading.size):
        if not np.isnan(reading[c]):
            angular = sensors.angular[sensor, c]
            error = project(mean, columns, sensors.matrix[sensor, c], projection, angular, reading[c])
            total = carlson_update(columns, projection, sensors.variance[sensor, c], gain, scratch)
            nis += error * error / total
            for i in range(n):
                mean[i] += gain[i] * error / total
    return nis


@compiled(
    types.UniTuple(types.int64, 2)(
        types.FunctionType(PROCESS_SIGNATURE),
        *(_vector, _indices, _vector, POINT_SET, _SENSORS, _TIMELINE),
        *(types.int64, types.int64, _vector, _matrix, _RECORDS),
    ),
    reassociate=True,
)
def _run(
    advance, constants, selection, noise_density, point_set, sensors, timeline, start, stop, mean, columns, records
):
    """Filter events `start` to `stop`; returns (first event that failed or `stop`, what failed).

    On failure mean and columns are those after the event before.
    """
    n = mean.size
    last_mean, last_columns = mean.copy(), columns.copy()
    for event in range(start, stop):
        last_mean[:] = mean
        last_columns[:] = columns
        culprit = OK
        first, last = timeline.piece_offset[event], timeline.piece_offset[event + 1]
        if last > first and not predict(
            advance,
            constants,
            selection,
            noise_density,
            point_set,
            timeline.inputs,
            timeline.piece_input[first:last],
            timeline.piece_duration[first:last],
            mean,
            columns,
        ):
            culprit = PREDICTION
        first, last = timeline.reading_offset[event], timeline.reading_offset[event + 1]
        for k in range(first, last):
            if culprit == OK:
                sensor = timeline.reading_sensor[k]
                records.nis[k] = update(
                    sensors,
                    sensor,
                    timeline.reading[k],
                    mean,
                    columns,
                    records.innovation[k],
                    records.innovation_variance[k],
                )
                if not (np.isfinite(mean.sum()) and records.nis[k] >= 0.0):
                    culprit = sensor
        if culprit != OK:
            mean[:] = last_mean
            columns[:] = last_columns
            return event, culprit
        records.mean[event] = mean
        deviation = records.standard_deviation[event]
        for i in range(n):
            deviation[i] = 0.0
        for j in range(n):
            column = columns[j]
            for i in range(j, n):
                deviation[i] += column[i] * column[i]
        for i in range(n):
            deviation[i] = np.sqrt(deviation[i])
    return stop, OK


def run_square_root_filter(
    point_set: PointSet,
    process: Process,
    sensors: Sensors,
    timeline: Timeline,
    prior: Belief,
    progress: Callable[[int, int], None],
) -> History:
    """Filter a timeline with a sigma-point set.

    Parameters
    ----------
    point_set : PointSet
        For the dimension of the state.
    process, sensors, timeline, prior
        See `auvid_cli.filters.problem`.
    progress : callable
        Told how many events are done, and of how many, now and then.

    Returns
    -------
    History
        Ends early, with the reason, where the state is not finite or the factor cannot be propagated.
    """
    mean, columns = prior.mean.copy(), np.ascontiguousarray(prior.factor.T)
    n_events = timeline.time.size
    records = empty_records(timeline, mean.size)
    done, culprit = 0, OK
    while done < n_events and culprit == OK:
        done, culprit = _run(
            process.advance,
            process.constants,
            process.selection,
            process.noise_density,
            point_set,
            sensors,
            timeline,
            done,
            min(done + CHUNK, n_events),
            mean,
            columns,
            records,
        )
        progress(done, n_events)
    return History(records, columns.T @ columns, done, culprit)
