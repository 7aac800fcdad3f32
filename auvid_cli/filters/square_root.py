"""One square-root filter for every antipodal sigma-point set: CKF, TUKF and UKF.

Points are drawn anew from the factor for each prediction, and for each reading of a nonlinear sensor. Where a
measurement is linear, every set that integrates degree two gives the Kalman update.
"""

from collections.abc import Iterable

import numpy as np
from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.measurement import SENSORS, update
from auvid_cli.filters.point_sets import PointSet
from auvid_cli.filters.prediction import predict
from auvid_cli.filters.problem import (
    OBSERVATION_SIGNATURE,
    OK,
    PREDICTION,
    PROCESS_SIGNATURE,
    TIMELINE,
    Belief,
    Ending,
    Process,
    Receiver,
    Records,
    Sensors,
    Timeline,
    empty_records,
    until,
)
from auvid_cli.filters.sigma_points import BASIS, all_finite, basis_of
from auvid_cli.filters.workspace import WORKSPACE, new_workspace, padded

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
_RECORDS = types.NamedTuple((_matrix, _matrix, _matrix, _matrix, _vector), Records)


@compiled(types.void(_matrix, types.int64, _vector, _vector), reassociate=True, internal=True)
def deviations(columns, n, squares, result):
    """Standard deviations of the state: row norms of the factor. `squares` is overwritten."""
    width = columns.shape[1]
    for i in range(width):
        squares[i] = 0.0
    for j in range(0, n, 2):
        column0, column1 = columns[j], columns[j + 1]
        for i in range(width):
            squares[i] += column0[i] * column0[i] + column1[i] * column1[i]
    for i in range(n):
        result[i] = np.sqrt(squares[i])


@compiled(
    types.UniTuple(types.int64, 2)(
        types.FunctionType(PROCESS_SIGNATURE),
        types.FunctionType(OBSERVATION_SIGNATURE),
        *(_vector, _indices, _vector, BASIS, SENSORS, TIMELINE),
        *(types.int64, types.int64, _vector, _matrix, _RECORDS, WORKSPACE),
    ),
    reassociate=True,
)
def _run(
    advance,
    observe,
    constants,
    selection,
    noise_density,
    basis,
    sensors,
    timeline,
    stop,
    n,
    mean,
    columns,
    records,
    work,
):
    """Filter the events before `stop`; returns (first event that failed or `stop`, what failed)."""
    for event in range(stop):
        first, last = timeline.piece_offset[event], timeline.piece_offset[event + 1]
        if last > first and not predict(
            advance,
            constants,
            selection,
            noise_density,
            basis,
            timeline.inputs,
            timeline.piece_input[first:last],
            timeline.piece_duration[first:last],
            n,
            mean,
            columns,
            work,
        ):
            return event, PREDICTION
        for k in range(timeline.reading_offset[event], timeline.reading_offset[event + 1]):
            sensor = timeline.reading_sensor[k]
            nis = update(
                observe,
                constants,
                selection,
                noise_density.size,
                basis,
                sensors,
                sensor,
                timeline.reading[k],
                n,
                mean,
                columns,
                records.innovation[k],
                records.innovation_variance[k],
                work,
            )
            records.nis[k] = nis
            if not (all_finite(n, mean) and nis >= 0.0):
                return event, sensor
        for i in range(n):
            records.mean[event, i] = mean[i]
        deviations(columns, n, work.gain, records.standard_deviation[event])
    return stop, OK


def run_square_root_filter(
    point_set: PointSet,
    process: Process,
    sensors: Sensors,
    timelines: Iterable[Timeline],
    prior: Belief,
    receive: Receiver,
) -> Ending:
    """Filter data with a sigma-point set.

    Parameters
    ----------
    point_set : PointSet
        For the dimension of the state.
    process, sensors, prior
        See `auvid_cli.filters.problem`; the prior is that at the first event.
    timelines : iterable of Timeline
        Parts of the data in time order; a part is worked on at once.
    receive : callable
        Told every part, and the records of those of its events that went well.

    Returns
    -------
    Ending
        Early, with the reason, where the state is not finite or the factor cannot be propagated.
    """
    n, n_components = prior.mean.size, sensors.matrix.shape[1]
    width = padded(n + n_components)
    basis = basis_of(point_set)
    work = new_workspace(basis, process, n, n_components, width)
    mean, columns = np.zeros(width), np.zeros((basis.present.size, width))
    mean[:n], columns[:n, :n] = prior.mean, prior.factor.T

    def run(timeline: Timeline, stop: int, records: Records) -> tuple[int, int]:
        model = process.advance, process.observe, process.constants, process.selection, process.noise_density
        return _run(*model, basis, sensors, timeline, stop, n, mean, columns, records, work)

    n_good, culprit = 0, OK
    for timeline in timelines:
        before, records = (mean.copy(), columns.copy()), empty_records(timeline, n)
        done, culprit = run(timeline, timeline.time.size, records)
        n_good += done
        receive(timeline, until(records, done, timeline.reading_offset[min(done + 1, timeline.time.size)]))
        if culprit != OK:
            # Once more from before the part, to stop at the last good state.
            mean[:], columns[:] = before
            run(timeline, done, records)
            break
    factor = columns[:n, :n]
    return Ending(factor.T @ factor, n_good, culprit)
