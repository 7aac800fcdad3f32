"""Iterated smoother: the most probable trajectory and parameters, process noise included.

Gauss-Newton on the cost of a whole trajectory (Bell, SIAM J. Optim. 4(3), 1994): squares of what it needs of process
noise, of residuals and of the distance to the prior, each by its variance. Each step is a linear smoothing problem
about the last trajectory, solved by a filter forward and its adjoint backward. A filter cannot take back what it
concluded far from the answer; this linearises anew where the data have led it.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from auvid_cli.filters.point_sets import cubature
from auvid_cli.filters.problem import (
    NOT_CONVERGED,
    OK,
    PREDICTION,
    FilterOutcome,
    Gaussian,
    OnChunk,
    Process,
    Records,
    Sensors,
    Timeline,
)
from auvid_cli.filters.segments import of_segment, one_after_the_other, places, with_parameters
from auvid_cli.filters.smoothing_pass import Linearised, Trace, Work, backward, forward, linearise_measurements
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.square_root_state import State
from auvid_cli.filters.workspace import padded

Array = NDArray[np.float64]

# Squares of standard deviations by which the cost may still fall, by the linear problem, at the last step: with 22
# parameters a fall of so much moves none of them by more than a few hundredths of its standard deviation.
_NEGLIGIBLE = 1e-3
# Shortest share of a step that is tried.
_SHORTEST = 2.0**-10
# Times the process noise, for a start that only follows the measurements.
_LOOSE = 100.0


@dataclass(frozen=True)
class Trajectory:
    """A history of the state.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
    initial : list of ndarray, shape (n_moving,)
        Moving states at the beginning of each segment: those at its first event, unless something leads to that.
    moving : list of list of ndarray, shape (n_events, n_moving)
        By segment and chunk, at each event.
    """

    parameters: Array
    initial: list[Array]
    moving: list[list[Array]]

    def stepped(self, step: "Trajectory", share: float) -> "Trajectory":
        """Go a share of a step."""
        moved = [
            [chunk + share * by for chunk, by in zip(*segments, strict=True)]
            for segments in zip(self.moving, step.moving, strict=True)
        ]
        initial = [state + share * by for state, by in zip(self.initial, step.initial, strict=True)]
        return Trajectory(self.parameters + share * step.parameters, initial, moved)


@dataclass(frozen=True)
class _Filtered:
    """The linear problem about a trajectory, filtered to the end.

    Attributes
    ----------
    trajectory : Trajectory
    cost, least : float
        Of the trajectory, and at the minimum of the linear problem.
    before : list of list of State
        Deviation before each chunk of each segment.
    by_parameters : list of ndarray, shape (n_moving, n_parameters)
        What each segment's first moving states owe to the parameters.
    final : State
        Deviation at the end.
    """

    trajectory: Trajectory
    cost: float
    least: float
    before: list[list[State]]
    by_parameters: list[Array]
    final: State


class _Smoothed(NamedTuple):
    """A chunk of the answer to a linear problem.

    Attributes
    ----------
    segment : int
    timeline : Timeline
    trace : Trace
    step, variance : ndarray, shape (n_events, n_moving)
        Smoothed deviation of the moving states, and its variance if asked for.
    adjoint : ndarray, shape (n,)
        What the data from here on say of the deviation before the chunk.
    """

    segment: int
    timeline: Timeline
    trace: Trace
    step: Array
    variance: Array
    adjoint: Array


def run_smoother(
    process: Process,
    sensors: Sensors,
    segments: Sequence[Iterable[Timeline]],
    prior: Gaussian,
    on_chunk: OnChunk,
    max_passes: int = 50,
) -> FilterOutcome:
    """Find the most probable parameters and motion.

    It starts from the trajectory of a CKF, and from one that keeps the prior's parameters and follows the
    measurements; the more probable of the two answers counts.

    Parameters
    ----------
    process, sensors, on_chunk
        As of `run_square_root_filter`; every measurement counts, whatever the gate. What is received has constant
        parameters, the smoothed motion, and the innovations of the last filter pass.
    segments : sequence of iterable of Timeline
        In time order; gone through many times.
    prior : Gaussian
        About their joint state, see `auvid_cli.filters.segments`.
    max_passes : int
        Of the filter through the data, from each start.

    Returns
    -------
    FilterOutcome
        `NOT_CONVERGED` if `max_passes` were not enough; `PREDICTION` if no start has a finite cost.
    """
    problem = _Problem(process, sensors, segments, prior)
    answers = [answer for start in problem.starts() if (answer := problem.minimise(start, max_passes)) is not None]
    if not answers:
        return FilterOutcome(prior.factor @ prior.factor.T, 0, PREDICTION)
    best, converged = min(answers, key=lambda answer: answer[0].cost)
    return problem.hand_over(best, on_chunk, OK if converged else NOT_CONVERGED)


class _Problem:
    """The linear problems that follow each other."""

    def __init__(
        self, process: Process, sensors: Sensors, segments: Sequence[Iterable[Timeline]], prior: Gaussian
    ) -> None:
        self._process, self._sensors, self._segments, self._prior = process, sensors, segments, prior
        self._n_moving = process.noise_density.size
        self._n_parameters = prior.mean.size - len(segments) * self._n_moving
        self._n = self._n_parameters + self._n_moving
        self._places = places(prior.mean.size, self._n_moving, len(segments))
        self._work = _new_work(process, self._n, sensors.matrix.shape[1])

    def starts(self) -> Iterator[Trajectory]:
        """Yield trajectories to start from: as a CKF has it, and with the prior's parameters along the measurements."""
        if (filtered := self._ckf(self._process, self._prior)) is not None:
            yield filtered
        loose = self._process._replace(noise_density=_LOOSE * self._process.noise_density)
        held = self._prior.factor.copy()
        held[:, : self._n_parameters] *= 1e-3
        if (followed := self._ckf(loose, self._prior._replace(factor=held))) is not None:
            yield replace(followed, parameters=self._prior.mean[: self._n_parameters])

    def _ckf(self, process: Process, prior: Gaussian) -> Trajectory | None:
        """Filter the data; None if the filter fails."""
        moving: list[list[Array]] = []
        parameters = prior.mean[: self._n_parameters]

        def keep(timeline: Timeline, records: Records) -> None:
            nonlocal parameters
            if len(records.mean):
                parameters = records.mean[-1, : self._n_parameters]
            moving[-1].append(records.mean[:, self._n_parameters :].copy())

        def run(timelines: Iterable[Timeline], gaussian: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
            moving.append([])
            points = cubature(self._n)
            return run_square_root_filter(points, process, self._sensors, timelines, gaussian, on_chunk)

        outcome = one_after_the_other(run, self._n_moving, self._segments, prior, keep)
        if outcome.failure != OK:
            return None
        initial = [
            self._prior.mean[place[self._n_parameters :]] if _is_led_to(next(iter(timelines))) else chunks[0][0]
            for place, timelines, chunks in zip(self._places, self._segments, moving, strict=True)
        ]
        return Trajectory(parameters.copy(), initial, moving)

    def minimise(self, start: Trajectory, max_passes: int) -> tuple[_Filtered, bool] | None:
        """Step down from a trajectory; where it ends, and whether that is a minimum. None if its cost is not finite."""
        here, passes = self._filter(start), 1
        if here is None:
            return None
        while here.cost - here.least > _NEGLIGIBLE:
            step, share, lower = self._smooth(here), 1.0, None
            while lower is None and share >= _SHORTEST and passes < max_passes:
                tried = self._filter(here.trajectory.stepped(step, share))
                if tried is not None and tried.cost < here.cost:
                    lower = tried
                share, passes = share / 2.0, passes + 1
            if lower is None:
                return here, False
            if here.cost - lower.cost < _NEGLIGIBLE:
                return lower, True
            here = lower
        return here, True

    def _about(self, trajectory: Trajectory, segment: int, chunk: int, timeline: Timeline) -> Linearised:
        """Linearise a chunk about a trajectory."""
        chunks, shape = trajectory.moving[segment], timeline.measurement.shape
        before = chunks[chunk - 1][-1] if chunk else trajectory.initial[segment]
        residual, rows = np.full(shape, np.nan), np.zeros((*shape, self._n))
        about = Linearised(trajectory.parameters, before, chunks[chunk], residual, rows)
        linearise_measurements(self._sensors, timeline, about)
        if self._sensors.nonlinear.any():
            self._linearise_nonlinear(timeline, about)
        return about

    def _linearise_nonlinear(self, timeline: Timeline, about: Linearised) -> None:
        assert self._process.linearise is not None, "a nonlinear sensor needs `Process.linearise`"
        event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
        for k in np.flatnonzero(self._sensors.nonlinear[timeline.measurement_sensor]):
            state = np.concatenate([about.parameters, about.moving[event[k]]])
            predicted, matrix = self._process.linearise(state, int(timeline.measurement_sensor[k]))
            about.residual[k, : predicted.size] = timeline.measurement[k, : predicted.size] - predicted
            about.rows[k, : predicted.size] = matrix

    def _filter(self, trajectory: Trajectory) -> _Filtered | None:
        """Filter the deviations from a trajectory; None where it has no finite cost."""
        cost, least, before, by_parameters, state = 0.0, 0.0, [], [], None
        for segment in range(len(self._segments)):
            gaussian, owed, distance = self._beginning(trajectory, segment, state)
            cost += distance
            # The first segment's prior counts as a whole, of the others what it says of their own states.
            by_parameters.append(owed)
            state = self._state(gaussian)
            before.append([])
            for chunk, timeline in enumerate(self._segments[segment]):
                about = self._about(trajectory, segment, chunk, timeline)
                before[-1].append(state.copy())
                good, chunk_cost, chunk_least = self._forward(timeline, about, state)
                cost, least = cost + chunk_cost, least + chunk_least
                if good < timeline.time.size:
                    return None
        assert state is not None, "there is at least one segment"
        return _Filtered(trajectory, cost, least, before, by_parameters, state)

    def _beginning(self, trajectory: Trajectory, segment: int, state: State | None) -> tuple[Gaussian, Array, float]:
        """Find what is known of the deviation before a segment, what its motion owes to the parameters, its cost."""
        n = self._n_parameters
        own = of_segment(self._prior, self._places[segment])
        nominal = np.concatenate([trajectory.parameters, trajectory.initial[segment]])
        distance = solve_triangular(own.factor, nominal - own.mean, lower=True)
        owed = solve_triangular(own.factor[:n, :n].T, own.factor[n:, :n].T, lower=False).T
        if state is not None:
            known = Gaussian(trajectory.parameters + state.mean[:n], state.columns[:n, :n].T.copy())
            own, distance = with_parameters(own, known), distance[n:]
        return own._replace(mean=own.mean - nominal), owed, float(distance @ distance)

    def _state(self, gaussian: Gaussian) -> State:
        return State.of(gaussian, self._n + self._n % 2, padded(self._n + self._sensors.matrix.shape[1]))

    def _forward(
        self, timeline: Timeline, about: Linearised, state: State, trace: Trace | None = None
    ) -> tuple[int, float, float]:
        p = self._process
        model = p.transition, p.constants, p.selection, p.noise_density
        into = _new_trace(timeline, about) if trace is None else trace
        return forward(*model, self._sensors, timeline, about, state, trace is not None, into, self._work)

    def _smooth(self, filtered: _Filtered) -> Trajectory:
        """Solve the linear problem: the step from its trajectory to the answer."""
        n = self._n_parameters
        initial: list[Array] = [np.zeros(0)] * len(self._segments)
        moving: list[list[Array]] = [[] for _ in self._segments]
        for chunk in self._backward(filtered, with_variance=False):
            moving[chunk.segment].insert(0, chunk.step)
            before = filtered.before[chunk.segment][0]
            factor = before.columns[: self._n, : self._n].T
            led = before.mean[n : self._n] + factor[n:] @ (factor.T @ chunk.adjoint)
            # Of the first chunk, which comes last.
            initial[chunk.segment] = led if _is_led_to(chunk.timeline) else chunk.step[0]
        return Trajectory(filtered.final.mean[:n].copy(), initial, moving)

    def _backward(self, filtered: _Filtered, with_variance: bool) -> Iterator[_Smoothed]:
        """Smooth chunk by chunk, from the last to the first.

        Each chunk is filtered once more from where it began: what the way back needs is large.
        """
        n, n_parameters = self._n, self._n_parameters
        adjoint, information = np.zeros(n), np.zeros((n, n) if with_variance else (0, 0))
        for segment in reversed(range(len(self._segments))):
            for chunk, timeline in reversed([*enumerate(self._segments[segment])]):
                about = self._about(filtered.trajectory, segment, chunk, timeline)
                trace = _new_trace(timeline, about)
                self._forward(timeline, about, filtered.before[segment][chunk].copy(), trace)
                step, variance = (np.zeros(about.moving.shape) for _ in range(2))
                backward(timeline, about, trace, adjoint, information, step, variance, self._work.product)
                yield _Smoothed(segment, timeline, trace, step, variance, adjoint.copy())
            # The motion before is another: what is known of this one says something of the parameters alone.
            owed = np.vstack([np.eye(n_parameters), filtered.by_parameters[segment]])
            adjoint[:n_parameters], adjoint[n_parameters:] = owed.T @ adjoint, 0.0
            if with_variance:
                of_parameters = owed.T @ information @ owed
                information[:] = 0.0
                information[:n_parameters, :n_parameters] = of_parameters

    def hand_over(self, filtered: _Filtered, on_chunk: OnChunk, failure: int) -> FilterOutcome:
        """Pass on the smoothed trajectory, chunk by chunk, from the first to the last."""
        covariance = filtered.final.covariance()
        deviation = np.sqrt(np.diagonal(covariance))[: self._n_parameters]
        parameters = filtered.trajectory.parameters + filtered.final.mean[: self._n_parameters]
        nominal = [moving for segment in filtered.trajectory.moving for moving in segment]
        smoothed = self._backward(filtered, with_variance=True)
        chunks = []
        for moving, chunk in zip(reversed(nominal), smoothed, strict=True):
            rows, trace = len(moving), chunk.trace
            squares = np.where(np.isnan(trace.innovation), 0.0, trace.error**2 / trace.total)
            records = Records(
                np.hstack([np.tile(parameters, (rows, 1)), moving + chunk.step]),
                np.hstack([np.tile(deviation, (rows, 1)), np.sqrt(np.maximum(chunk.variance, 0.0))]),
                trace.innovation,
                trace.variance,
                squares.sum(axis=1),
            )
            chunks.append((chunk.timeline, records))
        for timeline, records in reversed(chunks):
            on_chunk(timeline, records)
        return FilterOutcome(covariance, sum(timeline.time.size for timeline, _ in chunks), failure)


def _is_led_to(first: Timeline) -> bool:
    """Say whether anything leads to the first event of a segment."""
    return bool(first.substep_offset[1] > first.substep_offset[0])


def _new_trace(timeline: Timeline, about: Linearised) -> Trace:
    n_events, (n_measurements, n_components, n) = timeline.time.size, about.rows.shape
    n_moving = about.before.size
    return Trace(
        np.empty((n_events, n_moving, n)),
        np.empty((n_events, n)),
        np.empty((n_events, n_moving, n)),
        np.empty((n_measurements, n_components, n)),
        *(np.ones((n_measurements, n_components)) for _ in range(2)),
        *(np.full((n_measurements, n_components), np.nan) for _ in range(2)),
    )


def _new_work(process: Process, n: int, n_components: int) -> Work:
    n_moving, even = process.noise_density.size, n + n % 2
    rows = n_moving + 2
    return Work(
        point=np.zeros(n),
        matrix=np.eye(n),
        product=np.zeros((n, n)),
        spread=np.zeros((rows, padded(2 * n_moving))),
        lower=np.zeros((rows, rows)),
        gain=np.zeros(padded(n + n_components)),
        ratio=np.zeros(even),
        share=np.zeros(even),
        process=np.zeros(process.scratch_size),
    )
