"""Simulation of identified models side by side, and the measured signals that they are compared with."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array, release_memory, stored
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import TURN_RATE_WINDOW, rate_noise, rate_of_change
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.process import N_PREDICTED, move_through
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.equations import N_WORK, NO_ERRORS, vehicle_constants, with_errors
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, MOTION_SYMBOLS, SENSORS, state_of
from auvid_cli.vehicle.rigid_body import euler_angles, rotation_matrix

_ANGLES = MOTION_SYMBOLS[6:]
SAME = 0.75e-9  # s; smaller differences are rounding: events are at whole nanoseconds, at most half of one off
_MIN_HEADINGS = 2  # on either side of a heading, to compute its yaw rate
_NOISE_INTERVAL = 0.1  # s, between pulses of process noise; short compared with the response of a vehicle
_DISTURBANCE_INTERVAL = 0.05  # s, between changes of a disturbance


class MeasuredSignal(NamedTuple):
    """Measurements of one motion state, or of the depth."""

    # time, values: shape (n,); finite measurements only, s and SI; angles without jumps of a turn
    time: Array
    values: Array
    deviation: float  # stated standard deviation of a measurement, SI

    def since(self, time: float) -> int:
        """Return the index of the first measurement at or after a time."""
        return int(np.searchsorted(self.time, time - SAME))

    def turns(self, time: float, value: float) -> float:
        """Return the whole turns, rad, to add to an angle so that it is near the measurements."""
        measurement = self.values[max(int(np.searchsorted(self.time, time + SAME)) - 1, 0)]
        return 2.0 * np.pi * float(np.round((measurement - value) / (2.0 * np.pi)))


class SignalSize(NamedTuple):
    """Size of the measurements of one signal, over all segments."""

    deviation: float  # stated standard deviation of a measurement, SI; root mean square of several
    variance: float  # variance about the mean of each segment, SI


def is_angle(symbol: str) -> bool:
    """Whether a motion state is an angle."""
    return symbol in _ANGLES


def measured_signals(measuring: Mapping[str, SensorRecord]) -> dict[str, MeasuredSignal]:
    """Return the measured signals by symbol: motion states in their order, and depth."""
    signals = {}
    for name, record in measuring.items():
        for component, quantity in enumerate(SENSORS[name]):
            values = record.values[:, component]
            rows = np.flatnonzero(np.isfinite(values))
            if rows.size:
                # A view of values without gaps saves 6 MB for each component and hour at 100 Hz.
                has_gaps = rows[-1] - rows[0] >= rows.size
                present = rows if has_gaps else slice(rows[0], rows[-1] + 1)
                symbol, time, values = state_of(quantity), record.time[present], values[present]
                values = stored(np.unwrap(values)) if is_angle(symbol) else values
                signals[symbol] = MeasuredSignal(time, values, float(record.standard_deviation[component]))
    release_memory()
    if "r" not in signals and (yaw_rate := _yaw_rate_by_attitude(signals)) is not None:
        signals["r"] = yaw_rate
    return {symbol: signals[symbol] for symbol in MOTION_AND_DEPTH_SYMBOLS if symbol in signals}


def signal_sizes(segments: Sequence[Mapping[str, MeasuredSignal]]) -> dict[str, SignalSize]:
    """Return the sizes of signals over several segments, by symbol, in the order of `measured_signals`."""
    sizes = {}
    for symbol in MOTION_AND_DEPTH_SYMBOLS:
        if own := [signals[symbol] for signals in segments if symbol in signals]:
            weights = [signal.values.size for signal in own]
            noise, variance = ([s.deviation**2 for s in own], [float(s.values.var()) for s in own])
            sizes[symbol] = SignalSize(
                float(np.sqrt(np.average(noise, weights=weights))), float(np.average(variance, weights=weights))
            )
    return sizes


def _yaw_rate_by_attitude(signals: Mapping[str, MeasuredSignal]) -> MeasuredSignal | None:
    """Return the yaw rate from attitude, by cubics through a second of it; None without heading, or if it is too slow.

    ``r = psi_dot cos phi cos theta - theta_dot sin phi`` (Fossen 2011, eq. 2.28); an angle that is not measured at the
    times of the heading is zero.
    """
    if "psi" not in signals or signals["psi"].time.size < 3:
        return None
    time, heading, deviation = signals["psi"]
    interval = float(np.median(np.diff(time)))
    half = round(0.5 * TURN_RATE_WINDOW / interval)
    # Half a window before and after, plus a margin, without gaps.
    ends = np.concatenate([[True], np.diff(time) > 0.5 * TURN_RATE_WINDOW, [True]])
    last_begin = np.maximum.accumulate(np.where(ends[:-1], time, -np.inf))
    next_end = np.minimum.accumulate(np.where(ends[1:], time, np.inf)[::-1])[::-1]
    good = np.minimum(time - last_begin, next_end - time) >= (half + 0.9) * interval
    if half < _MIN_HEADINGS or not good.any():
        return None
    # One more than there are headings, so that the last heading is between two.
    even = time[0] + interval * np.arange(int((time[-1] - time[0]) / interval) + 2)

    def rate(angle: Array) -> Array:
        return np.interp(time, even, rate_of_change(np.interp(even, time, angle), interval, half))

    angles = (signals.get(symbol) for symbol in ("phi", "theta"))
    roll, pitch = (
        angle.values if angle is not None and np.array_equal(angle.time, time) else np.zeros(time.size)
        for angle in angles
    )
    yaw_rate = rate(heading) * np.cos(roll) * np.cos(pitch) - rate(pitch) * np.sin(roll)
    return MeasuredSignal(time[good], yaw_rate[good], rate_noise(interval, half) * deviation)


class ProcessNoise(NamedTuple):
    """White noise on the motion of some models."""

    which: slice  # those models
    density: Array  # shape (10,); root spectral density on the rate of each motion state and of depth, SI / s^0.5
    rng: np.random.Generator

    def add(self, states: Array, elapsed: float) -> None:
        """Add the effect of some time, s, to the states, shape (10, n)."""
        noisy = states[:, self.which]
        noisy += np.sqrt(elapsed) * self.density[:, None] * self.rng.standard_normal(noisy.shape)


class Disturbance(NamedTuple):
    """Gauss-Markov force or moment on each axis of several models."""

    which: slice  # models with random changes; in the others it decays
    force: Array  # shape (6, n); current value, N and N m; modified in place
    # deviation, time_constant: shape (6,); stationary standard deviation, N and N m, and correlation time, s, of each
    # axis
    deviation: Array
    time_constant: Array
    inverse: Array  # shape (6, 6); inverse mass matrix
    rng: np.random.Generator

    def push(self, states: Array, elapsed: float) -> None:
        """Accelerate the states, shape (10, n), for some time, s."""
        states[:6] += elapsed * self.inverse @ self.force

    def propagate(self, elapsed: float) -> None:
        """Change the force over some time, s."""
        decay = np.exp(-elapsed / self.time_constant)[:, None]
        self.force[:] *= decay
        driven = self.force[:, self.which]
        driven += np.sqrt(1.0 - decay**2) * self.deviation[:, None] * self.rng.standard_normal(driven.shape)


def move_side_by_side(
    timelines: Iterable[Timeline],
    motion: Array,
    coefficients: Array,
    parameters: Sequence[Mapping[str, float]],
    wanted: Array,
    noise: ProcessNoise | None = None,
    disturbance: Disturbance | None = None,
    errors: Sequence[float] | Array = NO_ERRORS,
    terms: Sequence[Coefficient] = (),
) -> Array:
    """Return the motion of up to `LANES` models with the same inputs, shape (k, n, 10); not finite after divergence.

    Parameters
    ----------
    timelines : iterable of Timeline
        Read up to the last wanted time.
    motion : ndarray, shape (n, 10)
        Motion and depth of each model at the start.
    coefficients : ndarray, shape (n, 22 + terms)
        SI.
    parameters : sequence of mapping
        Known parameters of each model, or of all; fastest where consecutive models have the same.
    wanted : ndarray, shape (k,)
        Times of events, s, increasing.
    noise : ProcessNoise, optional
    disturbance : Disturbance, optional
    errors : ndarray, shape (5,) or (n, 5)
        Errors of thrust, fins and ballast, see `NO_ERRORS`.
    terms : sequence of Coefficient
        Additional terms of the vehicle.
    """
    n = len(motion)
    work, states = np.zeros(N_WORK), _in_lanes(motion.T).reshape(N_PREDICTED, LANES)
    vehicles = _vehicles(with_errors(coefficients, errors), parameters, terms)
    moved = np.empty((wanted.size, n, N_PREDICTED))
    longest = _DISTURBANCE_INTERVAL if disturbance is not None else inf if noise is None else _NOISE_INTERVAL
    done = 0

    def move(timeline: Timeline, begin: int, end: int) -> None:
        for first, last, elapsed in _strides(timeline.substep_duration, begin, end, longest):
            if disturbance is not None:
                disturbance.push(states[:, :n], 0.5 * elapsed)
            for models, rows, constants in vehicles:
                block = _in_lanes(states[:, models])
                move_through(block, rows, constants, models.stop - models.start, timeline, first, last, work)
                states[:, models] = block.reshape(N_PREDICTED, LANES)[:, : models.stop - models.start]
            if disturbance is not None:
                disturbance.propagate(elapsed)
                disturbance.push(states[:, :n], 0.5 * elapsed)
            if noise is not None:
                noise.add(states, elapsed)

    for timeline in timelines:
        substep = 0
        for event in np.searchsorted(timeline.time, wanted[done:] - SAME):
            if event == timeline.time.size:
                break
            until = int(timeline.substep_offset[event + 1])
            move(timeline, substep, until)
            moved[done], substep, done = states[:, :n].T, until, done + 1
        if done == wanted.size:
            break
        move(timeline, substep, timeline.substep_duration.size)
    return moved[:done]


def _vehicles(
    rows: Array, parameters: Sequence[Mapping[str, float]], terms: Sequence[Coefficient]
) -> list[tuple[slice, Array, Array]]:
    """Return consecutive models with the same known parameters: which they are, their factors, and their constants."""
    n, each = len(rows), parameters if len(parameters) > 1 else [*parameters] * len(rows)
    bounds = [0, *(k for k in range(1, n) if each[k] != each[k - 1]), n]
    return [
        (slice(begin, end), _in_lanes(rows[begin:end].T), vehicle_constants(each[begin], terms))
        for begin, end in pairwise(bounds)
    ]


def _strides(durations: Array, begin: int, end: int, longest: float) -> Iterator[tuple[int, int, float]]:
    """Yield first substep, end and duration of strides of at least `longest`, s."""
    first, elapsed = begin, 0.0
    for last, duration in enumerate(durations[begin:end].tolist(), begin + 1):
        elapsed += duration
        if elapsed >= longest or last == end:
            yield first, last, elapsed
            first, elapsed = last, 0.0


def _in_lanes(values: Array) -> Array:
    """Return quantities by model, shape (k, n), with one lane per model; unused lanes repeat the first model."""
    lanes, n = np.empty((len(values), LANES)), values.shape[1]
    lanes[:, :n] = values
    lanes[:, n:] = values[:, :1]
    return lanes.ravel()


def unchanged_motion(elapsed: Array, motion: Array, angles: Array | None = None) -> Array:
    """Return motion with constant velocities and rates, shape (n, 10).

    Attitude by Rodrigues' formula, depth by its integral.

    Parameters
    ----------
    elapsed : ndarray, shape (n,)
        Time since the start, s, increasing in steps of less than half a turn.
    motion : ndarray, shape (10,)
        Motion and depth at the start.
    angles : ndarray, shape (3,), optional
        Roll, pitch and yaw shortly before the first time, without a jump of a turn to it; default: at the start.
    """
    rates, begin = motion[3:6], motion[6:9]
    rate = float(np.linalg.norm(rates)) or 1.0
    p, q, r = rates / rate
    across = np.array([[0.0, -r, q], [r, 0.0, -p], [-q, p, 0.0]])
    turned = rate * elapsed[:, None, None]
    first, sine, versine = rotation_matrix(begin), np.sin(turned), 1.0 - np.cos(turned)
    attitude = euler_angles(first @ (np.eye(3) + sine * across + versine * across @ across))
    way = np.eye(3) * elapsed[:, None, None] + (versine * across + (turned - sine) * across @ across) / rate
    depth = motion[9] + (first @ way @ motion[:3])[:, 2]
    before = begin if angles is None else angles
    attitude = np.unwrap(np.vstack([before, attitude]), axis=0)[1:]
    return np.column_stack([np.tile(motion[:6], (elapsed.size, 1)), attitude, depth])
