"""What the place and the axes of a sensor ask for: attitude and angular rates at its own times."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.gaps import gap_limit
from auvid_cli.vehicle.kinematics import body_to_earth

Array = NDArray[np.float64]


def interpolate(time: Array, values: Array, at: Array, is_angle: bool = False) -> Array:
    """Interpolate rows of values linearly; NaN before the first, after the last, and in gaps, see `gap_limit`.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, increasing.
    values : ndarray, shape (n, c)
        Each component by the rows in which it is not missing.
    at : ndarray, shape (m,)
    is_angle : bool
        Whether values are angles that may jump by whole turns.

    Returns
    -------
    ndarray, shape (m, c)
    """
    columns = (_interpolated(time, column, at, is_angle) for column in values.T)
    return np.column_stack([*columns])


def _interpolated(time: Array, values: Array, at: Array, is_angle: bool) -> Array:
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if not time.size:
        return np.full(at.size, np.nan)
    interpolated = np.interp(at, time, np.unwrap(values) if is_angle else values, np.nan, np.nan)
    after = np.clip(np.searchsorted(time, at), 1, max(time.size - 1, 1))
    if time.size > 1:
        between = time[after] - time[after - 1]
        interpolated[(between > gap_limit(np.diff(time))) & ~np.isin(at, time)] = np.nan
    return interpolated


def velocity_at_origin(velocity: Array, rates: Array, position: Array) -> Array:
    """Find the velocity of the vehicle's origin from that of a sensor at a position: v - omega x r, in body axes."""
    return velocity - np.cross(rates, position)


def depth_at_origin(down: Array, roll: Array, pitch: Array, position: Array) -> Array:
    """Find the depth of the vehicle's origin from that of a sensor at a position in the body: down - (R position)_z.

    The last row of R, from the body to north-east-down, holds no heading (Fossen 2011, eq. (2.18)).
    """
    angles = np.column_stack((roll, pitch, np.zeros(down.size)))
    return down - body_to_earth(angles, np.broadcast_to(position, angles.shape))[:, 2]
