"""How fast moving states forget, along a trajectory."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.linear_smoothing import Trajectory
from auvid_cli.filters.problem import Timeline
from auvid_cli.filters.segments import JointProblem

Array = NDArray[np.float64]

# s, for a difference quotient; and at every how manieth event it is taken.
_SHORT, _EVERY = 1e-5, 10


def forgetting(problem: JointProblem, trajectory: Trajectory) -> JointProblem:
    """Let process noise be forgotten at the rates that there are along a trajectory, in the mean over its events.

    They stay those while the trajectory changes: what is found from it is compared by one measure.
    """
    rates = [
        _rates(problem, timeline, np.hstack([np.tile(trajectory.parameters, (len(moving), 1)), moving]))
        for segment, chunks in zip(problem.segments, trajectory.moving, strict=True)
        for timeline, moving in zip(segment, chunks, strict=True)
    ]
    return problem._replace(process=problem.process._replace(decay=np.concatenate(rates).mean(axis=0)))


def _rates(problem: JointProblem, timeline: Timeline, states: Array) -> Array:
    """Return those at some events of a chunk, shape (n, n_moving)."""
    process, n_parameters = problem.process, problem.n_parameters
    rates, matrix, scratch = [], np.eye(states.shape[1]), np.zeros(process.scratch_size)
    for event in range(0, len(states), _EVERY):
        substep = timeline.event_input[event : event + 1], np.array([_SHORT])
        constants = process.constants, process.selection
        process.transition(states[event].copy(), timeline.inputs, *substep, *constants, matrix, scratch)
        rates.append((1.0 - np.diagonal(matrix)[n_parameters:]) / _SHORT)
    return np.array(rates)
