"""A linear process that filters and textbook can both move exactly, and timelines for it."""

from types import SimpleNamespace

import numpy as np
import pytest

from auvid_cli.filters.problem import (
    LINEARISATION_SIGNATURE,
    OBSERVATION_SIGNATURE,
    PROCESS_SIGNATURE,
    TRANSITION_SIGNATURE,
    Gaussian,
    Process,
    Sensors,
    Timeline,
    empty_records,
)
from auvid_cli.numerics import LANES
from tests.filters.compile_later import compile_later

N_AXES = 2


@compile_later(PROCESS_SIGNATURE)
def _advance(moving, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    """Two carts: positions, then velocities; acceleration = mixing @ parameters + input, constant in a substep."""
    n_parameters = constants.size // N_AXES
    for k in range(n_lanes):
        for axis in range(N_AXES):
            acceleration = inputs[axis]
            for j in range(n_parameters):
                acceleration += constants[axis * n_parameters + j] * parameters[j * LANES + k]
            velocity = moving[(N_AXES + axis) * LANES + k]
            moving[axis * LANES + k] += duration * velocity + 0.5 * duration**2 * acceleration
            moving[(N_AXES + axis) * LANES + k] = velocity + duration * acceleration


@compile_later(TRANSITION_SIGNATURE)
def _transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch):
    """The same for one state, and its derivative."""
    n_parameters = constants.size // N_AXES
    n, elapsed = n_parameters + 2 * N_AXES, 0.0
    for i in range(n_parameters, n):
        for j in range(n):
            matrix[i, j] = 1.0 if i == j else 0.0
    for substep in range(substep_duration.size):
        duration = substep_duration[substep]
        for axis in range(N_AXES):
            position, velocity = n_parameters + axis, n_parameters + N_AXES + axis
            acceleration = inputs[substep_input[substep], axis]
            for j in range(n_parameters):
                mixing = constants[axis * n_parameters + j]
                acceleration += mixing * mean[j]
                matrix[position, j] += duration * matrix[velocity, j] + 0.5 * duration**2 * mixing
                matrix[velocity, j] += duration * mixing
            mean[position] += duration * mean[velocity] + 0.5 * duration**2 * acceleration
            mean[velocity] += duration * acceleration
        elapsed += duration
    for axis in range(N_AXES):
        matrix[n_parameters + axis, n_parameters + N_AXES + axis] = elapsed


def _step_matrices(mixing, duration):
    """x <- F x + G input over one substep, parameters first."""
    n_parameters = mixing.shape[1]
    n = n_parameters + 2 * N_AXES
    step, push = np.eye(n), np.zeros((n, N_AXES))
    position, velocity = slice(n_parameters, n_parameters + N_AXES), slice(n_parameters + N_AXES, n)
    step[position, velocity] = duration * np.eye(N_AXES)
    step[position, :n_parameters] = 0.5 * duration**2 * mixing
    step[velocity, :n_parameters] = duration * mixing
    push[position] = 0.5 * duration**2 * np.eye(N_AXES)
    push[velocity] = duration * np.eye(N_AXES)
    return step, push


@pytest.fixture(scope="session")
def share_of_largest():
    """Function: largest difference between two tables, relative to the largest value of its column."""

    def share(got, expected):
        assert np.array_equal(np.isnan(got), np.isnan(expected))
        return np.nanmax(np.abs(got - expected), axis=0) / np.nanmax(np.abs(expected), axis=0)

    return share


@pytest.fixture(scope="session")
def events_of():
    """Function: timeline of some consecutive events."""

    def cut(t, first, last):
        substeps, measurements = t.substep_offset[first : last + 1], t.measurement_offset[first : last + 1]
        of_pieces, of_readings = slice(substeps[0], substeps[-1]), slice(measurements[0], measurements[-1])
        return Timeline(
            t.time[first:last],
            substeps - substeps[0],
            t.substep_duration[of_pieces],
            t.substep_input[of_pieces],
            t.inputs,
            t.event_input[first:last],
            measurements - measurements[0],
            t.measurement_sensor[of_readings],
            t.measurement[of_readings],
        )

    return cut


