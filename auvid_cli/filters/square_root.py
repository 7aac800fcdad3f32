"""One square-root filter for every antipodal sigma-point set: CKF, TUKF and UKF.

The covariance is carried as a lower-triangular factor S and never formed, so it cannot lose
definiteness by rounding. Three facts make the filter exact and fast:

* Points are antipodal, so what the process does to them splits into an odd part (what a linear map
  does) and an even part (curvature). In the basis of S the odd part is the matrix ``O = 2 w sum o_k
  delta_k'``; because the directions are an orthogonal basis, ``O O'`` is all of the odd covariance.
* Parameters are constant. Their mean and their rows of S stay as they are; the columns of O that
  belong to them are the new cross block of S, and only the few moving rows are triangularised.
* Measurements are linear, where every set that integrates degree two gives the Kalman update. It
  is applied to S one scalar at a time (Carlson 1973), with no subtraction of covariances. Points are
  drawn anew from S for the next prediction.
"""

from collections.abc import Callable

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from auvid_cli.blocks import JIT_LINEAR_ALGEBRA, LANES
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

Array = NDArray[np.float64]

_HALF = LANES // 2
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
_POINT_SET = types.NamedTuple((_matrix, types.float64, types.boolean, types.float64), PointSet)
_SENSORS = types.NamedTuple((types.float64[:, :, ::1], _matrix, types.boolean[:, ::1]), Sensors)
_TIMELINE = types.NamedTuple((_vector, _indices, _vector, _indices, _matrix, _indices, _indices, _matrix), Timeline)
_RECORDS = types.NamedTuple((_matrix, _matrix, _matrix, _matrix, _vector), Records)

# Events between two reports of progress: about 20 ms of work.
CHUNK = 2000


@njit(types.boolean(_matrix, types.int64, _matrix), **JIT_LINEAR_ALGEBRA)
def triangularise(rows, n_columns, lower):
    """Lower-triangular L with ``L L' = rows rows'``, by modified Gram-Schmidt; overwrites `rows`.

    The triangular factor of modified Gram-Schmidt is as accurate as Householder's (Bjorck 1967).
    False if a row vanishes or is not finite.
    """
    n = rows.shape[0]
    for i in range(n):
        row = rows[i]
        square = 0.0
        for k in range(n_columns):
            square += row[k] * row[k]
        if not (square > 0.0 and square < np.inf):
            return False
        norm = np.sqrt(square)
        lower[i, i] = norm
        for k in range(n_columns):
            row[k] /= norm
        for j in range(i + 1, n):
            other = rows[j]
            dot = 0.0
            for k in range(n_columns):
                dot += other[k] * row[k]
            lower[j, i] = dot
            lower[i, j] = 0.0
            for k in range(n_columns):
                other[k] -= dot * row[k]
    return True


@njit(types.float64(_matrix, _vector, types.float64, _vector, _vector), **JIT_LINEAR_ALGEBRA)
def carlson_update(columns, projection, variance, gain, scratch):
    """Condition the factor on one scalar measurement.

    Parameters
    ----------
    columns : ndarray, shape (n, n)
        Row j holds column j of the lower-triangular factor S. Updated in place.
    projection : ndarray, shape (n,)
        ``S' h`` of the measurement row h.
    variance : float
        Of the measurement noise.
    gain : ndarray, shape (n,)
        Filled with ``S S' h``; divide by the returned value for the Kalman gain.
    scratch : ndarray, shape (n,)
        Overwritten.

    Returns
    -------
    float
        Variance of the innovation.

    Notes
    -----
    ``I - f f' / (variance + f' f)`` has the lower-triangular root L with, for ``a_j = variance +
    sum_{k >= j} f_k^2``, ``L_jj = sqrt(a_{j+1} / a_j)`` and ``L_ij = -f_i f_j / sqrt(a_j a_{j+1})``;
    S L is built column by column from the last (Carlson, AIAA J. 11(9), 1973).
    """
    n = projection.size
    total = variance
    for i in range(n):
        gain[i] = 0.0
    for step in range(n):
        j = n - 1 - step
        f = projection[j]
        if f == 0.0:
            continue
        below = total
        total += f * f
        ratio = np.sqrt(below / total)
        share = f / (total * ratio)
        column = columns[j]
        for i in range(j, n):
            scratch[i] = column[i]
        for i in range(j, n):
            column[i] = ratio * scratch[i] - share * gain[i]
            gain[i] += f * scratch[i]
    return total


@njit(types.void(_vector, _matrix, _matrix, types.int64, types.int64, types.int64, _vector), **JIT_LINEAR_ALGEBRA)
def draw_points(mean, columns, directions, first, count, n_moving, block):
    """Fill one block with the points ``mean +- S delta_k`` for k from `first` on.

    +delta lies in the lower half of the lanes and -delta in the upper; lanes without a direction
    hold the mean. Moving rows come first in a block, then the parameters.
    """
    n = mean.size
    n_parameters = n - n_moving
    for i in range(n):
        lane = i - n_parameters if i >= n_parameters else i + n_moving
        row = block[lane * LANES : (lane + 1) * LANES]
        plus, minus = row[:_HALF], row[_HALF:]
        for k in range(_HALF):
            plus[k] = 0.0
        for j in range(i + 1):
            entry = columns[j, i]
            direction = directions[j, first : first + count]
            for k in range(count):
                plus[k] += entry * direction[k]
        for k in range(_HALF):
            minus[k] = mean[i] - plus[k]
            plus[k] = mean[i] + plus[k]


