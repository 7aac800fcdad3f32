"""A linear process that filters and textbook can both move exactly, and timelines for it."""

from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from auvid_cli.filters.problem import (
    OBSERVATION_SIGNATURE,
    PROCESS_SIGNATURE,
    TRANSITION_SIGNATURE,
    Belief,
    Process,
    Sensors,
    Timeline,
    empty_records,
)
from auvid_cli.lanes import LANES

N_AXES = 2


@njit(PROCESS_SIGNATURE)
def _advance(moving, parameters, inputs, constants, selection, n_lanes, duration, scratch):
    """Two carts: positions, then velocities; acceleration = mixing @ parameters + input, constant in a piece."""
    n_parameters = constants.size // N_AXES
    for k in range(n_lanes):
        for axis in range(N_AXES):
            acceleration = inputs[axis]
            for j in range(n_parameters):
                acceleration += constants[axis * n_parameters + j] * parameters[j * LANES + k]
            velocity = moving[(N_AXES + axis) * LANES + k]
            moving[axis * LANES + k] += duration * velocity + 0.5 * duration**2 * acceleration
            moving[(N_AXES + axis) * LANES + k] = velocity + duration * acceleration


@njit(TRANSITION_SIGNATURE)
def _transition(mean, inputs, piece_input, piece_duration, constants, selection, matrix, scratch):
    """The same for one state, and its derivative."""
    n_parameters = constants.size // N_AXES
    n, elapsed = n_parameters + 2 * N_AXES, 0.0
    matrix[n_parameters:] = np.eye(n)[n_parameters:]
    for piece in range(piece_duration.size):
        duration = piece_duration[piece]
        for axis in range(N_AXES):
            position, velocity = n_parameters + axis, n_parameters + N_AXES + axis
            acceleration = inputs[piece_input[piece], axis]
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
    """x <- F x + G input over one piece, parameters first."""
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
    """Function: by how much the rows of two tables differ at most, as a share of each column's largest value."""

    def share(got, expected):
        assert np.array_equal(np.isnan(got), np.isnan(expected))
        return np.nanmax(np.abs(got - expected), axis=0) / np.nanmax(np.abs(expected), axis=0)

    return share


@pytest.fixture(scope="session")
def events_of():
    """Function: some consecutive events of a timeline, as a timeline."""

    def cut(t, first, last):
        pieces, readings = t.piece_offset[first : last + 1], t.reading_offset[first : last + 1]
        of_pieces, of_readings = slice(pieces[0], pieces[-1]), slice(readings[0], readings[-1])
        return Timeline(
            t.time[first:last],
            pieces - pieces[0],
            t.piece_duration[of_pieces],
            t.piece_input[of_pieces],
            t.inputs,
            readings - readings[0],
            t.reading_sensor[of_readings],
            t.reading[of_readings],
        )

    return cut


@pytest.fixture(scope="session")
def run_whole(events_of):
    """Function: run a filter on a problem, in parts; records over all events and readings, NaN where there are none."""

    def run(run_filter, problem, part=8):
        t, n = problem.timeline, problem.prior.mean.size
        whole = empty_records(t, n)
        done, told = [0, 0], []

        def receive(timeline, records):
            for name, rows in records._asdict().items():
                first = done[name not in ("mean", "standard_deviation")]
                getattr(whole, name)[first : first + len(rows)] = rows
            told.append((timeline.time.size, len(records.mean)))
            done[:] = done[0] + timeline.time.size, done[1] + len(timeline.reading)

        parts = [events_of(t, first, first + part) for first in range(0, t.time.size, part)]
        ending = run_filter(problem.process, problem.sensors, parts, problem.prior, receive)
        return SimpleNamespace(records=whole, told=told, **ending._asdict())

    return run


@pytest.fixture(params=[1, 2, 7, 40], ids=lambda n: f"{n} parameters")
def linear_problem(request):
    """A random linear problem: irregular times, inputs that change in between, several sensors at one
    instant, missing components and whole missing readings. 40 parameters need two blocks of lanes."""
    rng = np.random.default_rng(request.param)
    n_parameters = request.param
    n, n_events, width = n_parameters + 2 * N_AXES, 30, 3
    mixing = rng.standard_normal((N_AXES, n_parameters)) / np.sqrt(n_parameters)
    density = rng.uniform(0.05, 0.3, 2 * N_AXES)

    process = Process(_advance, _transition, mixing.ravel(), np.zeros(0, dtype=np.int64), density)

    pieces = [0, *rng.integers(1, 4, n_events - 1)]
    durations = rng.uniform(0.01, 0.4, sum(pieces))
    readings_at = rng.integers(0, 4, n_events)
    n_readings = readings_at.sum()
    reading = rng.standard_normal((n_readings, width))
    reading[rng.random(reading.shape) < 0.25] = np.nan
    reading[::7] = np.nan
    offset = np.concatenate([[0], np.cumsum(pieces)])
    timeline = Timeline(
        time=np.concatenate([[0.0], np.cumsum(durations)])[offset[1:]],
        piece_offset=offset,
        piece_duration=durations,
        piece_input=rng.integers(0, 5, durations.size),
        inputs=rng.standard_normal((5, N_AXES)),
        reading_offset=np.concatenate([[0], np.cumsum(readings_at)]),
        reading_sensor=rng.integers(0, 2, n_readings, dtype=np.int8),
        reading=reading,
    )
    matrix = rng.standard_normal((2, width, n))
    # One sensor sees motion only, as those of a vehicle do.
    matrix[1, :, :n_parameters] = 0.0
    nothing = np.zeros((2, width), dtype=np.bool_)
    sensors = Sensors(matrix, rng.uniform(0.01, 1.0, (2, width)), nothing, np.zeros(2, dtype=np.bool_))
    factor = np.tril(rng.standard_normal((n, n)))
    factor[np.diag_indices(n)] = rng.uniform(0.5, 2.0, n)
    prior = Belief(rng.standard_normal(n), factor)
    return SimpleNamespace(process=process, sensors=sensors, timeline=timeline, prior=prior, mixing=mixing)