@pytest.fixture(scope="session")
def run_whole(events_of):
    """Function: run a filter on a problem, in chunks; records of all events, NaN where there are none."""

    def run(run_filter, problem, chunk=8):
        t, n = problem.timeline, problem.prior.mean.size
        whole = empty_records(t, n)._replace(weight=np.ones(t.measurement.shape))
        done, told = [0, 0], []

        def on_chunk(timeline, records):
            for name, rows in records._asdict().items():
                if rows is None:
                    continue
                first = done[name not in ("mean", "standard_deviation")]
                getattr(whole, name)[first : first + len(rows)] = rows
            told.append((timeline.time.size, len(records.mean)))
            done[:] = done[0] + timeline.time.size, done[1] + len(timeline.measurement)

        chunks = [events_of(t, first, first + chunk) for first in range(0, t.time.size, chunk)]
        outcome = run_filter(problem.process, problem.sensors, chunks, problem.prior, on_chunk)
        return SimpleNamespace(records=whole, told=told, **outcome._asdict())

    return run


@pytest.fixture(params=[1, 2, 7, 40], ids=lambda n: f"{n} parameters")
def linear_problem(request):
    """A random linear problem: irregular times, inputs that change in between, several sensors at one
    instant, missing components and whole missing measurements. 40 parameters need two blocks of lanes."""
    rng = np.random.default_rng(request.param)
    n_parameters = request.param
    n, n_events, width = n_parameters + 2 * N_AXES, 30, 3
    mixing = rng.standard_normal((N_AXES, n_parameters)) / np.sqrt(n_parameters)
    density = rng.uniform(0.05, 0.3, 2 * N_AXES)

    process = Process(_advance(), _transition(), mixing.ravel(), np.zeros(0, dtype=np.int64), density)

    substeps = [0, *rng.integers(1, 4, n_events - 1)]
    durations = rng.uniform(0.01, 0.4, sum(substeps))
    readings_at = rng.integers(0, 4, n_events)
    n_measurements = readings_at.sum()
    measurement = rng.standard_normal((n_measurements, width))
    measurement[rng.random(measurement.shape) < 0.25] = np.nan
    measurement[::7] = np.nan
    offset = np.concatenate([[0], np.cumsum(substeps)])
    timeline = Timeline(
        time=np.concatenate([[0.0], np.cumsum(durations)])[offset[1:]],
        substep_offset=offset,
        substep_duration=durations,
        substep_input=rng.integers(0, 5, durations.size),
        inputs=rng.standard_normal((5, N_AXES)),
        event_input=np.arange(offset.size - 1) % 5,
        measurement_offset=np.concatenate([[0], np.cumsum(readings_at)]),
        measurement_sensor=rng.integers(0, 2, n_measurements, dtype=np.int8),
        measurement=measurement,
    )
    matrix = rng.standard_normal((2, width, n))
    # One sensor sees motion only, as those of a vehicle do.
    matrix[1, :, :n_parameters] = 0.0
    nothing = np.zeros((2, width), dtype=np.bool_)
    sensors = Sensors(matrix, rng.uniform(0.01, 1.0, (2, width)), nothing, np.zeros(2, dtype=np.bool_))
    factor = np.tril(rng.standard_normal((n, n)))
    factor[np.diag_indices(n)] = rng.uniform(0.5, 2.0, n)
    prior = Gaussian(rng.standard_normal(n), factor)
    return SimpleNamespace(process=process, sensors=sensors, timeline=timeline, prior=prior, mixing=mixing)


@compile_later(OBSERVATION_SIGNATURE)
def _observe(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch):
    """A distance, a rate with an unknown scale under an input, and a product of states; of sensor 0."""
    for k in range(n_lanes):
        x, y, u, v = moving[k], moving[LANES + k], moving[2 * LANES + k], moving[3 * LANES + k]
        predicted[k] = np.sqrt(4.0 + x * x + y * y)
        predicted[LANES + k] = (1.0 + 0.3 * parameters[k]) * u + 0.2 * inputs[0] + sensor
        predicted[2 * LANES + k] = np.sin(y) + 0.2 * u * v


