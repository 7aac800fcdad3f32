"""Forward pass of the smoother: a square-root Kalman filter of deviations from a trajectory, with Huber's weights.

The linear problem about the trajectory x_k has the deviations ``d_k = F_k d_{k-1} + defect_k + noise`` and the
residuals ``r_k = H_k d_k + noise``. Parameters are constant, so only the moving rows of transitions and covariances are
stored. A residual r with standard deviation s counts with the weight ``w = 1 / sqrt(max((r / (threshold s))^2, 1))``:
its noise has the variance ``s^2 / w`` (Huber, Ann. Math. Statist. 35(1), 1964).
"""

from typing import Any, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.factor import TILE, carlson_update, triangularise
from auvid_cli.filters.problem import (
    LINEARISATION_SIGNATURE,
    MODEL_DATA,
    SENSORS_TYPE,
    TIMELINE,
    TRANSITION_SIGNATURE,
    Gaussian,
    Process,
)
from auvid_cli.filters.sigma_points import four_products, wrapped
from auvid_cli.filters.workspace import STATE, State, padded
from auvid_cli.numerics import compiled, types, zeros_on_lines

# Threshold of Huber's weights, in standard deviations of the noise: clean data lose 1 % of their information.
THRESHOLD = 2.0
# Smallest weight of a component that is not an outlier; Gaussian noise has a smaller one once in 10 000 times.
MIN_WEIGHT = 0.5
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
# Rows of a tile of moving states.
_ROWS = 16
_products = four_products(_ROWS)


def weight(square: Any, threshold: float) -> Any:
    """Return Huber's weights of normalised squared residuals."""
    return 1.0 / np.sqrt(np.maximum(square / threshold**2, 1.0))


class Linearised(NamedTuple):
    """Chunk of the data, linearised about a trajectory."""

    parameters: Array  # shape (n_parameters,)
    before: Array  # shape (n_moving,); moving states of the trajectory at the event before the chunk
    moving: Array  # shape (n_events, n_moving); moving states at each event
    residual: Array  # shape (n_measurements, c); measured less predicted; NaN if missing
    rows: Array  # shape (n_measurements, c, n); measurement matrix; without the first columns if parameters are given
    # Shape (n_events, n_moving); prediction from the previous event minus the trajectory; zero without substeps
    defect: Array
    # Shape (n_events, n_moving, n); moving rows of the transition from the previous event; undefined without substeps.
    # Without the first columns if parameters are given
    transition: Array


class AccumulatedNoise(NamedTuple):
    """Process noise accumulated before each event of a chunk, as in `accumulated_noise`."""

    variance: Array  # shape (n_events, n_moving)
    half_elapsed: Array  # shape (n_events,); half the time since the previous event, s
    driven: Array  # shape (n_moving, n_moving) or (0, 0); see `auvid_cli.filters.problem.Process`


ACCUMULATED_NOISE = types.NamedTuple((_matrix, _vector, _matrix), AccumulatedNoise)


class ForwardPass(NamedTuple):
    """Results of the forward pass through a chunk."""

    filtered: Array  # shape (n_events, n); deviation after the measurements of each event
    covariance: Array  # shape (n_events, n_moving, n); moving rows of its covariance
    # `gain`, `total` and `error` are those of sequential updates, component by component.
    gain: Array  # shape (n_measurements, c, n); covariance of the state with each innovation
    total: Array  # shape (n_measurements, c); variance of each innovation
    error: Array  # shape (n_measurements, c); value of each innovation
    # `innovation` and `variance` are those before any update with the measurement.
    innovation: Array  # shape (n_measurements, c); NaN if missing
    variance: Array  # shape (n_measurements, c); variance of `innovation`; NaN if missing
    weight: Array  # shape (n_measurements, c); Huber's weights

    @classmethod
    def of(cls, about: Linearised) -> "ForwardPass":
        """Return the arrays for a chunk."""
        (n_events, n_moving), (n_measurements, n_components, n) = about.moving.shape, about.rows.shape
        return cls(
            np.empty((n_events, n)),
            np.empty((n_events, n_moving, n)),
            np.empty((n_measurements, n_components, n)),
            *(np.ones((n_measurements, n_components)) for _ in range(2)),
            *(np.full((n_measurements, n_components), np.nan) for _ in range(2)),
            weight=np.ones((n_measurements, n_components)),
        )


