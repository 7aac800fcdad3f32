"""Measurement update of the square-root filter, for linear and nonlinear sensors alike.

The predicted measurement rides along with the state as further rows of the factor: what one component says
changes the prediction of the next as it changes the state. A linear sensor's rows are combinations of the
state's. A nonlinear sensor's are the odd part of what it makes of the sigma points; the even part adds to its
noise and correlates the components, which a triangular factor takes apart again. Then every sensor is
applied one scalar at a time.
"""

import numpy as np
from numba import types

from auvid_cli.angles import wrap
from auvid_cli.compilation import compiled
from auvid_cli.filters.basis import blocks_and_lanes
from auvid_cli.filters.factor import carlson_update, triangularise
from auvid_cli.filters.problem import RECORDS, TIMELINE
from auvid_cli.filters.sigma_points import collect_points, draw_points
from auvid_cli.filters.square_root_state import MODEL, STATE
from auvid_cli.filters.workspace import WORKSPACE
from auvid_cli.lanes import LANES

_vector = types.float64[::1]


_wrap = compiled(types.float64(types.float64), inline=True)(wrap)


@compiled(types.float64(types.float64, types.boolean))
def wrapped(difference, angular):
    """Bring a difference of angles to [-pi, pi), and leave any other as it is."""
    return _wrap(difference) if angular else difference


@compiled(types.void(_vector, STATE, types.int64), reassociate=True, inline=True)
def predict_linearly(row, state, place):
    """Put a combination of the state's rows at `place` of mean and factor."""
    mean, columns = state.mean, state.columns
    predicted = 0.0
    for j in range(state.n):
        columns[j, place] = 0.0
    for i in range(state.n):
        h = row[i]
        if h != 0.0:
            predicted += h * mean[i]
            for j in range(i + 1):
                columns[j, place] += h * columns[j, i]
    mean[place] = predicted


@compiled(types.void(MODEL, STATE, TIMELINE, types.int64, types.int64, WORKSPACE), reassociate=True, internal=True)
def predict_nonlinearly(model, state, timeline, event, sensor, work):
    """Put a sensor's components behind the n-th place of mean and factor, and the even part in ``work.spread``."""
    n, mean, columns, data = state.n, state.mean, state.columns, model.data
    n_moving, n_components = data.noise_density.size, timeline.measurement.shape[1]
    inputs = timeline.inputs[timeline.event_input[event]]
    draw_points(model.basis, state, n_moving, work)
    n_blocks, last_lanes = blocks_and_lanes(model.basis)
    for b in range(n_blocks):
        moving, parameters = work.points[b, : n_moving * LANES], work.points[b, n_moving * LANES :]
        n_lanes = np.uint64(last_lanes if b == n_blocks - 1 else LANES)
        model.observe(
            *(moving, parameters, sensor, inputs, data.constants, data.selection, n_lanes),
            work.images[b],
            work.process,
        )
    for i in range(work.spread.shape[0]):
        for k in range(work.spread.shape[1]):
            work.spread[i, k] = 0.0
    collect_points(work.images, model.basis, n_components, 0, mean[n : n + n_components], work)
    for c in range(n_components):
        for j in range(n):
            columns[j, n + c] = work.regression[c, j]


@compiled(
    types.int64(MODEL, STATE, TIMELINE, types.int64, types.int64, RECORDS, WORKSPACE), reassociate=True, inline=True
)
def select(model, state, timeline, event, k, records, work):
    """Predict the components of a measurement that are present and within the gate, one behind the other.

    ``work.error`` and ``work.noise`` get their innovations and the variances of their noise; returns how many they
    are. Parameters as of `update`.
    """
    n, mean, columns, m, sensors = state.n, state.mean, state.columns, model.basis.present.size, model.data.sensors
    measurement, sensor = timeline.measurement[k], timeline.measurement_sensor[k]
    innovation, variance = records.innovation[k], records.innovation_variance[k]
    nonlinear = sensors.nonlinear[sensor]
    if nonlinear:
        predict_nonlinearly(model, state, timeline, event, sensor, work)
    n_present = 0
    for c in range(measurement.size):
        innovation[c] = np.nan
        variance[c] = np.nan
        if np.isnan(measurement[c]):
            continue
        s, noise = n_present, sensors.variance[sensor, c]
        total = noise
        if nonlinear:
            mean[n + s] = mean[n + c]
            for j in range(n):
                columns[j, n + s] = columns[j, n + c]
            for i in range(m + 1):
                even = work.spread[c, i]
                work.spread[s, i] = even
                total += even * even
            for i in range(measurement.size):
                work.spread[s, m + 1 + i] = np.sqrt(noise) if i == s else 0.0
        else:
            predict_linearly(sensors.matrix[sensor, c], state, n + s)
        for j in range(n):
            total += columns[j, n + s] * columns[j, n + s]
        innovation[c] = wrapped(measurement[c] - mean[n + s], sensors.angular[sensor, c])
        if innovation[c] ** 2 > sensors.gate * total:
            continue
        n_present += 1
        variance[c] = total
        work.error[s] = innovation[c]
        work.noise[s] = noise
    return n_present


@compiled(types.boolean(STATE, types.int64, WORKSPACE), reassociate=True, inline=True)
def decorrelate(state, n_present, work):
    """Replace what is predicted by combinations of it whose noise is independent; ``work.noise`` gets its variance.

    With ``L L'`` the covariance of the noise in ``work.spread``, the combinations are the rows of the inverse
    of L scaled to a unit diagonal. False if it has no factor.
    """
    n, columns, lower = state.n, state.columns, work.lower
    if not triangularise(work.spread, n_present, lower):
        return False
    for s in range(n_present):
        for b in range(s):
            share = lower[s, b] / lower[b, b]
            work.error[s] -= share * work.error[b]
            for j in range(n):
                columns[j, n + s] -= share * columns[j, n + b]
        work.noise[s] = lower[s, s] ** 2
    return True


@compiled(types.float64(STATE, types.int64, WORKSPACE), reassociate=True, inline=True)
def condition(state, n_present, work):
    """Condition on components with independent noise, one after the other; returns the sum of their NIS."""
    n, mean, columns = state.n, state.mean, state.columns
    width = columns.shape[1]
    for s in range(n_present):
        # The riding mean is minus the innovation, so that the update below carries that on too.
        mean[n + s] = -work.error[s]
    nis = 0.0
    for s in range(n_present):
        error = -mean[n + s]
        total = carlson_update(columns, n, n + s, work.noise[s], work.gain, work.ratio, work.share)
        nis += error * error / total
        step = error / total
        for i in range(width):
            mean[i] += work.gain[i] * step
    return nis


@compiled(
    types.float64(MODEL, STATE, TIMELINE, types.int64, types.int64, RECORDS, WORKSPACE), reassociate=True, inline=True
)
def update(model, state, timeline, event, k, records, work):
    """Condition on one measurement; components that are missing or outside the gate are left out.

    Parameters
    ----------
    model : Model
    state : State
        Conditioned in place.
    timeline : Timeline
    event, k : int
        The event, and the measurement taken there.
    records : Records
        Of that measurement is filled in: the joint innovation before the update, and the variance of each component,
        NaN for one outside the gate.
    work : Workspace
        Overwritten.

    Returns
    -------
    float
        Normalised innovation squared of the whole measurement; NaN or negative where the update failed.
    """
    n_present = select(model, state, timeline, event, k, records, work)
    if model.data.sensors.nonlinear[timeline.measurement_sensor[k]] and not decorrelate(state, n_present, work):
        return np.nan
    return condition(state, n_present, work)
