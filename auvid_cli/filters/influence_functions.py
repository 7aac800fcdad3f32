"""Influence functions: the effect of each measurement on a batch estimate, with the motion conditioned on
parameters.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.autocorrelation import Influence, corrected_deviation
from auvid_cli.filters.fault_scores import FaultEffects, carry_errors
from auvid_cli.filters.least_squares import Uncertainty
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, noise_variance
from auvid_cli.filters.problem import Gaussian, Timeline
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.sensitivities import responses
from auvid_cli.filters.smoother_forward import ForwardPass, Linearised, SmootherWorkspace, forward, new_state
from auvid_cli.filters.workspace import State

Array = NDArray[np.float64]


class MotionChunk(NamedTuple):
    """A chunk of the motion alone.

    Attributes
    ----------
    timeline : Timeline
    about : Linearised
        With the parameters.
    motion : Linearised
        Without them.
    by_parameters : FaultEffects
        What these do to it.
    before : ndarray, shape (n_moving, n_moving)
        Covariance of the deviation before the chunk.
    forward_pass : ForwardPass
    """

    timeline: Timeline
    about: Linearised
    motion: Linearised
    by_parameters: FaultEffects
    before: Array
    forward_pass: ForwardPass


class ConditionalFilter:
    """Filter of the motion of a segment, given the parameters.

    Parameters
    ----------
    problem : JointProblem
    smoothing : LinearSmoothing
        Of the problem.
    filtered : Filtered
        About the answer.
    segment : int
    """

    def __init__(self, problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered, segment: int) -> None:
        self._problem, self._smoothing, self._filtered, self._segment = problem, smoothing, filtered, segment
        self._step = filtered.final.mean[: problem.n_parameters]
        self._work = SmootherWorkspace.of(problem.process, problem.n_moving, problem.sensors.matrix.shape[1])
        self._start = new_state(self._beginning())

    def forward(self) -> Iterator[MotionChunk]:
        """Filter chunk by chunk."""
        state = self._start.copy()
        for timeline, about in self._smoothing.linearised(self._filtered, self._segment):
            yield self._filter(timeline, about, state)

    def backward(self) -> Iterator[MotionChunk]:
        """Filter the same chunks, from the last to the first: what a whole segment leaves is large."""
        state, before = self._start.copy(), list[State]()
        for timeline, about in self._smoothing.linearised(self._filtered, self._segment):
            before.append(state.copy())
            self._filter(timeline, about, state)
        for timeline, about in self._smoothing.linearised(self._filtered, self._segment, backwards=True):
            yield self._filter(timeline, about, before.pop())

    def _filter(self, timeline: Timeline, about: Linearised, state: State) -> MotionChunk:
        motion, by_parameters = _given_parameters(about, self._step)
        forward_pass, before = ForwardPass.of(motion), state.covariance()
        noise = noise_variance(self._problem.process, timeline)
        good, *_ = forward(self._problem.sensors, noise, timeline, motion, state, forward_pass, self._work)
        assert good == timeline.time.size, "a filter that knows more goes as far"
        return MotionChunk(timeline, about, motion, by_parameters, before, forward_pass)

    def _beginning(self) -> Gaussian:
        """Find what is known of the deviation of the motion before the segment, given the parameters."""
        n, own, trajectory = self._step.size, self._problem.priors[self._segment], self._filtered.trajectory
        owed = self._filtered.by_parameters[self._segment] @ (trajectory.parameters + self._step - own.mean[:n])
        return Gaussian(own.mean[n:] + owed - trajectory.initial[self._segment], own.factor[n:, n:])


def _given_parameters(about: Linearised, step: Array) -> tuple[Linearised, FaultEffects]:
    """Leave the motion alone of a linear problem, with parameters that are known; return what these do to it, too."""
    n = step.size
    by_parameters = FaultEffects(about.transition[..., :n].copy(), about.rows[..., :n].copy())
    return about._replace(
        residual=about.residual - by_parameters.on_measurements @ step,
        rows=about.rows[..., n:].copy(),
        defect=about.defect + by_parameters.on_states @ step,
        transition=about.transition[..., n:].copy(),
    ), by_parameters


def corrected_free_motion(problem: JointProblem, state: Array, uncertainty: Uncertainty) -> Array:
    """Correct the standard deviations of parameters that were found with motions left to themselves.

    Parameters
    ----------
    problem : JointProblem
    state : ndarray, shape (n,)
        The joint state that was found.
    uncertainty : Uncertainty
        Of it.
    """
    nominal = uncertainty.deviation(np.eye(problem.n_parameters, state.size))
    return corrected_deviation(nominal, of_free_motion(problem, state, uncertainty), problem.sensors.variance.size)


def corrected_smoothing(problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered) -> Array:
    """Correct the standard deviations of parameters about the most probable trajectory."""
    nominal = np.sqrt(np.diagonal(filtered.final.covariance())[: problem.n_parameters])
    return corrected_deviation(nominal, of_smoothing(problem, smoothing, filtered), problem.sensors.variance.size)


def of_free_motion(problem: JointProblem, state: Array, uncertainty: Uncertainty) -> list[Iterable[Influence]]:
    """Return the influences of each segment on parameters found with motions left to themselves."""
    return [_FreeMotion(problem, uncertainty, state, segment) for segment in range(len(problem.segments))]


def of_smoothing(problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered) -> list[Iterable[Influence]]:
    """Return the influences of each segment on parameters about the most probable trajectory."""
    return [_Innovations(problem, smoothing, filtered, segment) for segment in range(len(problem.segments))]


def _influence(timeline: Timeline, present: NDArray[np.bool_], residual: Array, rows: Array) -> Influence:
    """Leave out components that are missing."""
    n_measurements, n_components = present.shape
    time = np.repeat(timeline.time, np.diff(timeline.measurement_offset))[:n_measurements]
    channel = timeline.measurement_sensor[:n_measurements, None].astype(np.int64) * n_components
    return Influence(
        np.repeat(time, n_components)[present.ravel()],
        (channel + np.arange(n_components))[present],
        residual[present],
        rows[present],
    )


@dataclass(frozen=True)
class _FreeMotion:
    """Influences of a segment on what the output-error method finds."""

    problem: JointProblem
    uncertainty: Uncertainty
    state: Array
    segment: int

    def __iter__(self) -> Iterator[Influence]:
        process, sensors, segments, _ = self.problem
        place, root = self.problem.indices[self.segment], self.uncertainty.root
        covariance = root[place] @ root[: self.problem.n_parameters].T
        for response in responses(process, sensors, segments[self.segment], self.state[place]):
            rows, residual = response.whitened[..., :-1] @ covariance, response.whitened[..., -1]
            yield _influence(response.timeline, ~np.isnan(response.innovation), residual, rows)


@dataclass(frozen=True)
class _Innovations:
    """Influences of a segment on what the smoother finds."""

    problem: JointProblem
    smoothing: LinearSmoothing
    filtered: Filtered
    segment: int

    def __iter__(self) -> Iterator[Influence]:
        n, n_moving = self.problem.n_parameters, self.problem.n_moving
        covariance = self.filtered.final.covariance()[:n, :n]
        error, moved = self.filtered.by_parameters[self.segment].copy(), np.empty((n_moving, n))
        chunks = ConditionalFilter(self.problem, self.smoothing, self.filtered, self.segment).forward()
        for timeline, _, motion, by_parameters, _, forward_pass in chunks:
            carry_errors(timeline, motion, forward_pass, by_parameters, error, moved)
            deviation = np.sqrt(forward_pass.total)
            rows = (by_parameters.on_measurements / deviation[..., None]) @ covariance
            yield _influence(timeline, ~np.isnan(motion.residual), forward_pass.error / deviation, rows)
