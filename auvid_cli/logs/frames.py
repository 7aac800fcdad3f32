"""Axes: quaternions and Euler angles, sensor to body, east-north-up to north-east-down.

Quaternions are rows of w, x, y, z and turn a vector of the first axes into the second: v2 = q v1 q*. Euler angles are
rows of roll, pitch, yaw, applied as yaw, pitch, roll (Fossen 2011, eqs. (2.18) and (2.60) to (2.72)).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Half a turn about x, forward; half a turn about the line between east and north.
FLU_TO_FRD = np.array([0.0, 1.0, 0.0, 0.0])
ENU_TO_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])


def quaternion_of_euler(angles: Array) -> Array:
    """Convert Euler angles to quaternions, shape (n, 3) to (n, 4)."""
    cosine, sine = np.cos(0.5 * angles).T, np.sin(0.5 * angles).T
    (cr, cp, cy), (sr, sp, sy) = cosine, sine
    return np.column_stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
    )


def euler_of_quaternion(quaternion: Array) -> Array:
    """Convert quaternions of any length but zero to Euler angles, shape (n, 4) to (n, 3); NaN of a zero."""
    length = np.sqrt(np.einsum("ij,ij->i", quaternion, quaternion))
    length[length == 0.0] = np.nan
    w, x, y, z = (quaternion / length[:, None]).T
    # The pitch by its cosine as well: its sine alone knows little near +-90 degrees.
    sine, forward_north, forward_east = 2.0 * (w * y - x * z), 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
    return np.column_stack(
        (
            np.arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
            np.arctan2(sine, np.hypot(forward_north, forward_east)),
            np.arctan2(forward_east, forward_north),
        )
    )


def product(left: Array, right: Array) -> Array:
    """Multiply quaternions, either side one of them or n."""
    a, b, c, d = left.T
    w, x, y, z = right.T
    return np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=-1,
    )


def conjugate(quaternion: Array) -> Array:
    """Return the quaternions of the turns back."""
    return quaternion * np.array([1.0, -1.0, -1.0, -1.0])


def rotation(quaternion: Array) -> Array:
    """Return the rotation matrix of a quaternion; what is only rounding beside 1 becomes 0, so that axes stay apart."""
    w, x, y, z = quaternion
    matrix = np.array(
        [
            [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    whole = np.rint(matrix)
    return np.where(np.abs(matrix - whole) < 1e-15, whole + 0.0, matrix)


def rotate(matrix: Array, vectors: Array) -> Array:
    """Turn rows of vectors; a component that is missing spoils only those that it has a part in."""
    turned = np.zeros_like(vectors)
    for i, j in zip(*np.nonzero(matrix), strict=True):
        turned[:, i] += matrix[i, j] * vectors[:, j]
    return turned
