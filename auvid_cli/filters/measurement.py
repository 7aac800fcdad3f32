"""Measurement update of the square-root filter, for linear and nonlinear sensors alike.

The predicted measurement rides along with the state as further rows of the factor: what one component says
changes the prediction of the next as it changes the state. A linear sensor's rows are combinations of the
state's. A nonlinear sensor's are the odd part of what it makes of the sigma points; the even part adds to its
noise and correlates the components, which a triangular factor takes apart again. Then every sensor is
applied one scalar at a time.
"""

import numpy as np
from numba import types

from auvid_cli.blocks import LANES
from auvid_cli.compilation import compiled
from auvid_cli.filters.factor import carlson_update, triangularise
from auvid_cli.filters.problem import OBSERVATION_SIGNATURE, Sensors
from auvid_cli.filters.sigma_points import BASIS, blocks_and_lanes, collect_points, draw_points
from auvid_cli.filters.workspace import WORKSPACE

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
SENSORS = types.NamedTuple(
    (types.float64[:, :, ::1], _matrix, types.boolean[:, ::1], types.boolean[::1], types.float64),
    Sensors,
)


@compiled(types.float64(types.float64, types.boolean))
def wrapped(difference, angular):
    """A difference of angles, to [-pi, pi); any other as it is."""
    if angular:
        return difference - 2.0 * np.pi * np.floor(difference / (2.0 * np.pi) + 0.5)
    return difference


@compiled(types.void(_vector, types.int64, _vector, _matrix, types.int64), reassociate=True, inline=True)
def see_linearly(row, n, mean, columns, place):
    """Put a combination of the state's rows at `place` of mean and factor."""
    predicted = 0.0
    for j in range(n):
        columns[j, place] = 0.0
    for i in range(n):
        h = row[i]
        if h != 0.0:
            predicted += h * mean[i]
            for j in range(i + 1):
                columns[j, place] += h * columns[j, i]
    mean[place] = predicted


@compiled(
    types.void(
        types.FunctionType(OBSERVATION_SIGNATURE),
        *(_vector, _indices, types.int64, BASIS, types.int64, types.int64, types.int64),
        *(_vector, _matrix, WORKSPACE),
    ),
    reassociate=True,
    inline=True,
)
def see_nonlinearly(observe, constants, selection, n_moving, basis, sensor, n_components, n, mean, columns, work):
    """Put a sensor's components behind the n-th place of mean and factor, and the even part in ``work.spread``."""
    draw_points(basis, mean, columns, n, n_moving, work.product, work.points)
    n_blocks, last_lanes = blocks_and_lanes(basis)
    for b in range(n_blocks):
        moving, parameters = work.points[b, : n_moving * LANES], work.points[b, n_moving * LANES :]
        n_lanes = np.uint64(last_lanes if b == n_blocks - 1 else LANES)
        observe(moving, parameters, sensor, constants, selection, n_lanes, work.images[b])
    for i in range(work.spread.shape[0]):
        for k in range(work.spread.shape[1]):
            work.spread[i, k] = 0.0
    collect_points(
        work.images,
        basis,
        n_components,
        0,
        mean[n : n + n_components],
        work.odd,
        work.regression,
        work.spread,
        work.product,
    )
    for c in range(n_components):
        for j in range(n):
            columns[j, n + c] = work.regression[c, j]


@compiled(types.boolean(types.int64, types.int64, _matrix, WORKSPACE), reassociate=True, inline=True)
def decorrelate(n, n_present, columns, work):
    """Replace what is seen by combinations of it whose noise is independent; ``work.noise`` gets its variance.

    With ``L L'`` the covariance of the noise in ``work.spread``, the combinations are the rows of the inverse
    of L scaled to a unit diagonal. False if it has no factor.
    """
    lower = work.lower
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


@compiled(
    types.float64(
        types.FunctionType(OBSERVATION_SIGNATURE),
        *(_vector, _indices, types.int64, BASIS, SENSORS, types.int64, _vector, types.int64),
        *(_vector, _matrix, _vector, _vector, WORKSPACE),
    ),
    reassociate=True,
    inline=True,
)
def update(
    observe,
    constants,
    selection,
    n_moving,
    basis,
    sensors,
    sensor,
    reading,
    n,
    mean,
    columns,
    innovation,
    variance,
    work,
):
    """Condition on one reading; components that are missing or beyond the gate are left out.

    Parameters
    ----------
    innovation, variance : ndarray, shape (c,)
        Filled with the joint innovation before the update and the variance of each component; the latter is
        NaN for one beyond the gate.

    Returns
    -------
    float
        Normalised innovation squared of the whole reading; NaN or negative where the update failed.
    """
    nonlinear = sensors.nonlinear[sensor]
    if nonlinear:
        see_nonlinearly(observe, constants, selection, n_moving, basis, sensor, reading.size, n, mean, columns, work)
    n_present = 0
    for c in range(reading.size):
        innovation[c] = np.nan
        variance[c] = np.nan
        if np.isnan(reading[c]):
            continue
        s, noise = n_present, sensors.variance[sensor, c]
        n_present += 1
        total = noise
        if nonlinear:
            mean[n + s] = mean[n + c]
            for j in range(n):
                columns[j, n + s] = columns[j, n + c]
            for k in range(basis.present.size + 1):
                even = work.spread[c, k]
                work.spread[s, k] = even
                total += even * even
            for k in range(reading.size):
                work.spread[s, basis.present.size + 1 + k] = np.sqrt(noise) if k == s else 0.0
        else:
            see_linearly(sensors.matrix[sensor, c], n, mean, columns, n + s)
        for j in range(n):
            total += columns[j, n + s] * columns[j, n + s]
        innovation[c] = wrapped(reading[c] - mean[n + s], sensors.angular[sensor, c])
        if innovation[c] ** 2 > sensors.gate * total:
            n_present -= 1
            continue
        variance[c] = total
        work.error[s] = innovation[c]
        work.noise[s] = noise
    if nonlinear and not decorrelate(n, n_present, columns, work):
        return np.nan
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
