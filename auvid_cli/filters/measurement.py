"""Measurement update of the square-root filter, for linear and nonlinear sensors alike.

Every component is a combination of rows of the factor. A linear sensor's are those of the state. A nonlinear sensor's
ride along with the state as further rows: what one component says changes the prediction of the next as it changes the
state. They are the odd part of what it makes of the sigma points; the even part adds to its noise and correlates the
components, which a triangular factor takes apart again. Then every sensor is applied one scalar at a time.
"""

import numpy as np
from numba import types

from auvid_cli.angles import wrap
from auvid_cli.compilation import compiled
from auvid_cli.filters.basis import lanes_of, n_blocks
from auvid_cli.filters.factor import carlson_update, triangularise
from auvid_cli.filters.problem import RECORDS, TIMELINE
from auvid_cli.filters.sigma_points import collect_points, draw_points
from auvid_cli.filters.square_root_state import COMPONENTS, MODEL, STATE
from auvid_cli.filters.workspace import WORKSPACE
from auvid_cli.lanes import LANES

_vector = types.float64[::1]


_wrap = compiled(types.float64(types.float64), inline=True)(wrap)


@compiled(types.float64(types.float64, types.boolean), internal=True)
def wrapped(difference, angular):
    """Bring a difference of angles to [-pi, pi), and leave any other as it is."""
    return _wrap(difference) if angular else difference


@compiled(types.void(COMPONENTS, types.int64, STATE, _vector), reassociate=True, inline=True)
def gather(components, which, state, measured):
    """Fill in the row of a component in the basis of the factor; `which` counts the components of all sensors."""
    n, columns = state.n, state.columns
    for j in range(measured.size):
        measured[j] = 0.0
    for entry in range(components.begin[which], components.begin[which + 1]):
        place, weight = components.place[entry], components.weight[entry]
        for j in range(n):
            measured[j] += weight * columns[j, place]


@compiled(types.float64(COMPONENTS, types.int64, _vector), inline=True)
def combined(components, which, values):
    """Add up values of the rows of the factor to that of a component."""
    total = 0.0
    for entry in range(components.begin[which], components.begin[which + 1]):
        total += components.weight[entry] * values[components.place[entry]]
    return total


@compiled(types.void(MODEL, STATE, TIMELINE, types.int64, types.int64, WORKSPACE), reassociate=True, internal=True)
def predict_nonlinearly(model, state, timeline, event, sensor, work):
    """Put a sensor's components behind the n-th place of mean and factor, and the even part in ``work.spread``."""
    n, mean, columns, data = state.n, state.mean, state.columns, model.data
    n_moving, n_components = data.noise_density.size, timeline.measurement.shape[1]
    inputs = timeline.inputs[timeline.event_input[event]]
    draw_points(model.basis, state, n_moving, work)
    for b in range(n_blocks(model.basis)):
        moving, parameters = work.points[b, : n_moving * LANES], work.points[b, n_moving * LANES :]
        n_lanes = lanes_of(model.basis, b)
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
    """Predict a measurement, and select the components that are present and within the gate.

    ``work.component`` says which they are, ``work.error`` and ``work.noise`` get their innovations and the variances of
    their noise; returns how many they are. Parameters as of `update`.
    """
    components, m, sensors, measured = model.components, model.basis.present.size, model.data.sensors, work.measured
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
        s, which, noise = n_present, sensor * measurement.size + c, sensors.variance[sensor, c]
        gather(components, which, state, measured)
        total = noise
        for j in range(m):
            total += measured[j] * measured[j]
        if nonlinear:
            for i in range(m + 1):
                even = work.spread[c, i]
                work.spread[s, i] = even
                total += even * even
            for i in range(measurement.size):
                work.spread[s, m + 1 + i] = np.sqrt(noise) if i == s else 0.0
        difference = measurement[c] - combined(components, which, state.mean)
        innovation[c] = wrapped(difference, sensors.angular[sensor, c])
        if innovation[c] ** 2 > sensors.gate * total:
            continue
        n_present += 1
        variance[c] = total
        work.component[s] = c
        work.error[s] = innovation[c]
        work.noise[s] = noise
    return n_present


@compiled(types.boolean(STATE, types.int64, WORKSPACE), reassociate=True, inline=True)
def decorrelate(state, n_present, work):
    """Replace what is predicted by combinations of it whose noise is independent; ``work.noise`` gets its variance.

    With ``L L'`` the covariance of the noise in ``work.spread``, the combinations are the rows of the inverse
    of L scaled to a unit diagonal. False if it has no factor.
    """
    n, columns, lower, component = state.n, state.columns, work.lower, work.component
    if not triangularise(work.spread, n_present, lower):
        return False
    for s in range(n_present):
        for b in range(s):
            share = lower[s, b] / lower[b, b]
            work.error[s] -= share * work.error[b]
            for j in range(n):
                columns[j, n + component[s]] -= share * columns[j, n + component[b]]
        work.noise[s] = lower[s, s] ** 2
    return True


@compiled(types.float64(COMPONENTS, types.int64, STATE, types.int64, WORKSPACE), reassociate=True, inline=True)
def condition(components, first, state, n_present, work):
    """Condition on components with independent noise, one after the other; returns the sum of their NIS.

    `first` is the sensor's first component among those of all sensors.
    """
    n, mean, columns, gain, measured = state.n, state.mean, state.columns, work.gain, work.measured
    nis = 0.0
    for s in range(n_present):
        gather(components, first + work.component[s], state, measured)
        total = carlson_update(columns, n, measured, work.noise[s], gain, work.ratio, work.share)
        step = work.error[s] / total
        nis += work.error[s] * step
        for i in range(gain.size):
            mean[i] += gain[i] * step
        # The innovations of the others move with the state, and are carried on rather than subtracted anew.
        for other in range(s + 1, n_present):
            work.error[other] -= combined(components, first + work.component[other], gain) * step
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
    sensor = timeline.measurement_sensor[k]
    if model.data.sensors.nonlinear[sensor] and not decorrelate(state, n_present, work):
        return np.nan
    return condition(model.components, sensor * timeline.measurement.shape[1], state, n_present, work)
