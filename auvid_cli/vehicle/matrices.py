"""Mass, added mass, Coriolis and restoring matrices of a vehicle, and its ballast."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.errors import ConfigError


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
