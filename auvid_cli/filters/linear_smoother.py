"""Linear smoothing about a trajectory: process noise, the linear problem and its solution, and Gauss-Newton steps."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.linalg import solve_triangular

from auvid_cli.arrays import Array, ArrayStore
from auvid_cli.filters.problem import Gaussian, JointProblem, ModelData, Process, Timeline
from auvid_cli.filters.smoother_backward import Adjoint, backward
from auvid_cli.filters.smoother_forward import (
    AccumulatedNoise,
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
# Fewest chunks of data for which they do. With fewer, they cost more than they save where the other cores are in use.
_MANY = 24
# Step of the difference quotient of decay rates.
_RATE_STEP = 1e-5  # s
# Events from one evaluation of the decay rates to the next.
_RATE_INTERVAL = 10
# Forward passes kept for the backward pass; other chunks are filtered twice.
_CACHE_SIZE = 2**28  # bytes
# Smallest share of the chunks for which a cache is worth its memory.
_MIN_CACHED = 0.2
# Smallest decrease of the cost worth another iteration, in squares of standard deviations: in the last step no
# parameter moves by more than a tenth of its standard deviation.
_MIN_DECREASE = 1e-2
# A search without further progress has an answer if the cost can fall by at most this, in squares of standard
# deviations, and no parameter would move by more than this share of its standard deviation.
_NEGLIGIBLE_DECREASE = 0.1
_NEGLIGIBLE_MOVE = 0.05
# Smallest fraction of a step in the line search.
_MIN_FRACTION = 2.0**-10


def noise_variance(process: Process, timeline: Timeline) -> Array:
    """Return the variance of each moving state's own noise accumulated before each event, shape (n_events, n_moving).

    A state that decays at the rate a, over the time h, keeps ``q^2 (1 - exp(-2 a h)) / (2 a)`` of white noise of
    density q. Zero for an event without substeps.
    """
    elapsed = _elapsed(timeline)
    white = np.outer(elapsed, process.noise_density**2)
    if process.decay.size == 0:
        return white
    exponent = 2.0 * np.outer(elapsed, process.decay)
    return white * np.divide(-np.expm1(-exponent), exponent, out=np.ones_like(exponent), where=exponent != 0.0)


def accumulated_noise(process: Process, timeline: Timeline) -> AccumulatedNoise:
    """Return the process noise accumulated before each event.

    White noise of density q on a state that drives another one by the factor a gives them, over the time h, the
    covariance ``q^2 [h, a h^2 / 2; a h^2 / 2, a^2 h^3 / 3]`` (Van Loan, IEEE Trans. Autom. Control 23(3), 1978). It is
    that of noise in the middle of h, and of ``a^2 q^2 h^3 / 12`` on the driven state alone.
    """
    variance = noise_variance(process, timeline)
    total = variance + variance_on_driven(process, timeline, variance)
    return AccumulatedNoise(total, 0.5 * _elapsed(timeline), process.driven)


def variance_on_driven(process: Process, timeline: Timeline, variance: Array) -> Array:
    """Return the part ``a^2 q^2 h^3 / 12`` of `accumulated_noise`, shape (n_events, n_moving), linear in `variance`."""
    if not process.driven.size:
        return np.zeros_like(variance)
    return (_elapsed(timeline)[:, None] ** 2 / 12.0) * (variance @ np.square(process.driven).T)


def variance_by_time_constant(process: Process, timeline: Timeline) -> Array:
    """Return the derivative of log `noise_variance` by the log of a state's time constant, shape (n_events, n_moving).

    The stationary variance s^2 of the state is held constant: its noise has ``q^2 = 2 a s^2``.
    """
    elapsed = _elapsed(timeline)
    if process.decay.size == 0:
        return np.full((elapsed.size, process.noise_density.size), -1.0)
    exponent = 2.0 * np.outer(elapsed, process.decay)
    return -np.divide(exponent, np.expm1(exponent), out=np.ones_like(exponent), where=exponent != 0.0)


def _elapsed(timeline: Timeline) -> Array:
    """Return the duration of the substeps before each event, s."""
    return np.diff(np.concatenate([[0.0], np.cumsum(timeline.substep_duration)])[timeline.substep_offset])


def with_process_memory(problem: JointProblem, parameters: Array, moving: Sequence[Sequence[Array]]) -> JointProblem:
    """Return the problem with the mean rates at which the motion forgets process noise along a trajectory.

    They stay constant while the trajectory changes, so that likelihoods remain comparable.

    Parameters
    ----------
    problem : JointProblem
    parameters : ndarray, shape (n_parameters,)
    moving : sequence of sequence of ndarray, shape (n_events, n_moving)
        Moving states by segment and chunk.
    """
    rates = [
        _decay_rates(problem, timeline, np.hstack([np.tile(parameters, (len(chunk), 1)), chunk]))
        for segment, chunks in zip(problem.segments, moving, strict=True)
        for timeline, chunk in zip(segment, chunks, strict=True)
    ]
    return problem._replace(process=problem.process._replace(decay=np.concatenate(rates).mean(axis=0)))


def _decay_rates(problem: JointProblem, timeline: Timeline, states: Array) -> Array:
    """Return the rates at some events of a chunk, 1/s, shape (n, n_moving)."""
    process, n_parameters = problem.process, problem.n_parameters
    rates, matrix, scratch = [], np.eye(states.shape[1]), np.zeros(process.scratch_size)
    for event in range(0, len(states), _RATE_INTERVAL):
        substep = timeline.event_input[event : event + 1], np.array([_RATE_STEP])
        constants = process.constants, process.selection
        process.transition(states[event].copy(), timeline.inputs, *substep, *constants, matrix, scratch)
        rates.append((1.0 - np.diagonal(matrix)[n_parameters:]) / _RATE_STEP)
    return np.array(rates)


def computed_ahead(calls: Iterable[Callable[[], T]], trajectory: "Trajectory") -> Iterator[T]:
    """Yield the results of calls, in their order; if the trajectory is long, threads do the next ones meanwhile."""
    if sum(map(len, trajectory.moving)) < _MANY:
        yield from (call() for call in calls)
        return
    waiting = deque[Future[T]]()
    with ThreadPoolExecutor(_N_AHEAD) as threads:
        for call in calls:
            waiting.append(threads.submit(call))
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


class _Place(NamedTuple):
    """Chunk of a segment."""

    segment: int
    chunk: int
    timeline: Timeline


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
    """

    def __init__(self, problem: JointProblem, cache: int = 1) -> None:
        process, sensors, self._segments, _ = problem
        self._process, self._priors = process, problem.priors
        self._data = ModelData.of(process, sensors)
        self._n_parameters = problem.n_parameters
        self._n = problem.n_parameters + problem.n_moving
        self._cache, self._cached_trajectory = dict[tuple[int, int], tuple[Linearised, ForwardPass]](), None
        self._cache_size = cache * _CACHE_SIZE
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

        def linearise(place: _Place) -> Callable[[], tuple[_Place, Linearised, ForwardPass | None]]:
            # Reuse the arrays of the last trajectory: new memory is slow, because it comes page by page.
            former, forward_pass = self._cache.pop(place[:2], (None, None))
            if former is not None and is_linearised:
                return lambda: (place, former, forward_pass)
            compute = self._linearisation(trajectory, place, former)
            return lambda: (place, compute(), forward_pass)

        for place, about, forward_pass in computed_ahead(map(linearise, self._places()), trajectory):
            if place.chunk == 0:
                gaussian, derivative, distance = self._initial_deviation(trajectory, place.segment, state)
                cost += distance
                by_parameters.append(derivative)
                state = new_state(gaussian)
                before.append([])
            assert state is not None, "the first chunk begins a segment"
            before[-1].append(state.copy())
            forward_pass = ForwardPass.of(about) if forward_pass is None else forward_pass
            if (room := room - sum(array.nbytes for array in (*forward_pass, about.rows, about.transition))) >= 0:
                self._cache[place[:2]] = about, forward_pass
            good, *sums = self._forward(place.timeline, about, state, forward_pass)
            cost, least, log_determinant = cost + sums[0], least + sums[1], log_determinant + sums[2]
            if good < place.timeline.time.size:
                return None
        assert state is not None, "there is at least one segment"
        if len(self._cache) < _MIN_CACHED * sum(map(len, before)):
            self._cache_size = 0
            self._cache.clear()
        self._linearised_trajectory = trajectory
        return Filtered(trajectory, cost, least, log_determinant, before, by_parameters, state)

    def step(self, filtered: Filtered) -> Trajectory:
        """Return the step from the trajectory to the minimum of the linear problem."""
        n = self._n_parameters
        initial: list[Array] = [np.zeros(0)] * len(self._segments)
        moving = [ArrayStore() for _ in self._segments]
        for chunk in self.smooth(filtered, with_variance=False):
            moving[chunk.segment].append(chunk.step)
            before = filtered.before[chunk.segment][0]
            factor = before.columns[: self._n, : self._n].T
            smoothed = before.mean[n : self._n] + factor[n:] @ (factor.T @ chunk.adjoint)
            # Chunks come from the last to the first, so the value of the first one remains.
            initial[chunk.segment] = smoothed if chunk.timeline.has_initial_substep else chunk.step[0]
        for chunks in moving:
            chunks.reverse()
        return Trajectory(filtered.final.mean[:n].copy(), initial, moving)

    def smooth(self, filtered: Filtered, with_variance: bool) -> Iterator[Smoothed]:
        """Smooth chunk by chunk, from the last to the first."""
        adjoint = Adjoint.zeros(self._n, with_variance)
        for segment, timeline, about, forward_pass in self.forward_passes_back(filtered, adjoint):
            step, variance = (np.zeros(about.moving.shape) for _ in range(2))
            backward(timeline, about, forward_pass, adjoint, step, variance)
            yield Smoothed(segment, timeline, forward_pass, step, variance, adjoint.mean.copy())

    def forward_passes(self, filtered: Filtered) -> Iterator[tuple[int, Timeline, Linearised, ForwardPass]]:
        """Yield segment, data, linearisation and forward pass of each chunk, from the first to the last."""
        calls = (self._forward_pass(filtered, place) for place in self._places())
        yield from computed_ahead(calls, filtered.trajectory)

    def forward_passes_back(
        self, filtered: Filtered, adjoint: Adjoint
    ) -> Iterator[tuple[int, Timeline, Linearised, ForwardPass]]:
        """Yield the forward passes from the last to the first; the caller carries the adjoint back over each chunk."""
        places = (place for segment in reversed(range(len(self._segments))) for place in self._back(filtered, segment))
        calls, last = (self._forward_pass(filtered, place) for place in places), len(self._segments) - 1
        for chunk in computed_ahead(calls, filtered.trajectory):
            if chunk[0] < last:
                self._to_previous_segment(filtered, last, adjoint)
                last = chunk[0]
            yield chunk
        self._to_previous_segment(filtered, last, adjoint)

    def _to_previous_segment(self, filtered: Filtered, segment: int, adjoint: Adjoint) -> None:
        adjoint.to_previous_segment(np.vstack([np.eye(self._n_parameters), filtered.by_parameters[segment]]))

    def linearised(
        self, filtered: Filtered, segment: int, backwards: bool = False
    ) -> Iterator[tuple[Timeline, Linearised]]:
        """Yield the linearised chunks of a segment, from the first or from the last, without filtering them."""

        def linearise(place: _Place) -> Callable[[], tuple[Timeline, Linearised]]:
            if self._is_cached(filtered, place):
                about = self._cache[place[:2]][0]
                return lambda: (place.timeline, about)
            compute = self._linearisation(filtered.trajectory, place)
            return lambda: (place.timeline, compute())

        places = self._back(filtered, segment) if backwards else self._places([segment])
        yield from computed_ahead(map(linearise, places), filtered.trajectory)

    def _places(self, segments: Iterable[int] | None = None) -> Iterator[_Place]:
        """Yield the chunks of all or some segments, from the first to the last."""
        for segment in range(len(self._segments)) if segments is None else segments:
            for chunk, timeline in enumerate(self._segments[segment]):
                yield _Place(segment, chunk, timeline)

    def _back(self, filtered: Filtered, segment: int) -> Iterator[_Place]:
        """Yield the chunks of a segment, from the last to the first."""
        chunk = len(filtered.before[segment])
        for timeline in reversed(self._segments[segment]):
            chunk -= 1
            yield _Place(segment, chunk, timeline)

    def _forward_pass(
        self, filtered: Filtered, place: _Place
    ) -> Callable[[], tuple[int, Timeline, Linearised, ForwardPass]]:
        """Return a call that returns segment, data, linearisation and forward pass of a chunk, cached or done again."""
        segment, chunk, timeline = place
        if self._is_cached(filtered, place):
            cached = self._cache[segment, chunk]
            return lambda: (segment, timeline, *cached)
        linearise = self._linearisation(filtered.trajectory, place)

        def compute() -> tuple[int, Timeline, Linearised, ForwardPass]:
            about = linearise()
            forward_pass = ForwardPass.of(about)
            self._forward(timeline, about, filtered.before[segment][chunk].copy(), forward_pass)
            return segment, timeline, about, forward_pass

        return compute

    def _is_cached(self, filtered: Filtered, place: _Place) -> bool:
        return filtered.trajectory is self._cached_trajectory and place[:2] in self._cache

    def _linearisation(
        self, trajectory: Trajectory, place: _Place, former: Linearised | None = None
    ) -> Callable[[], Linearised]:
        """Return a call that linearises a chunk about a trajectory, in the arrays of `former` if there is one.

        The trajectory is read now, because only one thread may read its file.
        """
        segment, chunk, timeline = place
        chunks, shape = trajectory.moving[segment], timeline.measurement.shape
        before, moving = chunks[chunk - 1][-1] if chunk else trajectory.initial[segment], chunks[chunk]

        def linearise() -> Linearised:
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
            work = self._workspace()
            linearise_process(self._process.transition, self._data, timeline, about, work)
            linearise_measurements(self._process.linearise, self._data, timeline, about, work)
            return about

        return linearise

    def _workspace(self) -> SmootherWorkspace:
        return SmootherWorkspace.of(self._process, self._n, self._data.sensors.matrix.shape[1])

    def _initial_deviation(
        self, trajectory: Trajectory, segment: int, state: State | None
    ) -> tuple[Gaussian, Array, float]:
        """Return the deviation before a segment, the derivative of its motion by the parameters, and its cost.

        The prior of the parameters counts once, in the first segment; later ones start from the state before.
        """
        n = self._n_parameters
        gaussian = self._priors[segment]
        nominal = np.concatenate([trajectory.parameters, trajectory.initial[segment]])
        distance = solve_triangular(gaussian.factor, nominal - gaussian.mean, lower=True)
        derivative = solve_triangular(gaussian.factor[:n, :n].T, gaussian.factor[n:, :n].T, lower=False).T
        if state is not None:
            parameters = Gaussian(trajectory.parameters + state.mean[:n], state.columns[:n, :n].T.copy())
            gaussian, distance = gaussian.with_parameters(parameters), distance[n:]
        return gaussian._replace(mean=gaussian.mean - nominal), derivative, float(distance @ distance)

    def _forward(
        self, timeline: Timeline, about: Linearised, state: State, forward_pass: ForwardPass
    ) -> tuple[int, float, float, float]:
        noise = accumulated_noise(self._process, timeline)
        return forward(self._data.sensors, noise, timeline, about, state, forward_pass, self._workspace())