class SmootherWorkspace(NamedTuple):
    """Scratch arrays."""

    point: Array  # shape (n,)
    matrix: Array  # shape (n, n)
    # Shape (n_tiles, width * _ROWS); moving rows of a transition or of the factor in tiles of `_ROWS` rows, each
    # transposed and padded with zeros
    transposed: Array
    moved: Array  # shape (n_tiles, _ROWS); moving rows of the mean
    product: Array  # shape (n_tiles, 4 * _ROWS); product of the tiles with four columns, or rows, of the factor
    spread: Array  # shape (n_moving, whole tiles)
    lower: Array  # shape (n_moving, n_moving)
    gain: Array  # shape (width,)
    measured: Array  # shape (width + 1,)
    ratio: Array  # shape (width + 1,)
    share: Array  # shape (width + 1,)
    predictions: Array  # shape (c,); predicted measurement of a sensor
    rows: Array  # shape (c, n); derivative of a nonlinear sensor
    process: Array  # scratch of the process

    @classmethod
    def of(cls, process: Process, n: int, n_components: int) -> "SmootherWorkspace":
        """Return the arrays for n states and sensors of up to `n_components`."""
        n_moving = process.noise_density.size
        width, n_parts = padded(n), -(-n_moving // _ROWS)
        return cls(
            point=zeros_on_lines(n),
            matrix=np.eye(n),
            transposed=zeros_on_lines(n_parts, width * _ROWS),
            moved=zeros_on_lines(n_parts, _ROWS),
            product=zeros_on_lines(n_parts, 4 * _ROWS),
            spread=zeros_on_lines(n_moving, padded(2 * n_moving)),
            lower=zeros_on_lines(n_moving, n_moving),
            gain=zeros_on_lines(width),
            measured=zeros_on_lines(width + 1),
            ratio=zeros_on_lines(width + 1),
            share=zeros_on_lines(width + 1),
            predictions=zeros_on_lines(n_components),
            rows=zeros_on_lines(n_components, n),
            process=zeros_on_lines(process.scratch_size),
        )


def new_state(gaussian: Gaussian) -> State:
    """Return a Gaussian in the layout of the compiled loops."""
    width = padded(gaussian.mean.size)
    return State.of(gaussian, width, width)


LINEARISED = types.NamedTuple((_vector, _vector, _matrix, _matrix, _stack, _matrix, _stack), Linearised)


FORWARD_PASS = types.NamedTuple((_matrix, _stack, _stack, *[_matrix] * 5), ForwardPass)


SMOOTHER_WORKSPACE = types.NamedTuple((_vector, *[_matrix] * 6, *[_vector] * 5, _matrix, _vector), SmootherWorkspace)


_weight = compiled(inline=True)(weight)


@compiled(types.void(types.FunctionType(LINEARISATION_SIGNATURE), MODEL_DATA, TIMELINE, LINEARISED, SMOOTHER_WORKSPACE))
def linearise_measurements(linearise, data, timeline, about, work):
    """Fill in residuals and derivatives."""
    sensors, constants, selection, predictions = data.sensors, data.constants, data.selection, work.predictions
    n_parameters = about.parameters.size
    n = n_parameters + about.moving.shape[1]
    # Columns of given parameters are left out.
    left_out = n - about.rows.shape[2]
    for event in range(timeline.time.size):
        for i in range(n):
            work.point[i] = about.parameters[i] if i < n_parameters else about.moving[event, i - n_parameters]
        inputs = timeline.inputs[timeline.event_input[event]]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            sensor = timeline.measurement_sensor[k]
            nonlinear = sensors.nonlinear[sensor]
            if nonlinear:
                for c in range(work.rows.shape[0]):
                    for i in range(n):
                        work.rows[c, i] = 0.0
                linearise(work.point, sensor, inputs, constants, selection, predictions, work.rows, work.process)
            for c in range(about.residual.shape[1]):
                predicted = predictions[c] if nonlinear else 0.0
                for i in range(n):
                    h = work.rows[c, i] if nonlinear else sensors.matrix[sensor, c, i]
                    if i >= left_out:
                        about.rows[k, c, i - left_out] = h
                    if h != 0.0 and not nonlinear:
                        predicted += h * work.point[i]
                difference = timeline.measurement[k, c] - predicted
                about.residual[k, c] = wrapped(difference, sensors.angular[sensor, c])


@compiled(types.void(types.FunctionType(TRANSITION_SIGNATURE), MODEL_DATA, TIMELINE, LINEARISED, SMOOTHER_WORKSPACE))
def linearise_process(transition, data, timeline, about, work):
    """Fill in transitions and defects."""
    n_moving, n_parameters, moved = about.moving.shape[1], about.parameters.size, work.point
    n_columns = about.transition.shape[2]
    left_out = moved.size - n_columns
    for event in range(timeline.time.size):
        first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
        if last > first:
            for j in range(n_parameters):
                moved[j] = about.parameters[j]
            for i in range(n_moving):
                moved[n_parameters + i] = about.before[i] if event == 0 else about.moving[event - 1, i]
            substeps = timeline.substep_input[first:last], timeline.substep_duration[first:last]
            inputs, constants, selection = timeline.inputs, data.constants, data.selection
            transition(moved, inputs, substeps[0], substeps[1], constants, selection, work.matrix, work.process)
            for i in range(n_moving):
                about.defect[event, i] = moved[n_parameters + i] - about.moving[event, i]
                for j in range(n_columns):
                    about.transition[event, i, j] = work.matrix[n_parameters + i, left_out + j]


@compiled(reassociate=True)
def _transpose_tiles(transition, mean, work):
    """Transpose the moving rows of a transition into tiles, and multiply the mean by them."""
    n_moving, n = transition.shape
    for part in range(work.transposed.shape[0]):
        transposed, moved, first = work.transposed[part], work.moved[part], part * _ROWS
        for i in range(min(_ROWS, n_moving - first)):
            for k in range(n):
                transposed[k * _ROWS + i] = transition[first + i, k]
        for i in range(_ROWS):
            moved[i] = 0.0
        for k in range(n):
            for i in range(_ROWS):
                moved[i] += mean[k] * transposed[k * _ROWS + i]


@compiled(reassociate=True)
def _predict(transition, event, noise, state, work):
    """Predict mean and factor of the deviation; False if the covariance is not positive definite."""
    n, mean, columns, spread, product = state.n, state.mean, state.columns, work.spread, work.product
    n_moving, width, n_parts = noise.variance.shape[1], columns.shape[1], work.transposed.shape[0]
    n_parameters = n - n_moving
    factor = columns.reshape(-1)
    _transpose_tiles(transition, mean, work)
    for i in range(n_moving):
        mean[n_parameters + i] = work.moved[i // _ROWS, i % _ROWS]
        for k in range(spread.shape[1]):
            spread[i, k] = 0.0
        spread[i, n_moving + i] = np.sqrt(noise.variance[event, i])
        for j in range(noise.driven.shape[1]):
            share = noise.half_elapsed[event] * noise.driven[i, j]
            if share != 0.0:
                spread[i, n_moving + j] = share * np.sqrt(noise.variance[event, j])
    # Four columns at a time, from the edge of a tile: entries before the diagonal are zero.
    for j in range(0, n, 4):
        edge = j // TILE * TILE
        first, n_terms = j * width + edge, n - edge
        for part in range(n_parts):
            _products(factor, first, width, 1, n_terms, work.transposed[part, edge * _ROWS :], product[part])
        for r in range(min(4, n - j)):
            for i in range(n_moving):
                moved = product[i // _ROWS, r * _ROWS + i % _ROWS]
                if j + r < n_parameters:
                    columns[j + r, n_parameters + i] = moved
                else:
                    spread[i, j + r - n_parameters] = moved
    if not triangularise(spread, n_moving, work.lower):
        return False
    for j in range(n_moving):
        for i in range(j, n_moving):
            columns[n_parameters + j, n_parameters + i] = work.lower[i, j]
    return True


@compiled(reassociate=True, inline=True)
def _project_row(row, state, measured):
    """Fill in the product of a measurement row with the factor."""
    columns = state.columns
    for j in range(state.n):
        measured[j] = 0.0
    for i in range(state.n):
        h = row[i]
        if h != 0.0:
            for j in range(i + 1):
                measured[j] += h * columns[j, i]


@compiled(reassociate=True, inline=True)
def _dot(row, values):
    total = 0.0
    for i in range(row.size):
        total += row[i] * values[i]
    return total


@compiled(reassociate=True)
def _update(k, rows, noise, about, state, forward_pass, work):
    """Update with measurement k, component by component; returns its NIS."""
    n, mean, columns, measured, error = state.n, state.mean, state.columns, work.measured, forward_pass.error[k]
    for c in range(rows.shape[0]):
        forward_pass.innovation[k, c] = np.nan
        forward_pass.variance[k, c] = np.nan
        if np.isnan(about.residual[k, c]):
            continue
        _project_row(rows[c], state, measured)
        total = noise[c] / forward_pass.weight[k, c]
        for j in range(n):
            total += measured[j] * measured[j]
        error[c] = about.residual[k, c] - _dot(rows[c], mean)
        forward_pass.innovation[k, c] = error[c]
        forward_pass.variance[k, c] = total
    nis = 0.0
    for c in range(rows.shape[0]):
        if np.isnan(about.residual[k, c]):
            continue
        _project_row(rows[c], state, measured)
        variance = noise[c] / forward_pass.weight[k, c]
        total = carlson_update(columns, n, measured, variance, work.gain, work.ratio, work.share)
        step = error[c] / total
        nis += error[c] * step
        for i in range(work.gain.size):
            mean[i] += work.gain[i] * step
        # Innovations of the other components follow the state.
        for other in range(c + 1, rows.shape[0]):
            error[other] -= _dot(rows[other], work.gain) * step
        forward_pass.total[k, c] = total
        for i in range(n):
            forward_pass.gain[k, c, i] = work.gain[i]
    return nis


@compiled(reassociate=True)
def _store_event(event, state, n_parameters, forward_pass, work):
    """Store the mean and the moving rows of the covariance, four columns at a time."""
    n, columns, covariance = state.n, state.columns, forward_pass.covariance[event]
    width = columns.shape[1]
    factor = columns.reshape(-1)
    for i in range(n):
        forward_pass.filtered[event, i] = state.mean[i]
    for part in range(work.transposed.shape[0]):
        first, moving, product = n_parameters + part * _ROWS, work.transposed[part], work.product[part]
        rows = min(_ROWS, n - first)
        for j in range(n):
            for i in range(rows):
                moving[j * _ROWS + i] = columns[j, first + i]
        for k in range(0, n, 4):
            # Entries after the diagonal of the triangle are zero.
            _products(factor, k, 1, width, k + 4, moving, product)
            for r in range(min(4, n - k)):
                for i in range(rows):
                    covariance[part * _ROWS + i, k + r] = product[r * _ROWS + i]


@compiled(
    types.Tuple((types.int64, types.float64, types.float64, types.float64))(
        SENSORS_TYPE, ACCUMULATED_NOISE, TIMELINE, LINEARISED, STATE, FORWARD_PASS, SMOOTHER_WORKSPACE
    ),
    reassociate=True,
)
def forward(sensors, noise, timeline, about, state, forward_pass, work):
    """Filter the deviations from a trajectory through a chunk of the data.

    Parameters
    ----------
    sensors : Sensors
    noise : AccumulatedNoise
    timeline : Timeline
    about : Linearised
    state : State
        Deviation at the event before the chunk; afterwards at its last event.
    forward_pass : ForwardPass
        Filled in.
    work : SmootherWorkspace

    Returns
    -------
    good : int
        Number of good events.
    cost : float
        Cost of the trajectory: sum of squared defects and weighted squared residuals, divided by their variances.
    least : float
        Cost at the minimum of the linear problem: the sum of the NIS and the constant part of Huber's cost.
    log_determinant : float
        Sum of the logarithms of the innovations' variances, times their weights.
    """
    n, n_moving = state.n, noise.variance.shape[1]
    n_parameters = n - n_moving
    cost, least, log_determinant = 0.0, 0.0, 0.0
    for event in range(timeline.time.size):
        first, last = timeline.substep_offset[event], timeline.substep_offset[event + 1]
        if last > first:
            for i in range(n_moving):
                defect = about.defect[event, i]
                for j in range(noise.driven.shape[1]):
                    defect -= noise.half_elapsed[event] * noise.driven[i, j] * about.defect[event, j]
                cost += defect * defect / noise.variance[event, i]
            if not _predict(about.transition[event], event, noise, state, work):
                return event, cost, least, log_determinant
            for i in range(n_moving):
                state.mean[n_parameters + i] += about.defect[event, i]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            sensor = timeline.measurement_sensor[k]
            for c in range(about.residual.shape[1]):
                residual = about.residual[k, c]
                if not np.isnan(residual):
                    square = residual * residual / sensors.variance[sensor, c]
                    weight = _weight(square, sensors.threshold)
                    forward_pass.weight[k, c] = weight
                    cost += weight * (2.0 - weight) * square
                    least += weight * (1.0 - weight) * square
            nis = _update(k, about.rows[k], sensors.variance[sensor], about, state, forward_pass, work)
            if not nis >= 0.0:
                return event, cost, least, log_determinant
            least += nis
            for c in range(about.residual.shape[1]):
                if not np.isnan(about.residual[k, c]):
                    log_determinant += np.log(forward_pass.total[k, c] * forward_pass.weight[k, c])
        if not cost < np.inf:
            return event, cost, least, log_determinant
        _store_event(event, state, n_parameters, forward_pass, work)
    return timeline.time.size, cost, least, log_determinant
