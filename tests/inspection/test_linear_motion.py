"""The linear equations of motion are those of the compiled model for small motions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

import auvid_cli as auvid
from auvid_cli.inspection.fins import LinearMotion, linear_motion
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_FACTORS, vehicle_constants
from auvid_cli.vehicle.jacobian import N_COLUMNS, N_JACOBIAN_WORK, motion_jacobian
from auvid_cli.vehicle.parameters import N_MOTION, ActuatorErrors

SPEED = 1.8
PLACES = {
    fin: N_MOTION + N_COEFFICIENTS + ActuatorErrors._fields.index(f"{fin}_trim") for fin in ("rudder", "elevator")
}


def vehicle_of(name):
    return auvid.load_experiment(name).vehicle


def linear(vehicle, spreads):
    motion = linear_motion(vehicle, SPEED, spreads)
    assert motion is not None
    return motion


@pytest.mark.parametrize("name", ["spiral", "remus100", "lauv"])
def test_linear_motion_equals_jacobian(name):
    vehicle = vehicle_of(name)
    coefficients = np.zeros(N_FACTORS)
    coefficients[:N_COEFFICIENTS] = [*vehicle.all_coefficients().values()]
    motion = np.zeros(N_MOTION)
    motion[0] = SPEED
    jacobian = np.zeros((N_MOTION, N_COLUMNS))
    constants = vehicle_constants(vehicle.known_parameters())
    work = np.zeros(N_JACOBIAN_WORK)
    motion_jacobian(motion, coefficients, np.zeros(4), constants, jacobian, jacobian, N_COLUMNS, work)
    found = linear(vehicle, {})
    assert_allclose(found.by_state, jacobian[:8, :8], rtol=1e-6, atol=1e-6 * np.abs(jacobian[:8, :8]).max())
    for fin, place in PLACES.items():
        assert_allclose(SPEED**2 * found.by_input[fin], jacobian[:8, place], atol=1e-12)


def test_cross_flow_is_linearised_for_gaussian_motion():
    """Least squares: ``E[|v| v^2] / E[v^2]``."""
    vehicle, spread = vehicle_of("spiral"), 0.3
    slope = np.sqrt(8.0 / np.pi) * spread
    calm, lively = (linear(vehicle, {"v": each}).by_state for each in (0.0, spread))
    without = vehicle.with_coefficients(vehicle.all_coefficients() | {"Y_v|v|": 0.0, "N_v|v|": 0.0})
    true = vehicle.all_coefficients()
    as_lift = {f"{row}_uvl": true[f"{row}_uvl"] + true[f"{row}_v|v|"] * slope / SPEED for row in "YN"}
    expected = linear(without.with_coefficients(without.all_coefficients() | as_lift), {}).by_state
    assert_allclose(lively[:, 1], expected[:, 1], rtol=1e-9, atol=1e-12)
    assert not np.allclose(lively[:, 1], calm[:, 1], rtol=5e-2)


def test_pulse_responses_sum_to_integrated_response(rng):
    by_state, by_rudder = np.zeros((8, 8)), np.zeros(8)
    by_state[np.ix_([1, 5], [1, 5])], by_rudder[[1, 5]] = [[-0.8, -1.5], [0.4, -1.1]], [0.3, -2.0]
    motion, step, steps = LinearMotion(by_state, {"rudder": by_rudder}), 0.1, rng.standard_normal(6)

    def slope(time, state):
        return by_state[np.ix_([1, 5], [1, 5])] @ state + by_rudder[[1, 5]] * steps[min(int(time / step), 5)]

    state = np.zeros(2)
    for k in range(6):
        interval = (k * step + 1e-12, (k + 1) * step - 1e-12)
        state = solve_ivp(slope, interval, state, rtol=1e-10, atol=1e-12).y[:, -1]
    assert_allclose(motion.pulse_responses("r", ("v", "r"), "rudder", step, 6) @ steps, state[1], rtol=1e-6)


def test_linear_motion_needs_coefficients():
    vehicle = vehicle_of("spiral")
    assert linear_motion(vehicle.model_copy(update={"coefficients": type(vehicle.coefficients)()}), SPEED, {}) is None