def gauss_newton(smoothing: LinearSmoothing, start: Trajectory, max_passes: int) -> tuple[Filtered, bool] | None:
    """Minimise the cost of a trajectory by Gauss-Newton steps with a line search.

    Parameters
    ----------
    smoothing : LinearSmoothing
    start : Trajectory
    max_passes : int
        Maximum number of forward passes.

    Returns
    -------
    filtered : Filtered
        About the last trajectory.
    converged : bool
        Also if the rest of the way no longer matters. The result is None if the cost of `start` is not finite.
    """
    current, passes = smoothing.filter(start), 1
    if current is None:
        return None
    while current.cost - current.least > _MIN_DECREASE:
        step, fraction, lower = smoothing.step(current), 1.0, None
        while lower is None and fraction >= _MIN_FRACTION and passes < max_passes:
            trial = smoothing.filter(current.trajectory.stepped(step, fraction))
            if trial is not None and trial.cost < current.cost:
                lower = trial
            fraction, passes = fraction / 2.0, passes + 1
        if lower is None:
            return current, _is_close(current)
        if current.cost - lower.cost < _MIN_DECREASE:
            return lower, True
        current = lower
    return current, True


def _is_close(filtered: Filtered) -> bool:
    """Whether neither the cost nor a parameter would change by an amount that matters."""
    step = filtered.final.mean[: filtered.trajectory.parameters.size]
    deviation = np.sqrt(np.diagonal(filtered.final.covariance())[: step.size])
    remaining = filtered.cost - filtered.least
    return remaining <= _NEGLIGIBLE_DECREASE and bool((np.abs(step) <= _NEGLIGIBLE_MOVE * deviation).all())


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
        n, prior, trajectory = self._step.size, self._problem.priors[self._segment], self._filtered.trajectory
        change = trajectory.parameters + self._step - prior.mean[:n]
        mean = prior.mean[n:] + self._filtered.by_parameters[self._segment] @ change
        return Gaussian(mean - trajectory.initial[self._segment], prior.factor[n:, n:])
