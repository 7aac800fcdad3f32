"""The vehicle files that ship with auvid."""

import numpy as np
import pytest

from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.rigid_body import mass_matrix


@pytest.fixture
def vehicle(vehicle_file, experiment_with):
    return experiment_with(f"vehicle=vehicles/{vehicle_file}").vehicle


def test_it_states_all_parameters_and_coefficients(vehicle):
    assert np.isfinite(list(vehicle.known_parameters().values())).all()
    assert tuple(vehicle.all_coefficients()) == SYMBOLS


def test_its_mass_matrix_is_positive_definite_and_no_lighter_than_the_body(vehicle):
    known = vehicle.known_parameters()
    mass = mass_matrix(known)
    assert np.array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass).min() > 0.0
    assert (np.diagonal(mass)[:3] >= known["m"]).all()


def test_weight_and_buoyancy_fit_its_mass(vehicle):
    known = vehicle.known_parameters()
    assert known["W"] == pytest.approx(9.81 * known["m"], rel=0.005)
    assert known["B"] == pytest.approx(known["W"], rel=0.05)
    assert known["zG"] > known["zB"], "it would not right itself"


def test_its_hull_displaces_about_its_buoyancy(vehicle):
    size = vehicle.size
    cylinder = 0.25 * np.pi * size.diameter**2 * size.length * size.density * 9.81
    assert 0.6 * cylinder < vehicle.known_parameters()["B"] < 1.1 * cylinder


@pytest.mark.parametrize("symbol", ["X_u|u|", "Y_v|v|", "Z_w|w|", "K_p|p|", "M_q|q|", "N_r|r|"])
def test_drag_coefficients_are_negative(vehicle, symbol):
    assert vehicle.all_coefficients()[symbol] < 0.0


@pytest.mark.parametrize("symbol", ["Y_uvl", "Z_uwl", "M_uql", "N_url"])
def test_lift_of_the_tail_damps(vehicle, symbol):
    assert vehicle.all_coefficients()[symbol] < 0.0


def test_a_fin_at_the_stern_pushes_and_turns_in_opposite_senses(vehicle):
    c = vehicle.all_coefficients()
    assert c["Y_uudr"] * c["N_uudr"] < 0.0, "a rudder force to starboard at the stern turns the bow to port"
    assert c["Z_uude"] * c["M_uude"] > 0.0, "an elevator force down at the stern lifts the bow"


def test_fin_levers_are_within_the_hull(vehicle):
    c, length = vehicle.all_coefficients(), vehicle.size.length
    assert 0.2 * length < abs(c["N_uudr"] / c["Y_uudr"]) < 0.75 * length
    assert 0.2 * length < abs(c["M_uude"] / c["Z_uude"]) < 0.75 * length


def test_thrust_balances_drag_at_a_speed_such_vehicles_go(vehicle):
    thrust, drag = vehicle.known_parameters()["X_prop"], -vehicle.all_coefficients()["X_u|u|"]
    assert 0.5 < np.sqrt(thrust / drag) < 3.0
