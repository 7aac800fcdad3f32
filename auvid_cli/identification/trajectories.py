"""Trajectory of an earlier estimate, as the start of a smoother."""

import numpy as np

from auvid_cli.array_store import ArrayStore
from auvid_cli.data.estimate import Estimate
from auvid_cli.filters.linear_smoother import Trajectory
from auvid_cli.identification.problem_setup import AugmentedProblem


def trajectory_of(augmented: AugmentedProblem, estimate: Estimate) -> Trajectory | None:
    """Return the trajectory of an estimate, in scaled units.

    None if the estimate has another state, or not one state for each event (`identification.keep_every`).
    """
    layout, n = augmented.layout, augmented.layout.n_parameters
    if estimate.state[: layout.scale.size] != layout.symbols or not np.isfinite(estimate.mean[-1]).all():
        return None
    parameters = estimate.mean[-1, :n] / layout.scale[:n]
    initial, moving, begin = [], [ArrayStore() for _ in augmented.segments], 0
    for segment, chunks in zip(augmented.segments, moving, strict=True):
        for timeline in segment.timelines:
            rows = slice(begin, begin + timeline.time.size)
            if not np.array_equal(estimate.time[rows], timeline.time):
                return None
            chunks.append(estimate.mean[rows, n : layout.scale.size] / layout.scale[n:])
            begin = rows.stop
        # Nothing leads to the first event of a segment.
        initial.append(chunks[0][0])
    return Trajectory(parameters, initial, moving) if begin == estimate.time.size else None
