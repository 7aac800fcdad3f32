"""One square-root filter for every antipodal sigma-point set: CKF, TUKF and UKF.

Points are drawn anew from the factor for each prediction, and for each measurement of a nonlinear sensor. Where a
measurement is linear, every set that integrates degree two gives the Kalman update.
"""

from collections.abc import Iterable

import numpy as np
from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.basis import basis_of
from auvid_cli.filters.measurement import update
from auvid_cli.filters.point_sets import PointSet
from auvid_cli.filters.prediction import predict
from auvid_cli.filters.problem import (
    OK,
    PREDICTION,
    RECORDS,
    TIMELINE,
    FilterOutcome,
    Gaussian,
    ModelData,
    OnChunk,
    Process,
    Sensors,
    Timeline,
    empty_records,
    until,
)
from auvid_cli.filters.sigma_points import all_finite
from auvid_cli.filters.square_root_state import MODEL, STATE, Components, SquareRootModel, State
from auvid_cli.filters.workspace import WORKSPACE, new_workspace, padded

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.void(_matrix, types.int64, _vector, _vector), reassociate=True, internal=True)
def deviations(columns, n, squares, result):
    """Fill in the standard deviations of the state: row norms of the factor. `squares` is overwritten."""
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
    types.UniTuple(types.int64, 2)(*MODEL.types, TIMELINE, STATE, RECORDS, WORKSPACE),
    reassociate=True,
)
def _run(advance, observe, data, components, basis, timeline, state, records, work):
    """Filter a chunk; returns (first event that failed or how many there are, what failed).

    A model comes field by field, since numba takes no functions inside a tuple from Python.
    """
    model = SquareRootModel(advance, observe, data, components, basis)
    n, mean, columns = state.n, state.mean, state.columns
    for event in range(timeline.time.size):
        leads = timeline.substep_offset[event + 1] > timeline.substep_offset[event]
        if leads and not predict(model, state, timeline, event, work):
            return event, PREDICTION
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            nis = update(model, state, timeline, event, k, records, work)
            records.nis[k] = nis
            if not (all_finite(n, mean) and nis >= 0.0):
                return event, timeline.measurement_sensor[k]
        for i in range(n):
            records.mean[event, i] = mean[i]
        deviations(columns, n, work.gain, records.standard_deviation[event])
    return timeline.time.size, OK


def run_square_root_filter(
    point_set: PointSet,
    process: Process,
    sensors: Sensors,
    timelines: Iterable[Timeline],
    prior: Gaussian,
    on_chunk: OnChunk,
) -> FilterOutcome:
    """Filter data with a sigma-point set.

    Parameters
    ----------
    point_set : PointSet
        For the dimension of the state.
    process, sensors, prior
        See `auvid_cli.filters.problem`; the prior is that at the first event.
    timelines : iterable of Timeline
        Chunks of the data in time order; a chunk is worked on at once.
    on_chunk : callable
        Told every chunk, and the records of those of its events that went well.

    Returns
    -------
    FilterOutcome
        Early, with the reason, where the state is not finite or the factor cannot be propagated.
    """
    n, n_components = prior.mean.size, sensors.matrix.shape[1]
    width = padded(n + n_components if sensors.nonlinear.any() else n)
    data, components = ModelData.of(process, sensors), Components.of(sensors)
    model = SquareRootModel(process.advance, process.observe, data, components, basis_of(point_set))
    space = model.basis, process, n, n_components, width
    work = new_workspace(*space)
    state = State.of(prior, model.basis.present.size, width)
    n_good, failure = 0, OK
    for timeline in timelines:
        before, records = state.copy(), empty_records(timeline, n)
        done, failure = _run(*model, timeline, state, records, work)
        n_good += done
        on_chunk(timeline, until(records, done, int(timeline.measurement_offset[min(done + 1, timeline.time.size)])))
        if failure != OK:
            # Once more from before the chunk, to stop at the last good state; what failed may have left anything.
            state, work = before, new_workspace(*space)
            _run(*model, timeline._replace(time=timeline.time[:done]), state, records, work)
            break
    return FilterOutcome(state.covariance(), n_good, failure)