def _plain_observe(state, inputs):
    parameter, (x, y, u, v) = state[0], state[-2 * N_AXES :]
    rate = (1.0 + 0.3 * parameter) * u + 0.2 * inputs[0]
    return np.array([np.sqrt(4.0 + x * x + y * y), rate, np.sin(y) + 0.2 * u * v])


def _jacobian(state):
    parameter, (x, y, u, v) = state[0], state[-2 * N_AXES :]
    matrix = np.zeros((3, state.size))
    distance = np.sqrt(4.0 + x * x + y * y)
    matrix[0, -4], matrix[0, -3] = x / distance, y / distance
    matrix[1, 0], matrix[1, -2] = 0.3 * u, 1.0 + 0.3 * parameter
    matrix[2, -3], matrix[2, -2], matrix[2, -1] = np.cos(y), 0.2 * v, 0.2 * u
    return matrix


@compile_later(LINEARISATION_SIGNATURE)
def _linearise(mean, sensor, inputs, constants, selection, predicted, matrix, scratch):
    first = mean.size - 4
    x, y, u, v = mean[first], mean[first + 1], mean[first + 2], mean[first + 3]
    distance = np.sqrt(4.0 + x * x + y * y)
    predicted[0], predicted[1], predicted[2] = (
        distance,
        (1.0 + 0.3 * mean[0]) * u + 0.2 * inputs[0],
        np.sin(y) + 0.2 * u * v,
    )
    for i in range(matrix.shape[0]):
        for j in range(mean.size):
            matrix[i, j] = 0.0
    matrix[0, first], matrix[0, first + 1] = x / distance, y / distance
    matrix[1, 0], matrix[1, first + 2] = 0.3 * u, 1.0 + 0.3 * mean[0]
    matrix[2, first + 1], matrix[2, first + 2], matrix[2, first + 3] = np.cos(y), 0.2 * v, 0.2 * u


@pytest.fixture
def nonlinear_problem(linear_problem):
    """The carts, measured by a nonlinear sensor and a linear one."""
    p = linear_problem
    p.process = p.process._replace(observe=_observe(), linearise=_linearise())
    p.sensors = p.sensors._replace(nonlinear=np.array([True, False]))
    p.prior = Gaussian(0.2 * p.prior.mean, 0.2 * p.prior.factor)
    p.plain_observe, p.jacobian = _plain_observe, _jacobian
    return p


@pytest.fixture
def textbook(linear_problem):
    """The Kalman filter of any textbook, with full covariance and joint updates."""
    p = linear_problem
    t, n = p.timeline, p.prior.mean.size
    mean, covariance = p.prior.mean.copy(), p.prior.factor @ p.prior.factor.T
    noise = np.zeros((n, n))
    noise[-2 * N_AXES :, -2 * N_AXES :] = np.diag(p.process.noise_density**2)
    means, deviations = [], []
    innovations, variances = np.full(t.measurement.shape, np.nan), np.full(t.measurement.shape, np.nan)
    nis = np.zeros(len(t.measurement))
    for event in range(t.time.size):
        for substep in range(t.substep_offset[event], t.substep_offset[event + 1]):
            step, push = _step_matrices(p.mixing, t.substep_duration[substep])
            mean = step @ mean + push @ t.inputs[t.substep_input[substep]]
            covariance = step @ covariance @ step.T
        # The noise of an interval is added where the interval ends.
        covariance = (
            covariance + noise * t.substep_duration[t.substep_offset[event] : t.substep_offset[event + 1]].sum()
        )
        for k in range(t.measurement_offset[event], t.measurement_offset[event + 1]):
            present = ~np.isnan(t.measurement[k])
            h = p.sensors.matrix[t.measurement_sensor[k], present]
            innovation = t.measurement[k, present] - h @ mean
            s = h @ covariance @ h.T + np.diag(p.sensors.variance[t.measurement_sensor[k], present])
            gain = covariance @ h.T @ np.linalg.inv(s)
            mean, covariance = mean + gain @ innovation, (np.eye(n) - gain @ h) @ covariance
            innovations[k, present], variances[k, present] = innovation, np.diag(s)
            nis[k] = innovation @ np.linalg.solve(s, innovation)
        means.append(mean)
        deviations.append(np.sqrt(np.diag(covariance)))
    return SimpleNamespace(
        mean=np.array(means), standard_deviation=np.array(deviations), covariance=covariance,
        innovation=innovations, innovation_variance=variances, nis=nis,
    )  # fmt: skip