@njit(OBSERVATION_SIGNATURE)
def _observe(moving, parameters, sensor, constants, selection, n_lanes, seen):
    """A distance, a rate with an unknown scale, and a product of states; of sensor 0."""
    for k in range(n_lanes):
        x, y, u, v = moving[k], moving[LANES + k], moving[2 * LANES + k], moving[3 * LANES + k]
        seen[k] = np.sqrt(4.0 + x * x + y * y)
        seen[LANES + k] = (1.0 + 0.3 * parameters[k]) * u + sensor
        seen[2 * LANES + k] = np.sin(y) + 0.2 * u * v


def _plain_observe(state):
    parameter, (x, y, u, v) = state[0], state[-2 * N_AXES :]
    return np.array([np.sqrt(4.0 + x * x + y * y), (1.0 + 0.3 * parameter) * u, np.sin(y) + 0.2 * u * v])


def _jacobian(state):
    parameter, (x, y, u, v) = state[0], state[-2 * N_AXES :]
    matrix = np.zeros((3, state.size))
    distance = np.sqrt(4.0 + x * x + y * y)
    matrix[0, -4], matrix[0, -3] = x / distance, y / distance
    matrix[1, 0], matrix[1, -2] = 0.3 * u, 1.0 + 0.3 * parameter
    matrix[2, -3], matrix[2, -2], matrix[2, -1] = np.cos(y), 0.2 * v, 0.2 * u
    return matrix


@pytest.fixture
def nonlinear_problem(linear_problem):
    """The carts, seen by a nonlinear sensor and a linear one."""
    p = linear_problem
    p.process = p.process._replace(
        observe=_observe, linearise=lambda mean, sensor: (_plain_observe(mean), _jacobian(mean))
    )
    p.sensors = p.sensors._replace(nonlinear=np.array([True, False]))
    p.prior = Belief(0.2 * p.prior.mean, 0.2 * p.prior.factor)
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
    innovations, variances = np.full(t.reading.shape, np.nan), np.full(t.reading.shape, np.nan)
    nis = np.zeros(len(t.reading))
    for event in range(t.time.size):
        for piece in range(t.piece_offset[event], t.piece_offset[event + 1]):
            step, push = _step_matrices(p.mixing, t.piece_duration[piece])
            mean = step @ mean + push @ t.inputs[t.piece_input[piece]]
            covariance = step @ covariance @ step.T
        # The noise of an interval is added where the interval ends.
        covariance = covariance + noise * t.piece_duration[t.piece_offset[event] : t.piece_offset[event + 1]].sum()
        for k in range(t.reading_offset[event], t.reading_offset[event + 1]):
            present = ~np.isnan(t.reading[k])
            h = p.sensors.matrix[t.reading_sensor[k], present]
            innovation = t.reading[k, present] - h @ mean
            s = h @ covariance @ h.T + np.diag(p.sensors.variance[t.reading_sensor[k], present])
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
    """As one set of linear equations in the initial state: of the state at each event, and of each reading."""
    p = linear_problem
    t, n = p.timeline, p.prior.mean.size
    transition, offset = np.eye(n), np.zeros(n)
    transitions, offsets, matrices, readings = [], [], [], []
    for event in range(t.time.size):
        for piece in range(t.piece_offset[event], t.piece_offset[event + 1]):
            step, push = _step_matrices(p.mixing, t.piece_duration[piece])
            transition, offset = step @ transition, step @ offset + push @ t.inputs[t.piece_input[piece]]
        transitions.append(transition)
        offsets.append(offset)
        for k in range(t.reading_offset[event], t.reading_offset[event + 1]):
            h = p.sensors.matrix[t.reading_sensor[k]]
            matrices.append(h @ transition)
            readings.append(t.reading[k] - h @ offset)
    return SimpleNamespace(
        transition=np.array(transitions),
        offset=np.array(offsets),
        matrix=np.array(matrices),
        reading=np.array(readings),
    )
