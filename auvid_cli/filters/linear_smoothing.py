"""Linear smoothing problems about trajectories: what a step of the smoother solves.

Forward goes a filter of the deviations, see `auvid_cli.filters.smoothing_forward`, through all segments and chunks;
backward its adjoint, see `auvid_cli.filters.smoothing_backward`. Segments share the parameters: the filter carries
these from one to the next, the adjoint what later ones say of them back.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from auvid_cli.filters.problem import Gaussian, ModelData, Process, Sensors, Timeline
from auvid_cli.filters.process_noise import noise_variance
from auvid_cli.filters.segments import JointProblem, with_parameters
from auvid_cli.filters.smoothing_backward import Adjoint, backward
from auvid_cli.filters.smoothing_forward import (
    Linearised,
    Trace,
    Work,
    forward,
    linearise_measurements,
    linearise_process,
    new_state,
)
from auvid_cli.filters.square_root_state import State

Array = NDArray[np.float64]

# Bytes of what the way forward leaves for the way back that are kept; what is more is filtered again.
_KEPT = 2**28


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
class Filtered:
    """The linear problem about a trajectory, filtered to the end.

    Attributes
    ----------
    trajectory : Trajectory
    cost, least : float
        Of the trajectory, and at the minimum of the linear problem.
    log_determinant : float
        Sum of the logarithms of the innovations' variances: with `least` twice the negative log-likelihood of the
        measurements in the linear problem, but for a constant.
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
    log_determinant: float
    before: list[list[State]]
    by_parameters: list[Array]
    final: State


class Smoothed(NamedTuple):
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


