"""Mass and Coriolis matrices and the restoring vector in matrix form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import vehicle_constants
from auvid_cli.vehicle.rigid_body import coriolis_matrix, mass_matrix, restoring_vector, skew

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.slow
@given(seed=seeds)
def test_mass_matrix_is_equation_12(seed, random_vehicle):
    vehicle = random_vehicle(np.random.default_rng(seed))
    k = vehicle
    m, xg, yg, zg = k["m"], k["xG"], k["yG"], k["zG"]
    expected = [
        [m - k["X_udot"], 0, 0, 0, m * zg, -m * yg],
        [0, m - k["Y_vdot"], 0, -m * zg, 0, m * xg - k["Y_rdot"]],
        [0, 0, m - k["Z_wdot"], m * yg, -m * xg - k["Z_qdot"], 0],
        [0, -m * zg, m * yg, k["Ixx"] - k["K_pdot"], 0, 0],
        [m * zg, 0, -m * xg - k["M_wdot"], 0, k["Iyy"] - k["M_qdot"], 0],
        [-m * yg, m * xg - k["N_vdot"], 0, 0, 0, k["Izz"] - k["N_rdot"]],
    ]
    assert_allclose(mass_matrix(vehicle), expected, rtol=1e-14)


def test_unequal_cross_terms_are_replaced_by_their_mean(rng, random_vehicle):
    vehicle = random_vehicle(rng)
    unequal = vehicle | {"Y_rdot": 3.0, "N_vdot": 1.0, "Z_qdot": -4.0, "M_wdot": 0.0}
    equal = vehicle | {"Y_rdot": 2.0, "N_vdot": 2.0, "Z_qdot": -2.0, "M_wdot": -2.0}
    assert_allclose(mass_matrix(unequal), mass_matrix(equal), rtol=1e-15)


@given(seed=seeds)
def test_coriolis_forces_do_no_work(seed, random_vehicle):
    rng = np.random.default_rng(seed)
    mass, nu = mass_matrix(random_vehicle(rng)), rng.uniform(-3.0, 3.0, 6)
    coriolis = coriolis_matrix(mass, nu)
    assert np.array_equal(coriolis, -coriolis.T)
    assert abs(nu @ coriolis @ nu) <= 1e-13 * np.abs(coriolis @ nu) @ np.abs(nu)


@given(seed=seeds)
def test_compiled_dynamics_agree_with_the_matrix_form(seed, core, random_vehicle, random_state):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng)
    motion, _, _ = random_state(rng, vehicle["m"])
    mass = mass_matrix(vehicle)
    derivative = core.derivative(motion, np.zeros(N_COEFFICIENTS), np.zeros(4), vehicle_constants(vehicle))
    force = restoring_vector(vehicle, motion[6:]) - coriolis_matrix(mass, motion[:6]) @ motion[:6]
    assert_allclose(mass @ derivative[:6], force, rtol=1e-10, atol=1e-12 * np.abs(force).max())


def test_skew_is_the_cross_product(rng):
    a, b = rng.standard_normal((2, 3))
    assert_allclose(skew(a) @ b, np.cross(a, b), rtol=1e-15)


@pytest.mark.parametrize("change", [{"m": -50.0}, {"Ixx": 0.0, "K_pdot": 0.0}, {"zG": 50.0}, {"Y_vdot": 1e5}])
def test_impossible_mass_matrix_is_refused(change, rng, random_vehicle):
    vehicle = random_vehicle(rng) | change
    with pytest.raises(ConfigError, match="not positive definite") as caught:
        vehicle_constants(vehicle)
    assert "\n" not in str(caught.value)
