"""Filter of the motion about the smoother's estimate, given the parameters."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.fault_scores import FaultEffects
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing
from auvid_cli.filters.problem import Gaussian, Timeline
from auvid_cli.filters.process_noise import noise_variance
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoothing_forward import ForwardPass, Linearised, SmootherWorkspace, forward, new_state
from auvid_cli.filters.square_root_state import State

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
        residual=about.residual - by_parameters.added @ step,
        rows=about.rows[..., n:].copy(),
        defect=about.defect + by_parameters.pushed @ step,
        transition=about.transition[..., n:].copy(),
    ), by_parameters
