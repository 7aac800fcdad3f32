"""Rigid body: rotations, lever arms, dead reckoning; mass, Coriolis and restoring matrices; ballast."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.errors import ConfigError

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


class Ballast(NamedTuple):
    """Errors of the stated weight and buoyancy.

    Notes
    -----
    A weight W a distance d forward of its stated position adds the moment ``d e_x x W down``, with
    ``down = (-sin theta, cos theta sin phi, cos theta cos phi)``. With ``trim_moment = -d W`` that is
    ``trim_moment cos theta cos phi`` in pitch, ``-trim_moment cos theta sin phi`` in yaw, and zero in roll.
    """

    excess_buoyancy: float = 0.0  # additional upward force at the origin, N
    trim_moment: float = 0.0  # additional bow-up pitching moment of a level vehicle, N m

    def added_to(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return the known parameters, SI, with corrected buoyancy and centre of buoyancy."""
        buoyancy = parameters["B"] + self.excess_buoyancy
        # The excess acts at the origin, so that only the trim changes the moments of the buoyancy.
        moments = {axis: parameters[f"{axis}B"] * parameters["B"] for axis in "xyz"}
        moments["x"] += self.trim_moment
        return {**parameters, "B": buoyancy, **{f"{axis}B": moment / buoyancy for axis, moment in moments.items()}}


NO_BALLAST = Ballast()
N_BALLAST = len(Ballast._fields)


def skew(a: Array) -> Array:
    """Return the cross-product matrix of a 3-vector: ``skew(a) @ b == cross(a, b)``."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rigid_body_matrix(parameters: Mapping[str, float]) -> Array:
    """Return the rigid-body mass matrix ``M_RB``, shape (6, 6), SI, Fossen 2011, ch. 3.

    Raises
    ------
    ConfigError
        If it is not positive definite.
    """
    k = parameters
    lever = k["m"] * skew(np.array([k["xG"], k["yG"], k["zG"]]))
    inertia = np.diag([k["Ixx"], k["Iyy"], k["Izz"]])
    rigid = np.block([[k["m"] * np.eye(3), -lever], [lever, inertia]])
    smallest = float(np.linalg.eigvalsh(rigid)[0])
    if not smallest > 0.0:
        raise ConfigError(
            "invalid inertia: the rigid-body mass matrix is not positive definite "
            f"(smallest eigenvalue {smallest:.4g}); check m, xG, yG, zG, and Ixx, Iyy, Izz, which are about the origin"
        )
    return rigid


def central_inertia(parameters: Mapping[str, float]) -> Array:
    """Return the inertia of the body about its centre of gravity, shape (3, 3)."""
    rigid = rigid_body_matrix(parameters)
    return rigid[3:, 3:] - rigid[3:, :3] @ rigid[:3, 3:] / parameters["m"]


def mass_matrix(parameters: Mapping[str, float]) -> Array:
    """Return the mass matrix ``M = M_RB + M_A``, shape (6, 6), SI, Sabet et al. 2018, eq. (12).

    It is symmetric: if ``N_vdot`` and ``Y_rdot`` (or ``M_wdot`` and ``Z_qdot``) differ, which potential flow does not
    permit, their mean is used, so that the Coriolis matrix does no work.

    Raises
    ------
    ConfigError
        If it is not positive definite.
    """
    k = parameters
    added = -np.diag([k["X_udot"], k["Y_vdot"], k["Z_wdot"], k["K_pdot"], k["M_qdot"], k["N_rdot"]])
    added[1, 5] = added[5, 1] = -0.5 * (k["Y_rdot"] + k["N_vdot"])
    added[2, 4] = added[4, 2] = -0.5 * (k["Z_qdot"] + k["M_wdot"])
    mass = rigid_body_matrix(k) + added
    smallest = float(np.linalg.eigvalsh(mass)[0])
    if not smallest > 0.0:
        raise ConfigError(
            f"invalid inertia: the mass matrix is not positive definite (smallest eigenvalue {smallest:.4g}); check m, "
            "the moments of inertia and the signs of the added masses (X_udot to N_rdot are negative)"
        )
    return mass


def coriolis_matrix(mass: Array, nu: Array) -> Array:
    """Return the Coriolis and centripetal matrix ``C(nu)``, shape (6, 6), of a symmetric mass matrix.

    It is skew-symmetric, so that ``nu @ C @ nu == 0``. Fossen 2011, theorem 3.2, which equals the scalar
    terms of Sabet et al. 2018, eq. (13), with a complete roll row.

    Parameters
    ----------
    mass : ndarray, shape (6, 6)
    nu : ndarray, shape (6,)
        Body velocity, m/s and rad/s.
    """
    momentum = mass @ nu
    coriolis = np.zeros((6, 6))
    coriolis[:3, 3:] = coriolis[3:, :3] = -skew(momentum[:3])
    coriolis[3:, 3:] = -skew(momentum[3:])
    return coriolis


def restoring_vector(parameters: Mapping[str, float], attitude: Array) -> Array:
    """Return force, N, and moment, N m, of weight and buoyancy, ``-g(eta)``, shape (6,).

    Sabet et al. 2018, eq. (13), with the sign of the zG term in the roll row corrected: as printed there, a low centre
    of gravity would be unstable in roll.

    Parameters
    ----------
    parameters : mapping
        Known parameters by symbol, SI.
    attitude : ndarray, shape (3,)
        Roll, pitch, yaw, rad.
    """
    k = parameters
    phi, theta = attitude[0], attitude[1]
    down = np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    lever = np.array([k[f"{axis}G"] * k["W"] - k[f"{axis}B"] * k["B"] for axis in "xyz"])
    return np.concatenate([(k["W"] - k["B"]) * down, np.cross(lever, down)])
