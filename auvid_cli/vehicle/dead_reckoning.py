"""Position from velocity and attitude alone."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.vehicle.kinematics import body_to_earth

Array = NDArray[np.float64]


def dead_reckoned(time: Array, motion: Array) -> Array:
    """Integrate the path from the origin by the trapezoidal rule.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    motion : ndarray, shape (n, 9)

    Returns
    -------
    ndarray, shape (m, 3)
        North, east, down, m; ends before the first motion that is not finite.
    """
    broken = ~np.isfinite(motion).all(axis=1)
    end = int(broken.argmax()) if broken.any() else time.size
    velocity = body_to_earth(motion[:end, 6:9], motion[:end, :3])
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time[:end])[:, None]
    return np.concatenate([np.zeros((min(end, 1), 3)), np.cumsum(steps, axis=0)])