class LinearSmoothing:
    """Linear problems about one trajectory after the other.

    Parameters
    ----------
    problem : JointProblem
    """

    def __init__(self, problem: JointProblem) -> None:
        process, sensors, self._segments, _ = problem
        self._process, self._priors = process, problem.priors
        self._data = ModelData.of(process, sensors)
        self._n_parameters = problem.n_parameters
        self._n = problem.n_parameters + problem.n_moving
        self._work = Work.of(process, self._n, sensors.matrix.shape[1])
        self._kept, self._kept_of = dict[tuple[int, int], tuple[Linearised, Trace]](), None

    def change_noise(self, process: Process, sensors: Sensors) -> None:
        """Go over to other process and measurement noise; all else is as before."""
        self._process, self._data = process, ModelData.of(process, sensors)
        self._kept_of = None

    def filter(self, trajectory: Trajectory) -> Filtered | None:
        """Filter the deviations from a trajectory; None where it has no finite cost."""
        cost, least, log_determinant, before, by_parameters, state = 0.0, 0.0, 0.0, [], [], None
        self._kept_of, room = trajectory, _KEPT
        for segment in range(len(self._segments)):
            gaussian, owed, distance = self._beginning(trajectory, segment, state)
            cost += distance
            # The first segment's prior counts as a whole, of the others what it says of their own states.
            by_parameters.append(owed)
            state = new_state(gaussian)
            before.append([])
            for chunk, timeline in enumerate(self._segments[segment]):
                # Into the arrays of the last trajectory: fresh ones come page by page, and slowly.
                former, trace = self._kept.pop((segment, chunk), (None, None))
                about = self._about(trajectory, segment, chunk, timeline, former)
                before[-1].append(state.copy())
                trace = Trace.of(about) if trace is None else trace
                if (room := room - sum(array.nbytes for array in (*trace, about.rows, about.transition))) >= 0:
                    self._kept[segment, chunk] = about, trace
                good, *sums = self._forward(timeline, about, state, trace)
                cost, least, log_determinant = cost + sums[0], least + sums[1], log_determinant + sums[2]
                if good < timeline.time.size:
                    return None
        assert state is not None, "there is at least one segment"
        return Filtered(trajectory, cost, least, log_determinant, before, by_parameters, state)

    def step(self, filtered: Filtered) -> Trajectory:
        """Solve the linear problem: the step from its trajectory to the answer."""
        n = self._n_parameters
        initial: list[Array] = [np.zeros(0)] * len(self._segments)
        moving: list[list[Array]] = [[] for _ in self._segments]
        for chunk in self.smooth(filtered, with_variance=False):
            moving[chunk.segment].insert(0, chunk.step)
            before = filtered.before[chunk.segment][0]
            factor = before.columns[: self._n, : self._n].T
            led = before.mean[n : self._n] + factor[n:] @ (factor.T @ chunk.adjoint)
            # Of the first chunk, which comes last.
            initial[chunk.segment] = led if is_led_to(chunk.timeline) else chunk.step[0]
        return Trajectory(filtered.final.mean[:n].copy(), initial, moving)

    def smooth(self, filtered: Filtered, with_variance: bool) -> Iterator[Smoothed]:
        """Smooth chunk by chunk, from the last to the first.

        What the way back needs is large: a chunk of which it was not kept is filtered once more from where it began.
        """
        adjoint = Adjoint.of_nothing(self._n, with_variance)
        for segment, timeline, about, trace in self.traced_back(filtered, adjoint):
            step, variance = (np.zeros(about.moving.shape) for _ in range(2))
            backward(timeline, about, trace, adjoint, step, variance)
            yield Smoothed(segment, timeline, trace, step, variance, adjoint.mean.copy())

    def traced(self, filtered: Filtered) -> Iterator[tuple[int, Timeline, Linearised, Trace]]:
        """Go through the chunks of each segment once more, from the first to the last."""
        for segment in range(len(self._segments)):
            for chunk, timeline in enumerate(self._segments[segment]):
                yield segment, timeline, *self._traced(filtered, segment, chunk, timeline)

    def linearised_segment(self, filtered: Filtered, segment: int) -> Iterator[tuple[Timeline, Linearised]]:
        """Go through the chunks of one of them, without filtering them again."""
        for chunk, timeline in enumerate(self._segments[segment]):
            yield timeline, self._linearised(filtered, segment, chunk, timeline)

    def linearised_back(self, filtered: Filtered, segment: int) -> Iterator[tuple[Timeline, Linearised]]:
        """Go through the same from the last to the first."""
        for chunk, timeline in reversed([*enumerate(self._segments[segment])]):
            yield timeline, self._linearised(filtered, segment, chunk, timeline)

    def traced_back(self, filtered: Filtered, adjoint: Adjoint) -> Iterator[tuple[int, Timeline, Linearised, Trace]]:
        """Go through them from the last to the first, with an adjoint that is to be carried back over each."""
        for segment in reversed(range(len(self._segments))):
            for chunk, timeline in reversed([*enumerate(self._segments[segment])]):
                yield segment, timeline, *self._traced(filtered, segment, chunk, timeline)
            adjoint.pass_on(np.vstack([np.eye(self._n_parameters), filtered.by_parameters[segment]]))

    def _traced(self, filtered: Filtered, segment: int, chunk: int, timeline: Timeline) -> tuple[Linearised, Trace]:
        """Return what the way back needs of a chunk."""
        if self._is_kept(filtered, segment, chunk):
            return self._kept[segment, chunk]
        about = self._about(filtered.trajectory, segment, chunk, timeline)
        trace = Trace.of(about)
        self._forward(timeline, about, filtered.before[segment][chunk].copy(), trace)
        return about, trace

    def _linearised(self, filtered: Filtered, segment: int, chunk: int, timeline: Timeline) -> Linearised:
        if self._is_kept(filtered, segment, chunk):
            return self._kept[segment, chunk][0]
        return self._about(filtered.trajectory, segment, chunk, timeline)

    def _is_kept(self, filtered: Filtered, segment: int, chunk: int) -> bool:
        return filtered.trajectory is self._kept_of and (segment, chunk) in self._kept

    def _about(
        self, trajectory: Trajectory, segment: int, chunk: int, timeline: Timeline, former: Linearised | None = None
    ) -> Linearised:
        """Linearise a chunk about a trajectory; in place of a former linearisation of it, if there is one."""
        chunks, shape = trajectory.moving[segment], timeline.measurement.shape
        before = chunks[chunk - 1][-1] if chunk else trajectory.initial[segment]
        if former is None:
            about = Linearised(
                trajectory.parameters,
                before,
                chunks[chunk],
                residual=np.full(shape, np.nan),
                rows=np.zeros((*shape, self._n)),
                defect=np.zeros(chunks[chunk].shape),
                transition=np.zeros((*chunks[chunk].shape, self._n)),
            )
        else:
            about = former._replace(parameters=trajectory.parameters, before=before, moving=chunks[chunk])
        linearise_process(self._process.transition, self._data, timeline, about, self._work)
        linearise_measurements(self._process.linearise, self._data, timeline, about, self._work)
        return about

    def _beginning(self, trajectory: Trajectory, segment: int, state: State | None) -> tuple[Gaussian, Array, float]:
        """Find what is known of the deviation before a segment, what its motion owes to the parameters, its cost."""
        n = self._n_parameters
        own = self._priors[segment]
        nominal = np.concatenate([trajectory.parameters, trajectory.initial[segment]])
        distance = solve_triangular(own.factor, nominal - own.mean, lower=True)
        owed = solve_triangular(own.factor[:n, :n].T, own.factor[n:, :n].T, lower=False).T
        if state is not None:
            known = Gaussian(trajectory.parameters + state.mean[:n], state.columns[:n, :n].T.copy())
            own, distance = with_parameters(own, known), distance[n:]
        return own._replace(mean=own.mean - nominal), owed, float(distance @ distance)

    def _forward(
        self, timeline: Timeline, about: Linearised, state: State, trace: Trace
    ) -> tuple[int, float, float, float]:
        noise = noise_variance(self._process, timeline)
        return forward(self._data.sensors, noise, timeline, about, state, trace, self._work)


def is_led_to(first: Timeline) -> bool:
    """Say whether anything leads to the first event of a segment."""
    return bool(first.substep_offset[1] > first.substep_offset[0])
