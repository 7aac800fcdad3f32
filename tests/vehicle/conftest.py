"""One vehicle at a time out of the compiled core, and random but possible vehicles."""

from types import SimpleNamespace

import numpy as np
import pytest

from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_SLOPE, N_WORK, NO_ERRORS, motion_derivative, runge_kutta_step
from auvid_cli.vehicle.parameters import N_MOTION


def _block(values):
    block = np.zeros(values.size * LANES)
    block[::LANES] = values
    return block


def _factors(coefficients):
    return np.append(coefficients, NO_ERRORS) if coefficients.size == N_COEFFICIENTS else coefficients


@pytest.fixture(scope="session")
def core():
    """`derivative(motion, coefficients, inputs, constants)` and `advance(..., steps, step)` on plain vectors."""

    def derivative(motion, coefficients, inputs, constants):
        result = np.zeros(N_SLOPE)
        motion_derivative(_block(motion), _block(_factors(coefficients)), inputs, constants, 1, result)
        return result[: N_MOTION * LANES : LANES].copy()

    def advance(motion, coefficients, inputs, constants, steps, step):
        """Motion after every step, the start first: shape (steps + 1, 9)."""
        block, work, path = _block(motion), np.zeros(N_WORK), [np.array(motion)]
        coefficient_block = _block(_factors(coefficients))
        for _ in range(steps):
            runge_kutta_step(block, coefficient_block, inputs, constants, 1, step, work)
            path.append(block[::LANES].copy())
        return np.array(path)

    return SimpleNamespace(derivative=derivative, advance=advance)


@pytest.fixture(scope="session")
def random_vehicle():
    """Function: parameters of a random but possible vehicle, everything off-centre, W different from B."""

    def draw(rng):
        mass, length = np.exp(rng.uniform(np.log(10.0), np.log(3000.0))), rng.uniform(1.0, 5.0)
        radius = 0.06 * length
        transverse = mass * length**2 / rng.uniform(10.0, 14.0)
        cross = 0.05 * mass * length * rng.uniform(-1.0, 1.0, 2)
        offset = 0.2 * radius * rng.uniform(-1.0, 1.0, 6)
        return {
            "m": mass,
            "W": 9.81 * mass,
            "B": 9.81 * mass * rng.uniform(0.95, 1.05),
            "Ixx": mass * radius**2 * rng.uniform(0.4, 1.0),
            "Iyy": transverse,
            "Izz": transverse * rng.uniform(0.9, 1.1),
            **dict(zip(("xG", "yG", "zG", "xB", "yB", "zB"), offset, strict=True)),
            "X_udot": -mass * rng.uniform(0.02, 0.3),
            "Y_vdot": -mass * rng.uniform(0.7, 1.3),
            "Z_wdot": -mass * rng.uniform(0.7, 1.3),
            "K_pdot": -mass * radius**2 * rng.uniform(0.0, 0.5),
            "M_qdot": -transverse * rng.uniform(0.5, 1.0),
            "N_rdot": -transverse * rng.uniform(0.5, 1.0),
            "Y_rdot": cross[0],
            "N_vdot": cross[0],
            "Z_qdot": cross[1],
            "M_wdot": cross[1],
            "X_prop": 10.0,
            "K_prop": 0.0,
        }

    return draw


@pytest.fixture(scope="session")
def random_state():
    """Function: motion, coefficients and inputs that are random, of either sign and of ordinary size."""

    def draw(rng, mass):
        motion = np.concatenate([rng.uniform(-3, 3, 3), rng.uniform(-0.8, 0.8, 3), rng.uniform(-1.3, 1.3, 3)])
        coefficients = mass * rng.uniform(-1.0, 1.0, N_COEFFICIENTS)
        inputs = np.concatenate([rng.uniform(-0.4, 0.4, 2), mass * rng.uniform(-1.0, 1.0, 2)])
        return motion, coefficients, inputs

    return draw
