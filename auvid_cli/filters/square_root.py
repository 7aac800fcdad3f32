"""Square-root sigma-point filters (CKF, TUKF and UKF).

Arasaratnam and Haykin, IEEE Trans. Autom. Control 54(6), 2009, with sequential measurement updates.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from auvid_cli.filters.factor import triangularise
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
)
from auvid_cli.filters.sigma_points import all_finite, collect_points, draw_points, update
from auvid_cli.filters.workspace import (
    MODEL,
    STATE,
    WORKSPACE,
    Components,
    PointSet,
    SquareRootModel,
    State,
    basis_of,
    lanes_of,
    n_blocks,
    new_workspace,
    padded,
)
from auvid_cli.numerics import LANES, compiled, types

if TYPE_CHECKING:
    pass

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(reassociate=True, inline=True)
def predict(model, state, timeline, event, work):
    """Predict a state to an event, in place; False if the result is not finite or not positive definite."""
    data, basis = model.data, model.basis
    n, mean, columns = state.n, state.mean, state.columns
    n_moving = data.noise_density.size
    n_parameters = n - n_moving
    m = basis.present.size
    first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
    substep_input, substep_duration = timeline.substep_input[first:last], timeline.substep_duration[first:last]
    elapsed = 0.0
    for substep in range(substep_duration.size):
        elapsed += substep_duration[substep]
    draw_points(basis, state, n_moving, work)
    for b in range(n_blocks(basis)):
        moving, parameters = work.points[b, : n_moving * LANES], work.points[b, n_moving * LANES :]
        n_lanes = lanes_of(basis, b)
        for substep in range(substep_duration.size):
            held, duration = timeline.inputs[substep_input[substep]], substep_duration[substep]
            model.advance(moving, parameters, held, data.constants, data.selection, n_lanes, duration, work.process)

    spread, noisy = work.spread, n_moving + m + 1
    collect_points(work.points, basis, n_moving, n_moving, mean[n_parameters:n], work)
    for i in range(n_moving):
        for j in range(n_parameters):
            columns[j, n_parameters + i] = work.regression[i, j]
        for j in range(n_moving):
            spread[i, j] = work.regression[i, n_parameters + j]
        for k in range(noisy, spread.shape[1]):
            spread[i, k] = 0.0
        spread[i, noisy + i] = data.noise_density[i] * np.sqrt(elapsed)
    if not all_finite(n, mean) or not triangularise(spread, n_moving, work.lower):
        return False
    for j in range(n_moving):
        for i in range(j, n_moving):
            columns[n_parameters + j, n_parameters + i] = work.lower[i, j]
    return True


@compiled(reassociate=True)
def deviations(columns, n, squares, result):
    """Fill in the standard deviations of the state, the row norms of the factor; `squares` is scratch."""
    width = columns.shape[1]
    for i in range(width):
        squares[i] = 0.0
    for j in range(0, n, 2):
        column0, column1 = columns[j], columns[j + 1]
        for i in range(width):
            squares[i] += column0[i] * column0[i] + column1[i] * column1[i]
    for i in range(n):
        result[i] = np.sqrt(squares[i])


@compiled(types.UniTuple(types.int64, 2)(*MODEL.types, TIMELINE, STATE, RECORDS, WORKSPACE), reassociate=True)
def _run(advance, observe, data, components, basis, timeline, state, records, work):
    """Filter a chunk; returns the number of good events, and the failure or `OK`.

    The first arguments are the fields of a model, because numba does not accept functions in a tuple from Python.
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
    process : Process
    sensors : Sensors
    timelines : iterable of Timeline
        Chunks of the data in time order.
    prior : Gaussian
        State at the first event.
    on_chunk : callable
        Receives each chunk, and the records of its good events.

    Returns
    -------
    FilterOutcome
        With a failure if the state is not finite or its covariance not positive definite.
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
        on_chunk(timeline, records.truncate(done, int(timeline.measurement_offset[min(done + 1, timeline.time.size)])))
        if failure != OK:
            # Repeat the chunk up to the last good event: state and workspace are invalid after a failure.
            state, work = before, new_workspace(*space)
            _run(*model, timeline._replace(time=timeline.time[:done]), state, records, work)
            break
    return FilterOutcome(state.covariance(), n_good, failure)
