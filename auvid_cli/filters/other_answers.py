"""Parameters to which a part of the data, or another start, leads: what stands against an answer.

What a segment says by itself, `a` of covariance `C`, and what all say together, `b` of covariance `P`, share the
segment's data and the prior. If all are of one model, `b` is the best that can be made of more data, so that the
covariance of `a` and `b` is P, and that of their difference `C - P` (Hausman, Econometrica 46(6), 1978).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing, Trajectory
from auvid_cli.filters.problem import AlternativeEstimate
from auvid_cli.filters.segments import JointProblem

Array = NDArray[np.float64]

# Cost by which another minimum may be higher, and still be told: less than 1 % as probable as that is no rival.
_RIVAL = -2.0 * np.log(0.01)
# Share of its own variance that a difference has at least: of less, rounding leaves nothing.
_LEAST = 1e-6


def answers_of_segments(problem: JointProblem, answer: Filtered) -> Iterator[AlternativeEstimate]:
    """Find what each of several segments says by itself, about the answer that all give.

    Parameters
    ----------
    problem : JointProblem
    answer : Filtered
    """
    trajectory, n = answer.trajectory, answer.trajectory.parameters.size
    together, variance = answer.final.mean[:n], np.diagonal(answer.final.covariance())[:n]
    for alone, initial, moving in zip(problem.alone(), trajectory.initial, trajectory.moving, strict=True):
        own = LinearSmoothing(alone).filter(Trajectory(trajectory.parameters, [initial], [moving]))
        assert own is not None, "with the others its trajectory has a finite cost"
        own_variance = np.diagonal(own.final.covariance())[:n]
        more = own_variance - variance
        comparable = more > _LEAST * own_variance
        deviation = np.sqrt(np.where(comparable, more, np.inf))
        begin = next(iter(alone.segments[0])).time[0]
        moved = np.where(comparable, deviation, 0.0) * variance / own_variance
        yield AlternativeEstimate(own.final.mean[:n] - together, deviation, moved, begin=begin)


def other_minimum(answer: Filtered, other: Filtered) -> AlternativeEstimate | None:
    """Compare an answer with one of another start; None if that is the same, or far less probable."""
    n = answer.trajectory.parameters.size
    deviation = np.sqrt(np.diagonal(answer.final.covariance())[:n])
    here, there = (each.trajectory.parameters + each.final.mean[:n] for each in (answer, other))
    higher = other.cost - answer.cost
    return None if higher > _RIVAL else AlternativeEstimate.of_minimum(there - here, deviation, higher)
