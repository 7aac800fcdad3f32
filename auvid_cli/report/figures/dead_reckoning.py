"""Position from velocity and attitude alone."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def velocity_over_ground(motion: Array) -> Array:
    """Velocity north, east, down, m/s, of motion with columns u, v, w, p, q, r, phi, theta, psi."""
    u, v, w = motion[:, 0], motion[:, 1], motion[:, 2]
    sin_phi, sin_theta, sin_psi = np.sin(motion[:, 6:9].T)
    cos_phi, cos_theta, cos_psi = np.cos(motion[:, 6:9].T)
    ahead = cos_theta * u + sin_theta * (sin_phi * v + cos_phi * w)
    aside = cos_phi * v - sin_phi * w
    down = -sin_theta * u + cos_theta * (sin_phi * v + cos_phi * w)
    return np.stack([cos_psi * ahead - sin_psi * aside, sin_psi * ahead + cos_psi * aside, down], axis=1)


def dead_reckoned(time: Array, motion: Array) -> Array:
    """Path from the origin by the trapezoidal rule.

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
    velocity = velocity_over_ground(motion[:end])
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time[:end])[:, None]
    return np.concatenate([np.zeros((min(end, 1), 3)), np.cumsum(steps, axis=0)])
