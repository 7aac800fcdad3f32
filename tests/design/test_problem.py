"""Distributions of coefficients, and vehicles drawn from them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.vehicle import CoefficientTable
from auvid_cli.design.problem import distribution_from_estimate, distribution_from_vehicle, draw_vehicles
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.coefficients import SYMBOLS

DAMPING = [SYMBOLS.index(symbol) for symbol in ("X_u|u|", "Y_v|v|", "Z_w|w|", "K_p|p|", "M_q|q|", "N_r|r|")]


def drawn(distribution, number=4000):
    return np.array([list(vehicle.values()) for vehicle in distribution.draw(number, [1, 2])])


def test_values_without_deviation_vary_by_30_percent_with_fixed_sign(remus):
    vehicle = remus().vehicle
    values = drawn(distribution_from_vehicle(vehicle, None)) / [
        vehicle.all_coefficients()[symbol] for symbol in SYMBOLS
    ]
    assert (values > 0.0).all()
    assert_allclose(np.median(values, axis=0), 1.0, atol=0.03)
    assert_allclose(values.std(axis=0), 0.3 * np.sqrt(1.09), atol=0.03)


def test_stated_deviation_counts_unless_spread_is_given(remus):
    vehicle = remus("vehicle.coefficients.N_uvl={value: 10 kg, standard_deviation: 1 kg}").vehicle
    place = SYMBOLS.index("N_uvl")
    assert drawn(distribution_from_vehicle(vehicle, None))[:, place].std() == pytest.approx(1.0, rel=0.05)
    assert drawn(distribution_from_vehicle(vehicle, 0.05))[:, place].std() == pytest.approx(0.5, rel=0.05)


def test_missing_values_come_from_hull_and_fins_with_damping_negative(remus):
    vehicle = remus().vehicle.model_copy(update={"coefficients": CoefficientTable()})
    distribution = distribution_from_vehicle(vehicle, None)
    derived = {value.name: value for value in vehicle.derived_values()}
    assert_allclose(distribution.mean, [derived[symbol].mean for symbol in SYMBOLS])
    values = drawn(distribution)
    assert (values[:, DAMPING] < 0.0).all()
    cross = SYMBOLS.index("M_w|w|")
    assert values[:, cross].std() == pytest.approx(derived["M_w|w|"].standard_deviation, rel=0.05)
    assert (values[:, cross] > 0.0).any(), "not even its sign is sure"


def test_vehicle_without_values_or_geometry_raises_config_error(remus):
    vehicle = remus().vehicle.model_copy(update={"coefficients": CoefficientTable(), "geometry": None})
    with pytest.raises(ConfigError, match=r"no value of X_u\|u\|.*--at FILE"):
        distribution_from_vehicle(vehicle, None)


def test_draws_from_estimate_have_its_covariance(hand_made):
    estimate = hand_made([0.0, 1.0], {"N_uvl": [20.0, 10.0], "N_uudr": [-5.0, -6.0]})
    values = drawn(distribution_from_estimate(estimate, estimate.experiment.vehicle), 20000)
    rows = [SYMBOLS.index(symbol) for symbol in ("N_uvl", "N_uudr")]
    assert_allclose(np.cov(values[:, rows].T), estimate.final_covariance()[:2, :2], rtol=0.05, atol=1e-2)
    held = np.delete(np.arange(len(SYMBOLS)), rows)
    assert not np.ptp(values[:, held], axis=0).any()


def test_seed_determines_drawn_vehicles(remus):
    vehicle = remus().vehicle
    distribution = distribution_from_vehicle(vehicle, None)
    first, again, other = (draw_vehicles(vehicle, distribution, 2, [seed, 1]) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert first[0].known_parameters() == vehicle.known_parameters()
