"""Rotations between axes of body and earth, motion of lever arms, and dead reckoning."""

import numpy as np

from auvid_cli.arrays import Array

GRAVITY = 9.80665  # m/s^2, standard gravity
# No underwater vehicle keeps turning or moving faster; larger numbers have another unit.
MAX_TURN_RATE = 6.0  # rad/s
MAX_SPEED = 20.0  # m/s


def earth_to_body(angles: Array, vectors: Array) -> Array:
    """Return vectors in body axes, shape (n, 3), from north, east, down: zyx Euler angles, Fossen 2011, ch. 2.

    Parameters
    ----------
    angles : ndarray, shape (n, 3)
        Roll, pitch, yaw, rad.
    vectors : ndarray, shape (n, 3)
    """
    (sin_roll, sin_pitch, sin_yaw), (cos_roll, cos_pitch, cos_yaw) = np.sin(angles).T, np.cos(angles).T
    north, east, down = vectors.T
    ahead, across = cos_yaw * north + sin_yaw * east, cos_yaw * east - sin_yaw * north
    below = sin_pitch * ahead + cos_pitch * down
    return np.column_stack(
        (
            cos_pitch * ahead - sin_pitch * down,
            cos_roll * across + sin_roll * below,
            cos_roll * below - sin_roll * across,
        )
    )


def body_to_earth(angles: Array, vectors: Array) -> Array:
    """Return vectors in north, east, down from body axes; the inverse of `earth_to_body`."""
    (sin_roll, sin_pitch, sin_yaw), (cos_roll, cos_pitch, cos_yaw) = np.sin(angles).T, np.cos(angles).T
    x, y, z = vectors.T
    below = sin_roll * y + cos_roll * z
    ahead, across = cos_pitch * x + sin_pitch * below, cos_roll * y - sin_roll * z
    return np.column_stack(
        (
            cos_yaw * ahead - sin_yaw * across,
            sin_yaw * ahead + cos_yaw * across,
            cos_pitch * below - sin_pitch * x,
        )
    )


def rotation_matrix(angles: Array) -> Array:
    """Return the rotation matrix from body axes to north, east, down at one attitude, shape (3,), rad."""
    return earth_to_body(np.broadcast_to(angles, (3, 3)), np.eye(3))


def euler_angles(rotation: Array) -> Array:
    """Return roll, pitch and yaw, rad, of rotation matrices from body axes to north, east, down, shape (n, 3, 3)."""
    level = np.hypot(rotation[:, 0, 0], rotation[:, 1, 0])
    return np.column_stack(
        (
            np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
            np.arctan2(-rotation[:, 2, 0], level),
            np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]),
        )
    )


def euler_rates(rates: Array, angles: Array) -> Array:
    """Return the time derivatives of roll, pitch, yaw, rad/s, shape (n, 3), Sabet et al. 2018, eq. (3).

    Parameters
    ----------
    rates : ndarray, shape (n, 3)
        p, q, r, rad/s.
    angles : ndarray, shape (n, 3)
        Roll, pitch, yaw, rad; singular at a pitch of 90 degrees.
    """
    (p, q, r), (roll, pitch, _) = rates.T, angles.T
    turning = q * np.sin(roll) + r * np.cos(roll)
    return np.column_stack((p + np.tan(pitch) * turning, q * np.cos(roll) - r * np.sin(roll), turning / np.cos(pitch)))


def body_rates(time: Array, angles: Array) -> Array:
    """Return p, q, r, rad/s, shape (n, 3), from central differences of roll, pitch, yaw, rad, shape (n, 3)."""
    roll_rate, pitch_rate, yaw_rate = np.gradient(np.unwrap(angles, axis=0), time, axis=0).T
    (sin_roll, sin_pitch, _), (cos_roll, cos_pitch, _) = np.sin(angles).T, np.cos(angles).T
    return np.column_stack(
        (
            roll_rate - sin_pitch * yaw_rate,
            cos_roll * pitch_rate + sin_roll * cos_pitch * yaw_rate,
            cos_roll * cos_pitch * yaw_rate - sin_roll * pitch_rate,
        )
    )


def specific_force(motion: Array, rates: Array, arm: Array) -> Array:
    """Return the specific force that an accelerometer measures, shape (n, 3), m/s^2.

    Parameters
    ----------
    motion : ndarray, shape (n, 9)
        SI.
    rates : ndarray, shape (n, 9)
        Time derivative of the motion, SI.
    arm : ndarray, shape (3,)
        Position of the accelerometer in body axes, m.
    """
    turning = motion[:, 3:6]
    down = earth_to_body(motion[:, 6:9], np.broadcast_to([0.0, 0.0, 1.0], (len(motion), 3)))
    at_origin = rates[:, :3] + np.cross(turning, motion[:, :3]) - GRAVITY * down
    return np.asarray(at_origin + (np.cross(rates[:, 3:6], arm) + np.cross(turning, np.cross(turning, arm))))


def current_in_body_axes(attitude: Array, north: float | Array, east: float | Array) -> Array:
    """Return a horizontal current in body axes, shape (..., 3), at attitudes of that shape."""
    rows = attitude.reshape(-1, 3)
    earth = np.zeros(rows.shape)
    earth[:, 0], earth[:, 1] = north, east
    return earth_to_body(rows, earth).reshape(attitude.shape)


def dvl_axes(scale: float, yaw: float) -> Array:
    """Return the matrix from the velocity over ground to that in the axes of a DVL, ``(1 + scale) Rz(yaw)'``."""
    sine, cosine = np.sin(yaw), np.cos(yaw)
    return (1.0 + scale) * np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def dead_reckoned(time: Array, motion: Array) -> Array:
    """Return the path from the origin by the trapezoidal rule, shape (m, 3), north, east, down, m.

    It ends before the first motion, shape (n, 9), that is not finite.
    """
    broken = ~np.isfinite(motion).all(axis=1)
    end = int(broken.argmax()) if broken.any() else time.size
    velocity = body_to_earth(motion[:end, 6:9], motion[:end, :3])
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time[:end])[:, None]
    return np.concatenate([np.zeros((min(end, 1), 3)), np.cumsum(steps, axis=0)])