@njit(
    types.void(_matrix, _POINT_SET, types.int64, _vector, types.float64, _vector, _matrix, _matrix),
    **JIT_LINEAR_ALGEBRA,
)
def collect_points(blocks, point_set, n_moving, noise_density, elapsed, mean, columns, spread):
    """Mean, cross block and covariance rows of the moving states from their propagated points.

    Parameters
    ----------
    blocks : ndarray, shape (n_blocks + 1, n * LANES)
        As drawn and advanced; the last one holds the centre.
    mean, columns : ndarray
        Moving entries of the mean and the cross block of the factor are written.
    spread : ndarray, shape (n_moving, 2 n_moving + n + 1)
        Filled with rows whose Gram matrix is the covariance of the moving states given the
        parameters: odd part by moving directions, even part, shift of the mean, process noise.
    """
    n = mean.size
    n_parameters = n - n_moving
    weight, directions = point_set.weight, point_set.directions
    spread[:] = 0.0
    odd = np.zeros(_HALF)
    for i in range(n_moving):
        row = spread[i]
        for j in range(n_parameters):
            columns[j, n_parameters + i] = 0.0
        centre = blocks[blocks.shape[0] - 1, i * LANES]
        if point_set.centred:
            total = 0.0
            for first in range(0, n, _HALF):
                points = blocks[first // _HALF, i * LANES : (i + 1) * LANES]
                for k in range(min(_HALF, n - first)):
                    total += points[k] + points[_HALF + k]
            centre = weight * total
        shift = 0.0
        for first in range(0, n, _HALF):
            count = min(_HALF, n - first)
            points = blocks[first // _HALF, i * LANES : (i + 1) * LANES]
            even = row[n_moving + first : n_moving + first + count]
            for k in range(count):
                odd[k] = weight * (points[k] - points[_HALF + k])
                even[k] = 0.5 * (points[k] + points[_HALF + k]) - centre
                shift += even[k]
                even[k] *= np.sqrt(2.0 * weight)
            for j in range(n):
                direction = directions[j, first : first + count]
                dot = 0.0
                for k in range(count):
                    dot += odd[k] * direction[k]
                if j < n_parameters:
                    columns[j, n_parameters + i] += dot
                else:
                    row[j - n_parameters] += dot
        shift *= 2.0 * weight
        if point_set.centred:
            mean[n_parameters + i] = centre
        else:
            mean[n_parameters + i] = centre + shift
            row[n_moving + n] = np.sqrt(point_set.curvature) * shift
        row[n_moving + n + 1 + i] = noise_density[i] * np.sqrt(elapsed)


@njit(
    types.boolean(
        types.FunctionType(PROCESS_SIGNATURE),
        *(_vector, _indices, _vector, _POINT_SET),
        *(_matrix, _indices, _vector, _vector, _matrix),
    ),
    **JIT_LINEAR_ALGEBRA,
)
def predict(
    advance, constants, selection, noise_density, point_set, inputs, piece_input, piece_duration, mean, columns
):
    """Move mean and factor over consecutive pieces of constant input, in place.

    Returns
    -------
    bool
        False if the result is not finite or not positive definite.
    """
    n, n_moving = mean.size, noise_density.size
    n_parameters = n - n_moving
    n_blocks = (n + _HALF - 1) // _HALF
    blocks = np.empty((n_blocks + 1, n * LANES))
    for b in range(n_blocks + 1):
        if b == n_blocks and point_set.centred:
            break
        block = blocks[b]
        first = b * _HALF
        count = max(min(_HALF, n - first), 0)
        draw_points(mean, columns, point_set.directions, min(first, n), count, n_moving, block)
        moving, parameters = block[: n_moving * LANES], block[n_moving * LANES :]
        n_lanes = np.uint64(LANES if count > 0 else 1)
        for piece in range(piece_duration.size):
            held = inputs[piece_input[piece]]
            advance(moving, parameters, held, constants, selection, n_lanes, piece_duration[piece])

    spread = np.empty((n_moving, 2 * n_moving + n + 1))
    collect_points(blocks, point_set, n_moving, noise_density, piece_duration.sum(), mean, columns, spread)
    lower = np.empty((n_moving, n_moving))
    if not np.isfinite(mean.sum()) or not triangularise(spread, spread.shape[1], lower):
        return False
    for j in range(n_moving):
        for i in range(j, n_moving):
            columns[n_parameters + j, n_parameters + i] = lower[i, j]
    return True


@njit(types.float64(_vector, _matrix, _vector, _vector, types.boolean, types.float64), **JIT_LINEAR_ALGEBRA)
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


@njit(types.float64(_SENSORS, types.int64, _vector, _vector, _matrix, _vector, _vector), **JIT_LINEAR_ALGEBRA)
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


@njit(
    types.UniTuple(types.int64, 2)(
        types.FunctionType(PROCESS_SIGNATURE),
        *(_vector, _indices, _vector, _POINT_SET, _SENSORS, _TIMELINE),
        *(types.int64, types.int64, _vector, _matrix, _RECORDS),
    ),
    **JIT_LINEAR_ALGEBRA,
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
    progress: Callable[[int], None],
) -> History:
    """Filter a timeline with a sigma-point set.

    Parameters
    ----------
    point_set : PointSet
        For the dimension of the state.
    process, sensors, timeline, prior
        See `auvid_cli.filters.problem`.
    progress : callable
        Told the number of events done, now and then.

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
        progress(done)
    return History(records, columns.T @ columns, done, culprit)
