"""Where the vehicle went: the true path, and those that follow from the estimated motion alone."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Course
from auvid_cli.vehicle.dead_reckoning import dead_reckoned

Array = NDArray[np.float64]


class TravelledPath(NamedTuple):
    """A path.

    Attributes
    ----------
    filter : str or None
        None of the true one.
    time : ndarray, shape (n,)
        s.
    position : ndarray, shape (n, 3)
        North, east, down, m.
    """

    filter: str | None
    time: Array
    position: Array


def travelled_paths(truth: TruthRecord | None, motions: Iterable[Course]) -> list[TravelledPath]:
    """Return the true path, as far as it is finite, and dead reckoning from its start, or from zero.

    Parameters
    ----------
    truth : TruthRecord or None
    motions : iterable of Course
        Of the nine motion states; one that is not finite from the second time on has no path.
    """
    paths, start = list[TravelledPath](), np.zeros(3)
    if truth is not None:
        known = np.isfinite(truth.position).all(axis=1)
        if known.any():
            paths.append(TravelledPath(None, truth.time[known], truth.position[known]))
            start = paths[0].position[0]
    for motion in motions:
        position = start + dead_reckoned(motion.time, motion.mean)
        if len(position) > 1:
            paths.append(TravelledPath(motion.filter, motion.time[: len(position)], position))
    return paths


def travelled(position: Array) -> Array:
    """Return the horizontal distance along a path, m, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(position[:, :2], axis=0).T))])
