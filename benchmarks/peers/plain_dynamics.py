"""The equations of motion without compilation: array code for NumPy and for JAX, one state or many at once."""

from typing import Any, NamedTuple

from auvid_cli.filters.problem import Process
from auvid_cli.vehicle.equations import N_CONSTANTS
from benchmarks.peers.problem import N_COEFFICIENTS, Array, units_of


class Vehicle(NamedTuple):
    """Mass matrix, its inverse, weight less buoyancy, restoring levers, and the units of the coefficients."""

    mass: Array
    inverse: Array
    excess: float
    levers: Array
    scale: Array


def vehicle_of(process: Process) -> Vehicle:
    """Take the constants out of auvid's process, all of whose 22 coefficients are estimated."""
    known = process.constants[:N_CONSTANTS]
    mass, inverse = known[:36].reshape(6, 6), known[36:72].reshape(6, 6)
    return Vehicle(mass, inverse, float(known[72]), known[73:76], units_of(process))


def motion_derivative(motion: Any, coefficients: Any, held: Any, vehicle: Vehicle, numeric: Any) -> Any:
    """Return the time derivative of the motion.

    Parameters
    ----------
    motion : array, shape (9,) or (9, points)
    coefficients : array, shape (22,) or (22, points)
        SI.
    held : array, shape (4,)
        Rudder, elevator, surge force, roll moment.
    vehicle : Vehicle
    numeric : module
        `numpy` or `jax.numpy`.
    """
    u, v, w, p, q, r, phi, theta, _ = motion
    c = coefficients
    rudder, elevator, surge_force, roll_moment = held
    a1, a2, a3, b1, b2, b3 = vehicle.mass @ motion[:6]
    sin_phi, cos_phi = numeric.sin(phi), numeric.cos(phi)
    sin_theta, cos_theta = numeric.sin(theta), numeric.cos(theta)
    down_x, down_y, down_z = -sin_theta, cos_theta * sin_phi, cos_theta * cos_phi
    lever_x, lever_y, lever_z = vehicle.levers
    uu, uv, uw, uq, ur = u * u, u * v, u * w, u * q, u * r
    vv, ww, qq, rr = abs(v) * v, abs(w) * w, abs(q) * q, abs(r) * r
    forces = numeric.stack(
        [
            r * a2 - q * a3 + vehicle.excess * down_x + surge_force + c[0] * abs(u) * u,
            (p * a3 - r * a1 + vehicle.excess * down_y + c[1] * vv + c[2] * rr)
            + (c[10] * ur + c[11] * uv + c[18] * uu * rudder),
            (q * a1 - p * a2 + vehicle.excess * down_z + c[3] * ww + c[4] * qq)
            + (c[12] * uq + c[13] * uw + c[19] * uu * elevator),
            (r * b2 - q * b3 + w * a2 - v * a3 + lever_y * down_z - lever_z * down_y)
            + (roll_moment + c[5] * abs(p) * p),
            (p * b3 - r * b1 + u * a3 - w * a1 + lever_z * down_x - lever_x * down_z + c[6] * qq + c[7] * ww)
            + (c[14] * uq + c[15] * uw + c[20] * uu * elevator),
            (q * b1 - p * b2 + v * a1 - u * a2 + lever_x * down_y - lever_y * down_x + c[8] * rr + c[9] * vv)
            + (c[16] * ur + c[17] * uv + c[21] * uu * rudder),
        ]
    )
    turning = q * sin_phi + r * cos_phi
    turns = numeric.stack([p + sin_theta / cos_theta * turning, q * cos_phi - r * sin_phi, turning / cos_theta])
    return numeric.concatenate([vehicle.inverse @ forces, turns])


def advance(state: Any, duration: Any, held: Any, vehicle: Vehicle, numeric: Any) -> Any:
    """Return a state, shape (31,), or many, shape (31, points), one Runge-Kutta step later: a new array."""
    parameters, motion = state[:N_COEFFICIENTS], state[N_COEFFICIENTS:]
    scale = vehicle.scale if parameters.ndim == 1 else vehicle.scale[:, None]
    coefficients = scale * parameters
    k1 = motion_derivative(motion, coefficients, held, vehicle, numeric)
    k2 = motion_derivative(motion + 0.5 * duration * k1, coefficients, held, vehicle, numeric)
    k3 = motion_derivative(motion + 0.5 * duration * k2, coefficients, held, vehicle, numeric)
    k4 = motion_derivative(motion + duration * k3, coefficients, held, vehicle, numeric)
    return numeric.concatenate([parameters, motion + duration / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])
