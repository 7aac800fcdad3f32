"""Predict the motion of an identified model, and compare it with measured signals."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import TURN_RATE_WINDOW, rate_noise, rate_of_change
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.process import N_PREDICTED, move_through
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.equations import N_WORK, NO_ERRORS, vehicle_constants, with_errors
from auvid_cli.vehicle.kinematics import euler_angles, rotation_matrix
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, MOTION_SYMBOLS, SENSORS, state_of

Array = NDArray[np.float64]
_ANGLES = MOTION_SYMBOLS[6:]
# s; times that differ by less are the same: those of events are whole nanoseconds, half of one from a measurement's.
SAME = 0.75e-9
# Headings before and after one of which the yaw rate is told, at least.
_FEWEST_AROUND = 2
# s; process noise and what disturbs push at least so long apart, which is short beside how fast a vehicle answers.
_BETWEEN_PUSHES, _BETWEEN_DISTURBANCES = 0.1, 0.05


class MeasuredSignal(NamedTuple):
    """Measurements of one motion state, or of the depth.

    Attributes
    ----------
    time, values : ndarray, shape (n,)
        Finite measurements only, s and SI; angles without jumps of a turn.
    deviation : float
        Stated standard deviation of a measurement, SI.
    """

    time: Array
    values: Array
    deviation: float

    def since(self, time: float) -> int:
        """Return the index of the first measurement at or after a time."""
        return int(np.searchsorted(self.time, time - SAME))

    def turns(self, time: float, value: float) -> float:
        """Return what to add to a value to be on the same turn as the measurements, rad; a multiple of a turn."""
        measurement = self.values[max(int(np.searchsorted(self.time, time + SAME)) - 1, 0)]
        return 2.0 * np.pi * float(np.round((measurement - value) / (2.0 * np.pi)))


class SignalSize(NamedTuple):
    """What the measurements of one signal are like, over all segments.

    Attributes
    ----------
    deviation : float
        Stated standard deviation of a measurement, SI; of several, root of the mean square.
    variance : float
        Of the measurements about the mean of their segment, SI.
    """

    deviation: float
    variance: float


def is_angle(symbol: str) -> bool:
    """Say whether a motion state is known modulo a turn."""
    return symbol in _ANGLES


def measured_signals(measuring: Mapping[str, SensorRecord]) -> dict[str, MeasuredSignal]:
    """Return signals by symbol, motion states in their order and the depth; those that are measured."""
    signals = {}
    for name, record in measuring.items():
        for component, quantity in enumerate(SENSORS[name]):
            values = record.values[:, component]
            finite = np.isfinite(values)
            if finite.any():
                symbol = state_of(quantity)
                continuous = np.unwrap(values[finite]) if is_angle(symbol) else values[finite]
                deviation = float(record.standard_deviation[component])
                signals[symbol] = MeasuredSignal(record.time[finite], continuous, deviation)
    if "r" not in signals and (yaw_rate := _yaw_rate_by_attitude(signals)) is not None:
        signals["r"] = yaw_rate
    return {symbol: signals[symbol] for symbol in MOTION_AND_DEPTH_SYMBOLS if symbol in signals}


def signal_sizes(segments: Sequence[Mapping[str, MeasuredSignal]]) -> dict[str, SignalSize]:
    """Return what signals of several segments are like, by symbol, in the order of `measured_signals`."""
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
    """Take the yaw rate from how the attitude changes, by cubics through a second of it.

    ``r = psi_dot cos phi cos theta - theta_dot sin phi`` (Fossen 2011, eq. 2.28); an angle that is not measured at the
    times of the heading is taken as zero. None if there is no heading, or it comes too seldom.
    """
    if "psi" not in signals or signals["psi"].time.size < 3:
        return None
    time, heading, deviation = signals["psi"]
    interval = float(np.median(np.diff(time)))
    half = round(0.5 * TURN_RATE_WINDOW / interval)
    # Half a window before and after, and a little more, measurements come without a gap.
    ends = np.concatenate([[True], np.diff(time) > 0.5 * TURN_RATE_WINDOW, [True]])
    last_begin = np.maximum.accumulate(np.where(ends[:-1], time, -np.inf))
    next_end = np.minimum.accumulate(np.where(ends[1:], time, np.inf)[::-1])[::-1]
    good = np.minimum(time - last_begin, next_end - time) >= (half + 0.9) * interval
    if half < _FEWEST_AROUND or not good.any():
        return None
    # One more than there are headings, so that the last is between two.
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


class DisturbedModels(NamedTuple):
    """Models that process noise moves as well.

    Attributes
    ----------
    which : slice
    density : ndarray, shape (10,)
        Root of the spectral density of the white noise on the rate of each motion state and of the depth, SI / s^0.5.
    rng : numpy.random.Generator
    """

    which: slice
    density: Array
    rng: np.random.Generator

    def push(self, states: Array, elapsed: float) -> None:
        """Add what came of it in some time, s, to the states, shape (10, n)."""
        pushed = states[:, self.which]
        pushed += np.sqrt(elapsed) * self.density[:, None] * self.rng.standard_normal(pushed.shape)


class Disturbed(NamedTuple):
    """What disturbs models side by side: a Gauss-Markov force or moment for each axis.

    Attributes
    ----------
    which : slice
        Those models for which it goes on at random; for the others it fades.
    force : ndarray, shape (6, n)
        At present, N and N m; changed on the way.
    deviation, time_constant : ndarray, shape (6,)
        Of each axis in the long run, and after which 1/e of it is left, s.
    inverse : ndarray, shape (6, 6)
        Of the mass matrix.
    rng : numpy.random.Generator
    """

    which: slice
    force: Array
    deviation: Array
    time_constant: Array
    inverse: Array
    rng: np.random.Generator

    def push(self, states: Array, elapsed: float) -> None:
        """Let it act for some time, s, on the states, shape (10, n)."""
        states[:6] += elapsed * self.inverse @ self.force

    def go_on(self, elapsed: float) -> None:
        """Let some time pass, s."""
        left = np.exp(-elapsed / self.time_constant)[:, None]
        self.force[:] *= left
        driven = self.force[:, self.which]
        driven += np.sqrt(1.0 - left**2) * self.deviation[:, None] * self.rng.standard_normal(driven.shape)


def move_side_by_side(
    timelines: Iterable[Timeline],
    motion: Array,
    coefficients: Array,
    parameters: Mapping[str, float],
    wanted: Array,
    shaken: DisturbedModels | None = None,
    disturbed: Disturbed | None = None,
    errors: Sequence[float] | Array = NO_ERRORS,
    terms: Sequence[Coefficient] = (),
) -> Array:
    """Move up to `LANES` models by the same inputs.

    Parameters
    ----------
    timelines : iterable of Timeline
        Gone through as far as the last time wanted.
    motion : ndarray, shape (n, 10)
        At the start, of each model, the depth behind it.
    coefficients : ndarray, shape (n, 22 + terms)
        SI.
    parameters : mapping
        Known parameters of all of them.
    wanted : ndarray, shape (k,)
        Times of events, s, increasing.
    shaken : Shaken, optional
    disturbed : Disturbed, optional
    errors : ndarray, shape (5,) or (n, 5)
        What the thrust, the fins and the ballast are beyond the stated, see `NO_ERRORS`.
    terms : sequence of Coefficient
        Of the vehicle's own.

    Returns
    -------
    ndarray, shape (k, n, 10)
        Not finite where a model has blown up.
    """
    n = len(motion)
    constants, work = vehicle_constants(parameters, terms), np.zeros(N_WORK)
    block, rows = (_in_lanes(each) for each in (motion, with_errors(coefficients, errors)))
    states, moved = block.reshape(N_PREDICTED, LANES), np.empty((wanted.size, n, N_PREDICTED))
    # What acts at random does so at the end of each stride; without it there is nothing to stop for.
    longest = _BETWEEN_DISTURBANCES if disturbed is not None else inf if shaken is None else _BETWEEN_PUSHES
    done = 0

    def move(timeline: Timeline, begin: int, end: int) -> None:
        for first, last, elapsed in _strides(timeline.substep_duration, begin, end, longest):
            if disturbed is not None:
                disturbed.push(states[:, :n], 0.5 * elapsed)
            move_through(block, rows, constants, n, timeline, first, last, work)
            if disturbed is not None:
                disturbed.go_on(elapsed)
                disturbed.push(states[:, :n], 0.5 * elapsed)
            if shaken is not None:
                shaken.push(states, elapsed)

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


def _strides(durations: Array, begin: int, end: int, longest: float) -> Iterator[tuple[int, int, float]]:
    """Yield strides of some substeps, which last so long, s, or just longer: first, end, and time that elapses."""
    first, elapsed = begin, 0.0
    for last, duration in enumerate(durations[begin:end].tolist(), begin + 1):
        elapsed += duration
        if elapsed >= longest or last == end:
            yield first, last, elapsed
            first, elapsed = last, 0.0


def _in_lanes(values: Array) -> Array:
    """Lay out rows of quantities with a lane for each model; lanes without one repeat the first."""
    lanes = np.tile(values[0], (LANES, 1))
    lanes[: len(values)] = values
    return np.ascontiguousarray(lanes.T).ravel()


def unchanged_motion(elapsed: Array, motion: Array, angles: Array | None = None) -> Array:
    """Hold velocities and rates; attitude and depth follow in closed form (Rodrigues' formula, and its integral).

    Parameters
    ----------
    elapsed : ndarray, shape (n,)
        s since the start, increasing, less than half a turn apart.
    motion : ndarray, shape (10,)
        At the start, the depth behind it.
    angles : ndarray, shape (3,), optional
        Roll, pitch, yaw shortly before the first of these times, from which no angle jumps a turn; else at the start.

    Returns
    -------
    ndarray, shape (n, 10)
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
