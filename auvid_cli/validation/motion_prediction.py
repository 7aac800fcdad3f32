"""Motion ahead of a start: of many models side by side, and as it would go on unchanged."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.free_motion import N_PREDICTED, move_through
from auvid_cli.lanes import LANES
from auvid_cli.validation.signals import SAME
from auvid_cli.vehicle.coefficients import Coefficient
from auvid_cli.vehicle.dynamics import N_WORK, NO_ERRORS, vehicle_constants, with_errors
from auvid_cli.vehicle.kinematics import euler_angles, rotation_matrix

Array = NDArray[np.float64]


# s; process noise and what disturbs push at least so long apart, which is short beside how fast a vehicle answers.
_BETWEEN_PUSHES, _BETWEEN_DISTURBANCES = 0.1, 0.05


class Shaken(NamedTuple):
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
    shaken: Shaken | None = None,
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