@pytest.fixture
def by_hand(linear_problem):
    """As one set of linear equations in the initial state: of the state at each event, and of each measurement."""
    p = linear_problem
    t, n = p.timeline, p.prior.mean.size
    transition, offset = np.eye(n), np.zeros(n)
    transitions, offsets, matrices, measurements = [], [], [], []
    for event in range(t.time.size):
        for substep in range(t.substep_offset[event], t.substep_offset[event + 1]):
            step, push = _step_matrices(p.mixing, t.substep_duration[substep])
            transition, offset = step @ transition, step @ offset + push @ t.inputs[t.substep_input[substep]]
        transitions.append(transition)
        offsets.append(offset)
        for k in range(t.measurement_offset[event], t.measurement_offset[event + 1]):
            h = p.sensors.matrix[t.measurement_sensor[k]]
            matrices.append(h @ transition)
            measurements.append(t.measurement[k] - h @ offset)
    return SimpleNamespace(
        transition=np.array(transitions),
        offset=np.array(offsets),
        matrix=np.array(matrices),
        measurement=np.array(measurements),
    )


def _transitions(problem):
    """Origin, matrix and duration of the way to each event from the one before."""
    ((t,),), p, n = problem.segments, problem.process, problem.prior.mean.size
    for event in range(t.time.size):
        origin, matrix, duration = np.zeros(n), np.eye(n), 0.0
        first, last = t.substep_offset[event : event + 2]
        if last > first:
            substeps = t.substep_input[first:last], t.substep_duration[first:last]
            p.transition(origin, t.inputs, *substeps, p.constants, p.selection, matrix, np.zeros(1))
            duration = substeps[1].sum()
        yield origin, matrix, duration


@pytest.fixture(scope="session")
def moments_of_measurements():
    """Function: all measurements of a problem in one chunk, and their mean and covariance by the model."""
    return _moments_of_measurements


def _noise_covariance(process, duration):
    """Covariance of process noise; a driving state and the driven one as by Van Loan's integral."""
    density = np.diag(process.noise_density**2)
    if not process.driven.size:
        return duration * density
    cross = process.driven @ density
    both = cross @ process.driven.T
    return duration * density + duration**2 / 2.0 * (cross + cross.T) + duration**3 / 3.0 * both


def _moments_of_measurements(problem):
    ((t,),), sensors, n = problem.segments, problem.sensors, problem.prior.mean.size
    n_moving = problem.process.noise_density.size
    mean, root = problem.prior.mean, problem.prior.factor
    rows, expected, noise, measured = [], [], [], []
    for event, (origin, matrix, duration) in enumerate(_transitions(problem)):
        more = np.zeros((n, n_moving))
        more[-n_moving:] = np.linalg.cholesky(_noise_covariance(problem.process, duration) + 1e-300 * np.eye(n_moving))
        mean, root = origin + matrix @ mean, np.hstack([matrix @ root, more])
        rows = [np.pad(row, (0, n_moving)) for row in rows]
        for k in range(*t.measurement_offset[event : event + 2]):
            sensor, there = t.measurement_sensor[k], ~np.isnan(t.measurement[k])
            rows += [*(sensors.matrix[sensor, there] @ root)]
            expected += [*(sensors.matrix[sensor, there] @ mean)]
            noise += [*sensors.variance[sensor, there]]
            measured += [*t.measurement[k, there]]
    rows = np.array(rows)
    return np.array(measured), np.array(expected), rows @ rows.T + np.diag(noise)
