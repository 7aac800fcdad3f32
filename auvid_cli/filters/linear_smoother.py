"""Linear smoothing problems about a trajectory: process noise, solution, Gauss-Newton descent and process memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from auvid_cli.filters.problem import Gaussian, ModelData, Process, Sensors, Timeline
from auvid_cli.filters.segments import JointProblem, with_parameters
from auvid_cli.filters.smoother_backward import Adjoint, backward
from auvid_cli.filters.smoother_forward import (
    ForwardPass,
    Linearised,
    SmootherWorkspace,
    forward,
    linearise_measurements,
    linearise_process,
    new_state,
)
from auvid_cli.filters.workspace import State

Array = NDArray[np.float64]
_STEP = 1e-5  # s, of the difference quotient for rates
_EVERY = 10  # events between those at which rates are evaluated
# Bytes of forward passes that are kept for the way back; beyond that, chunks are filtered again.
_KEPT = 2**28
# Possible decrease of the cost at which iterations stop, in squares of standard deviations: no parameter moves by more
# than a tenth of its standard deviation in the last step, and less in any further one.
_NEGLIGIBLE = 1e-2
# Smallest fraction of a step in the line search.
_SHORTEST = 2.0**-10


def noise_variance(process: Process, timeline: Timeline) -> Array:
    """Return the variance that process noise adds up to each event, shape (n_events, n_moving); 0 if nothing leads."""
    elapsed = _elapsed(timeline)
    driven = np.outer(elapsed, process.noise_density**2)
    if process.decay.size == 0:
        return driven
    forgotten = 2.0 * np.outer(elapsed, process.decay)
    left = np.divide(-np.expm1(-forgotten), forgotten, out=np.ones_like(forgotten), where=forgotten != 0.0)
    return driven * left


def variance_by_time_constant(process: Process, timeline: Timeline) -> Array:
    """Return how its logarithm depends on that of a state's time constant, of the same shape.

    A state of variance s^2, which stays, is driven by ``q^2 = 2 a s^2``, of which ``s^2 (1 - exp(-2 a h))`` is left.
    """
    elapsed = _elapsed(timeline)
    if process.decay.size == 0:
        return np.full((elapsed.size, process.noise_density.size), -1.0)
    forgotten = 2.0 * np.outer(elapsed, process.decay)
    return -np.divide(forgotten, np.expm1(forgotten), out=np.ones_like(forgotten), where=forgotten != 0.0)


def _elapsed(timeline: Timeline) -> Array:
    """Return the time that leads to each event, s."""
    return np.diff(np.concatenate([[0.0], np.cumsum(timeline.substep_duration)])[timeline.substep_offset])


def with_process_memory(problem: JointProblem, parameters: Array, moving: Sequence[Sequence[Array]]) -> JointProblem:
    """Return the problem with the mean rates at which the motion forgets process noise along a trajectory.

    They stay the same while the trajectory changes, so that likelihoods can be compared.

    Parameters
    ----------
    problem : JointProblem
    parameters : ndarray, shape (n_parameters,)
    moving : sequence of sequence of ndarray, shape (n_events, n_moving)
        Moving states by segment and chunk.
    """
    rates = [
        _rates(problem, timeline, np.hstack([np.tile(parameters, (len(chunk), 1)), chunk]))
        for segment, chunks in zip(problem.segments, moving, strict=True)
        for timeline, chunk in zip(segment, chunks, strict=True)
    ]
    return problem._replace(process=problem.process._replace(decay=np.concatenate(rates).mean(axis=0)))


def _rates(problem: JointProblem, timeline: Timeline, states: Array) -> Array:
    """Return the rates at some events of a chunk, shape (n, n_moving)."""
    process, n_parameters = problem.process, problem.n_parameters
    rates, matrix, scratch = [], np.eye(states.shape[1]), np.zeros(process.scratch_size)
    for event in range(0, len(states), _EVERY):
        substep = timeline.event_input[event : event + 1], np.array([_STEP])
        constants = process.constants, process.selection
        process.transition(states[event].copy(), timeline.inputs, *substep, *constants, matrix, scratch)
        rates.append((1.0 - np.diagonal(matrix)[n_parameters:]) / _STEP)
    return np.array(rates)


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
        Sum of the logarithms of the innovations' variances: with `min_log_factor` twice the negative log-likelihood of the
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
    forward_pass : ForwardPass
    step, variance : ndarray, shape (n_events, n_moving)
        Smoothed deviation of the moving states, and its variance if asked for.
    adjoint : ndarray, shape (n,)
        What the data from here on say of the deviation before the chunk.
    """

    segment: int
    timeline: Timeline
    forward_pass: ForwardPass
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
        self._work = SmootherWorkspace.of(process, self._n, sensors.matrix.shape[1])
        self._kept, self._kept_of = dict[tuple[int, int], tuple[Linearised, ForwardPass]](), None

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
                former, forward_pass = self._kept.pop((segment, chunk), (None, None))
                about = self._about(trajectory, segment, chunk, timeline, former)
                before[-1].append(state.copy())
                forward_pass = ForwardPass.of(about) if forward_pass is None else forward_pass
                if (room := room - sum(array.nbytes for array in (*forward_pass, about.rows, about.transition))) >= 0:
                    self._kept[segment, chunk] = about, forward_pass
                good, *sums = self._forward(timeline, about, state, forward_pass)
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
        adjoint = Adjoint.zeros(self._n, with_variance)
        for segment, timeline, about, forward_pass in self.forward_passes_back(filtered, adjoint):
            step, variance = (np.zeros(about.moving.shape) for _ in range(2))
            backward(timeline, about, forward_pass, adjoint, step, variance)
            yield Smoothed(segment, timeline, forward_pass, step, variance, adjoint.mean.copy())

    def forward_passes(self, filtered: Filtered) -> Iterator[tuple[int, Timeline, Linearised, ForwardPass]]:
        """Yield segment, data, linearisation and forward pass of each chunk, from the first to the last."""
        for segment in range(len(self._segments)):
            for chunk, timeline in enumerate(self._segments[segment]):
                yield segment, timeline, *self._forward_pass(filtered, segment, chunk, timeline)

    def linearised(
        self, filtered: Filtered, segment: int, backwards: bool = False
    ) -> Iterator[tuple[Timeline, Linearised]]:
        """Yield the linearised chunks of a segment, from the first or from the last, without filtering them."""
        chunks = enumerate(self._segments[segment])
        for chunk, timeline in reversed([*chunks]) if backwards else chunks:
            if self._is_kept(filtered, segment, chunk):
                yield timeline, self._kept[segment, chunk][0]
            else:
                yield timeline, self._about(filtered.trajectory, segment, chunk, timeline)

    def forward_passes_back(
        self, filtered: Filtered, adjoint: Adjoint
    ) -> Iterator[tuple[int, Timeline, Linearised, ForwardPass]]:
        """Yield the same from the last to the first; the caller propagates the adjoint back over each chunk."""
        for segment in reversed(range(len(self._segments))):
            for chunk, timeline in reversed([*enumerate(self._segments[segment])]):
                yield segment, timeline, *self._forward_pass(filtered, segment, chunk, timeline)
            adjoint.to_previous_segment(np.vstack([np.eye(self._n_parameters), filtered.by_parameters[segment]]))

    def _forward_pass(
        self, filtered: Filtered, segment: int, chunk: int, timeline: Timeline
    ) -> tuple[Linearised, ForwardPass]:
        """Return a chunk with its forward pass, filtered again unless that was kept."""
        if self._is_kept(filtered, segment, chunk):
            return self._kept[segment, chunk]
        about = self._about(filtered.trajectory, segment, chunk, timeline)
        forward_pass = ForwardPass.of(about)
        self._forward(timeline, about, filtered.before[segment][chunk].copy(), forward_pass)
        return about, forward_pass

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
        self, timeline: Timeline, about: Linearised, state: State, forward_pass: ForwardPass
    ) -> tuple[int, float, float, float]:
        noise = noise_variance(self._process, timeline)
        return forward(self._data.sensors, noise, timeline, about, state, forward_pass, self._work)


def is_led_to(first: Timeline) -> bool:
    """Say whether anything leads to the first event of a segment."""
    return bool(first.substep_offset[1] > first.substep_offset[0])


def gauss_newton(smoothing: LinearSmoothing, start: Trajectory, max_passes: int) -> tuple[Filtered, bool] | None:
    """Find the most probable trajectory from another one, by Gauss-Newton steps with a line search.

    Parameters
    ----------
    smoothing : LinearSmoothing
    start : Trajectory
    max_passes : int
        Of the filter through the data.

    Returns
    -------
    filtered : Filtered
        About the last trajectory.
    converged : bool
        None in place of both if the cost of `start` is not finite.
    """
    here, passes = smoothing.filter(start), 1
    if here is None:
        return None
    while here.cost - here.least > _NEGLIGIBLE:
        step, share, lower = smoothing.step(here), 1.0, None
        while lower is None and share >= _SHORTEST and passes < max_passes:
            tried = smoothing.filter(here.trajectory.stepped(step, share))
            if tried is not None and tried.cost < here.cost:
                lower = tried
            share, passes = share / 2.0, passes + 1
        if lower is None:
            return here, False
        if here.cost - lower.cost < _NEGLIGIBLE:
            return lower, True
        here = lower
    return here, True
