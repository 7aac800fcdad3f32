"""Linear smoothing about a trajectory: the linear problem and its solution, and Gauss-Newton steps."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import starmap
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from auvid_cli.arrays import Array, ArrayStore
from auvid_cli.filters.problem import ConvergenceStatus, Gaussian, JointProblem, ModelData, Timeline
from auvid_cli.filters.process_noise import accumulated_noise
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

T = TypeVar("T")

# Chunks that threads linearise while another one is filtered.
_N_AHEAD = 2
# Smallest number of chunks for which threads linearise ahead. With fewer, threads cost more time than they save if
# other processes use the cores.
_MIN_CHUNKS = 24
# Forward passes kept for the backward pass; other chunks are filtered twice.
CACHE_SIZE = 2**28  # bytes
# Smallest share of the chunks for which a cache is worth its memory.
_MIN_CACHED = 0.2
# Smallest decrease of the cost worth another iteration, in squares of standard deviations: in the last step no
# parameter moves by more than a tenth of its standard deviation.
MIN_DECREASE = 1e-2
# Smallest fraction of a step in the line search.
_MIN_FRACTION = 2.0**-10


def computed_ahead(
    function: Callable[..., T], items: Iterable[tuple[Any, ...]], trajectory: "Trajectory"
) -> Iterator[T]:
    """Yield a function of each item, in order; if the trajectory is long, threads compute the next ones meanwhile."""
    if sum(map(len, trajectory.moving)) < _MIN_CHUNKS:
        yield from starmap(function, items)
        return
    waiting = deque[Future[T]]()
    with ThreadPoolExecutor(_N_AHEAD) as threads:
        for item in items:
            waiting.append(threads.submit(function, *item))
            if len(waiting) > _N_AHEAD:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


@dataclass(frozen=True)
class Trajectory:
    """Parameters and motion over all data."""

    parameters: Array  # shape (n_parameters,)
    # Shape (n_moving,); moving states at the start of each segment, or at its first event if no substeps lead there
    initial: list[Array]
    # Shape (n_events, n_moving); moving states at each event, by segment and chunk
    moving: Sequence[Sequence[Array]]

    def stepped(self, step: "Trajectory", fraction: float) -> "Trajectory":
        """Return the trajectory after a fraction of a step."""
        moving = [ArrayStore() for _ in self.moving]
        for stepped, *chunks in zip(moving, self.moving, step.moving, strict=True):
            for chunk, change in zip(*chunks, strict=True):
                stepped.append(chunk + fraction * change)
        initial = [state + fraction * change for state, change in zip(self.initial, step.initial, strict=True)]
        return Trajectory(self.parameters + fraction * step.parameters, initial, moving)


@dataclass(frozen=True)
class Filtered:
    """Linear problem about a trajectory after its forward pass."""

    trajectory: Trajectory
    cost: float  # cost of the trajectory
    least: float  # cost at the minimum of the linear problem
    # Sum of the logarithms of the innovations' variances. ``least + log_determinant`` is minus twice the log-likelihood
    # of the measurements in the linear problem, up to a constant.
    log_determinant: float
    before: list[list[State]]  # deviation from the trajectory before each chunk, by segment
    # Shape (n_moving, n_parameters); for each segment the derivative of the initial moving states by the parameters,
    # from the correlations of the prior
    by_parameters: list[Array]
    final: State  # deviation at the end; its parameters are the estimate

    def estimate(self, n_parameters: int) -> Gaussian:
        """Return the estimate of the deviation of the parameters from those of the trajectory."""
        return Gaussian(self.final.mean[:n_parameters], self.final.columns[:n_parameters, :n_parameters].T)


class Smoothed(NamedTuple):
    """Smoothed chunk of a linear problem."""

    segment: int
    timeline: Timeline
    forward_pass: ForwardPass
    step: Array  # shape (n_events, n_moving); smoothed deviation of the moving states
    variance: Array  # shape (n_events, n_moving); variance of `step`; zero if not requested
    adjoint: Array  # shape (n,); adjoint before the chunk


class LinearSmoothing:
    """Linear problems about one trajectory after another; forward passes of the latest one are cached.

    Parameters
    ----------
    problem : JointProblem
    cache : int
        Memory of the cache, in multiples of the usual one.
    parameters_are_given : bool
        Whether the parameters of a trajectory are known, so that only the motion deviates from it: there are no
        parameters in deviations then.
    """

    def __init__(self, problem: JointProblem, cache: int = 1, parameters_are_given: bool = False) -> None:
        process, sensors, self._segments, _ = problem
        self._process, self._priors = process, problem.priors
        self._data = ModelData.of(process, sensors)
        self._n_states = problem.n_parameters + problem.n_moving
        self._n_parameters = 0 if parameters_are_given else problem.n_parameters
        # Number of states that deviate.
        self._n = self._n_parameters + problem.n_moving
        self._cache, self._cached_trajectory = dict[tuple[int, int], tuple[Linearised, ForwardPass]](), None
        self._cache_size = cache * CACHE_SIZE
        # The trajectory of all linearisations in the cache: noise changes forward passes only.
        self._linearised_trajectory: Trajectory | None = None

    def change_noise(self, problem: JointProblem) -> None:
        """Replace process and measurement noise and the prior by those of a problem with the same data."""
        if not np.array_equal(problem.process.constants, self._process.constants):
            self._linearised_trajectory = None
        self._process, self._priors = problem.process, problem.priors
        self._data = ModelData.of(problem.process, problem.sensors)
        self._cached_trajectory = None

    def filter(self, trajectory: Trajectory) -> Filtered | None:
        """Filter the deviations from a trajectory; None if its cost is not finite."""
        cost, least, log_determinant, before, by_parameters, state = 0.0, 0.0, 0.0, [], [], None
        is_linearised = trajectory is self._linearised_trajectory
        self._cached_trajectory, self._linearised_trajectory, room = trajectory, None, self._cache_size
        n_chunks = sum(map(len, trajectory.moving))

        def linearise(segment: int, chunk: int, timeline: Timeline) -> tuple[Timeline, Linearised, ForwardPass]:
            # Reuse the arrays of the last trajectory: new memory is slow, because it comes page by page.
            about, forward_pass = self._cache.pop((segment, chunk), (None, None))
            if about is None or not is_linearised:
                about = self._linearise(trajectory, segment, chunk, timeline, about)
            return timeline, about, ForwardPass.of(about) if forward_pass is None else forward_pass

        for segment in range(len(self._segments)):
            gaussian, derivative, distance = self._initial_deviation(trajectory, segment, state)
            cost += distance
            by_parameters.append(derivative)
            state = new_state(gaussian)
            before.append([])
            linearised = computed_ahead(linearise, self._chunks(segment), trajectory)
            for chunk, (timeline, about, forward_pass) in enumerate(linearised):
                before[-1].append(state.copy())
                size = sum(array.nbytes for array in (*forward_pass, about.rows, about.transition))
                if segment == chunk == 0 and room < _MIN_CACHED * n_chunks * size:
                    room = self._cache_size = 0
                if (room := room - size) >= 0:
                    self._cache[segment, chunk] = about, forward_pass
                good, *sums = self._forward(timeline, about, state, forward_pass)
                cost, least, log_determinant = cost + sums[0], least + sums[1], log_determinant + sums[2]
                if good < timeline.time.size:
                    return None
        assert state is not None, "there is at least one segment"
        self._linearised_trajectory = trajectory
        return Filtered(trajectory, cost, least, log_determinant, before, by_parameters, state)

    def step(self, filtered: Filtered, parameter_step: Array | None = None) -> Trajectory:
        """Return the step from the trajectory to the minimum of the linear problem.

        If a step of the parameters is given, it is fixed, and only the motion goes to its minimum.
        """
        n, adjoint = self._n_parameters, Adjoint.zeros(self._n, with_variance=False)
        if parameter_step is None:
            parameter_step = np.zeros_like(filtered.trajectory.parameters)
            parameter_step[:n] = filtered.final.mean[:n]
        else:
            # Like a measurement of the parameters after the last event, without noise.
            estimate = filtered.estimate(n)
            adjoint.mean[:n] = cho_solve((estimate.factor, True), parameter_step - estimate.mean)
        initial: list[Array] = [np.zeros(0)] * len(self._segments)
        moving = [ArrayStore() for _ in self._segments]
        for chunk in self._smooth(filtered, adjoint):
            moving[chunk.segment].append(chunk.step)
            before = filtered.before[chunk.segment][0]
            factor = before.columns[: self._n, : self._n].T
            smoothed = before.mean[n : self._n] + factor[n:] @ (factor.T @ chunk.adjoint)
            # Chunks come from the last to the first, so the value of the first one remains.
            initial[chunk.segment] = smoothed if chunk.timeline.has_initial_substep else chunk.step[0]
        for chunks in moving:
            chunks.reverse()
        return Trajectory(parameter_step, initial, moving)

    def smooth(self, filtered: Filtered) -> Iterator[Smoothed]:
        """Smooth chunk by chunk, from the last to the first, with variances."""
        return self._smooth(filtered, Adjoint.zeros(self._n, with_variance=True))

    def _smooth(self, filtered: Filtered, adjoint: Adjoint) -> Iterator[Smoothed]:
        """Smooth chunk by chunk, from the last to the first, given the adjoint after the last event."""
        for segment, timeline, about, forward_pass in self.forward_passes_back(filtered, adjoint):
            step, variance = (np.zeros(about.moving.shape) for _ in range(2))
            backward(timeline, about, forward_pass, adjoint, step, variance)
            yield Smoothed(segment, timeline, forward_pass, step, variance, adjoint.mean.copy())

    def forward_passes(self, filtered: Filtered) -> Iterator[tuple[int, Timeline, Linearised, ForwardPass]]:
        """Yield segment, data, linearisation and forward pass of each chunk, from the first to the last."""
        for segment in range(len(self._segments)):
            forward_pass = partial(self._forward_pass, filtered)
            yield from computed_ahead(forward_pass, self._chunks(segment), filtered.trajectory)

    def forward_passes_back(
        self, filtered: Filtered, adjoint: Adjoint
    ) -> Iterator[tuple[int, Timeline, Linearised, ForwardPass]]:
        """Yield the forward passes from the last to the first; the caller carries the adjoint back over each chunk."""
        for segment in reversed(range(len(self._segments))):
            forward_pass = partial(self._forward_pass, filtered)
            yield from computed_ahead(forward_pass, self._from_last(filtered, segment), filtered.trajectory)
            adjoint.to_previous_segment(np.vstack([np.eye(self._n_parameters), filtered.by_parameters[segment]]))

    def linearised(
        self, filtered: Filtered, segment: int, backwards: bool = False
    ) -> Iterator[tuple[Timeline, Linearised]]:
        """Yield the linearised chunks of a segment, from the first or from the last, without filtering them."""

        def linearise(segment: int, chunk: int, timeline: Timeline) -> tuple[Timeline, Linearised]:
            if self._is_cached(filtered, segment, chunk):
                return timeline, self._cache[segment, chunk][0]
            return timeline, self._linearise(filtered.trajectory, segment, chunk, timeline)

        chunks = self._from_last(filtered, segment) if backwards else self._chunks(segment)
        yield from computed_ahead(linearise, chunks, filtered.trajectory)

    def _chunks(self, segment: int) -> Iterator[tuple[int, int, Timeline]]:
        """Yield the segment, and number and data of each of its chunks."""
        return ((segment, chunk, timeline) for chunk, timeline in enumerate(self._segments[segment]))

    def _from_last(self, filtered: Filtered, segment: int) -> Iterator[tuple[int, int, Timeline]]:
        """Yield the same, from the last chunk to the first."""
        numbers = reversed(range(len(filtered.before[segment])))
        pairs = zip(numbers, reversed(self._segments[segment]), strict=True)
        return ((segment, chunk, timeline) for chunk, timeline in pairs)

    def _forward_pass(
        self, filtered: Filtered, segment: int, chunk: int, timeline: Timeline
    ) -> tuple[int, Timeline, Linearised, ForwardPass]:
        """Return segment, data, linearisation and forward pass of a chunk, from the cache or filtered again."""
        if self._is_cached(filtered, segment, chunk):
            return segment, timeline, *self._cache[segment, chunk]
        about = self._linearise(filtered.trajectory, segment, chunk, timeline)
        forward_pass = ForwardPass.of(about)
        self._forward(timeline, about, filtered.before[segment][chunk].copy(), forward_pass)
        return segment, timeline, about, forward_pass

    def _is_cached(self, filtered: Filtered, segment: int, chunk: int) -> bool:
        return filtered.trajectory is self._cached_trajectory and (segment, chunk) in self._cache

    def _linearise(
        self, trajectory: Trajectory, segment: int, chunk: int, timeline: Timeline, former: Linearised | None = None
    ) -> Linearised:
        """Linearise a chunk about a trajectory, in the arrays of a former linearisation if there is one."""
        chunks, shape = trajectory.moving[segment], timeline.measurement.shape
        before, moving = chunks[chunk - 1][-1] if chunk else trajectory.initial[segment], chunks[chunk]
        if former is None:
            about = Linearised(
                trajectory.parameters,
                before,
                moving,
                residual=np.full(shape, np.nan),
                rows=np.zeros((*shape, self._n)),
                defect=np.zeros(moving.shape),
                transition=np.zeros((*moving.shape, self._n)),
            )
        else:
            about = former._replace(parameters=trajectory.parameters, before=before, moving=moving)
        work = self._workspace(self._n_states)
        linearise_process(self._process.transition, self._data, timeline, about, work)
        linearise_measurements(self._process.linearise, self._data, timeline, about, work)
        return about

    def _workspace(self, n: int) -> SmootherWorkspace:
        return SmootherWorkspace.of(self._process, n, self._data.sensors.matrix.shape[1])

    def _initial_deviation(
        self, trajectory: Trajectory, segment: int, state: State | None
    ) -> tuple[Gaussian, Array, float]:
        """Return the deviation before a segment, the derivative of its motion by the parameters, and its cost.

        The prior of the parameters counts once, in the first segment; later ones start from the state before.
        """
        n, gaussian, nominal = self._n_parameters, self._priors[segment], trajectory.initial[segment]
        if n == 0:
            gaussian, state = gaussian.given(trajectory.parameters), None
        else:
            nominal = np.concatenate([trajectory.parameters, nominal])
        distance = solve_triangular(gaussian.factor, nominal - gaussian.mean, lower=True)
        derivative = gaussian.by_parameters(n)
        if state is not None:
            parameters = Gaussian(trajectory.parameters + state.mean[:n], state.columns[:n, :n].T.copy())
            gaussian, distance = gaussian.with_parameters(parameters), distance[n:]
        return gaussian._replace(mean=gaussian.mean - nominal), derivative, float(distance @ distance)

    def _forward(
        self, timeline: Timeline, about: Linearised, state: State, forward_pass: ForwardPass
    ) -> tuple[int, float, float, float]:
        noise = accumulated_noise(self._process, timeline)
        return forward(self._data.sensors, noise, timeline, about, state, forward_pass, self._workspace(self._n))


def gauss_newton(
    smoothing: LinearSmoothing, start: Trajectory, max_passes: int, min_decrease: float | None = None
) -> tuple[Filtered, bool] | None:
    """Minimise the cost of a trajectory by Gauss-Newton steps with a line search.

    Parameters
    ----------
    smoothing : LinearSmoothing
    start : Trajectory
    max_passes : int
        Maximum number of forward passes.
    min_decrease : float, optional
        Smallest decrease of the cost worth another iteration, in squares of standard deviations; `MIN_DECREASE` by
        default.

    Returns
    -------
    filtered : Filtered
        About the last trajectory.
    converged : bool
        Also if the remaining step is negligible. The result is None if the cost of `start` is not finite.
    """
    current, passes = smoothing.filter(start), 1
    min_decrease = MIN_DECREASE if min_decrease is None else min_decrease
    if current is None:
        return None
    while current.cost - current.least > min_decrease:
        step, fraction, lower = smoothing.step(current), 1.0, None
        while lower is None and fraction >= _MIN_FRACTION and passes < max_passes:
            trial = smoothing.filter(current.trajectory.stepped(step, fraction))
            if trial is not None and trial.cost < current.cost:
                lower = trial
            fraction, passes = fraction / 2.0, passes + 1
        if lower is None:
            return current, convergence_status(current).is_close
        if current.cost - lower.cost < min_decrease:
            return lower, True
        current = lower
    return current, True


def convergence_status(filtered: Filtered) -> ConvergenceStatus:
    """Return how far a trajectory is from the minimum of its linear problem."""
    # No parameter deviates if all are given.
    n_parameters = filtered.final.n - filtered.trajectory.initial[0].size
    deviation = np.sqrt(np.diagonal(filtered.final.covariance())[:n_parameters])
    return ConvergenceStatus(filtered.cost - filtered.least, filtered.final.mean[:n_parameters] / deviation)


class ConditionalChunk(NamedTuple):
    """Chunk of the motion given the parameters."""

    timeline: Timeline
    about: Linearised  # linearisation with the parameters
    motion: Linearised  # linearisation of the motion alone
    before: Array  # shape (n_moving, n_moving); covariance of the deviation before the chunk
    forward_pass: ForwardPass  # forward pass of the motion alone


class ConditionalFilter:
    """Filter of the motion of one segment given the parameters at the minimum of a linear problem."""

    def __init__(self, problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered, segment: int) -> None:
        self._problem, self._smoothing, self._filtered, self._segment = problem, smoothing, filtered, segment
        self._step = filtered.final.mean[: problem.n_parameters]
        self._work = SmootherWorkspace.of(problem.process, problem.n_moving, problem.sensors.matrix.shape[1])
        self._start = new_state(self._initial_deviation())

    def forward(self) -> Iterator[ConditionalChunk]:
        """Filter chunk by chunk."""
        state = self._start.copy()
        for timeline, about in self._smoothing.linearised(self._filtered, self._segment):
            yield self._filter(timeline, about, state)

    def backward(self) -> Iterator[ConditionalChunk]:
        """Yield the same chunks from the last to the first; each is filtered twice, to save memory."""
        state, before = self._start.copy(), list[State]()
        for timeline, about in self._smoothing.linearised(self._filtered, self._segment):
            before.append(state.copy())
            self._filter(timeline, about, state)
        for timeline, about in self._smoothing.linearised(self._filtered, self._segment, backwards=True):
            yield self._filter(timeline, about, before.pop())

    def _filter(self, timeline: Timeline, about: Linearised, state: State) -> ConditionalChunk:
        n = self._step.size
        motion = about._replace(
            residual=about.residual - about.rows[..., :n].copy() @ self._step,
            rows=about.rows[..., n:].copy(),
            defect=about.defect + about.transition[..., :n].copy() @ self._step,
            transition=about.transition[..., n:].copy(),
        )
        forward_pass, before = ForwardPass.of(motion), state.covariance()
        noise = accumulated_noise(self._problem.process, timeline)
        good, *_ = forward(self._problem.sensors, noise, timeline, motion, state, forward_pass, self._work)
        assert good == timeline.time.size, "a filter with known parameters is at least as stable"
        return ConditionalChunk(timeline, about, motion, before, forward_pass)

    def _initial_deviation(self) -> Gaussian:
        """Return the deviation of the motion before the segment, given the parameters."""
        prior, trajectory = self._problem.priors[self._segment], self._filtered.trajectory
        given = prior.given(trajectory.parameters + self._step)
        return given._replace(mean=given.mean - trajectory.initial[self._segment])
