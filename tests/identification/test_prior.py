"""Priors follow from the size of the vehicle alone."""

import pint
import pytest

from auvid_cli.config.vehicle import Size
from auvid_cli.identification.prior import natural_magnitude, prior_standard_deviations
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS

UNITS = pint.UnitRegistry()
SIZE = Size(length=2.0, diameter=0.25, density=1025.0)


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=SYMBOLS)
def test_magnitude_scales_with_size_as_the_unit_of_the_coefficient_says(coefficient):
    """A hull k times as large has coefficients k^n times as large, n the power of length in the unit per density."""
    per_density = (UNITS.Quantity(1, coefficient.unit) / UNITS.Quantity(1, "kg/m^3")).to_base_units()
    power = dict(per_density.unit_items())["meter"]
    larger = Size(length=3.0 * 2.0, diameter=3.0 * 0.25, density=1025.0)
    ratio = natural_magnitude(coefficient, larger) / natural_magnitude(coefficient, SIZE)
    assert ratio == pytest.approx(3.0**power, rel=1e-12)


@pytest.mark.parametrize("coefficient", COEFFICIENTS, ids=SYMBOLS)
def test_magnitude_is_proportional_to_the_density(coefficient):
    lighter = Size(length=2.0, diameter=0.25, density=1.0)
    expected = natural_magnitude(coefficient, SIZE) / 1025.0
    assert natural_magnitude(coefficient, lighter) == pytest.approx(expected, rel=1e-12)


def test_drag_is_that_of_the_frontal_and_of_the_lateral_area():
    magnitudes = {c.symbol: natural_magnitude(c, SIZE) for c in COEFFICIENTS}
    assert magnitudes["X_u|u|"] == pytest.approx(0.5 * 1025.0 * 3.141592653589793 * 0.125**2)
    assert magnitudes["Y_v|v|"] == magnitudes["Z_w|w|"] == pytest.approx(0.5 * 1025.0 * 2.0 * 0.25)


def test_magnitude_holds_for_all_shipped_vehicles_within_two_orders(vehicle_file, experiment_with):
    vehicle = experiment_with(f"vehicle=vehicles/{vehicle_file}").vehicle
    true = vehicle.all_coefficients()
    wide = [c.symbol for c in COEFFICIENTS if abs(true[c.symbol]) > 100.0 * natural_magnitude(c, vehicle.size)]
    assert not wide


def test_factor_widens_every_prior_alike_and_a_stated_one_stands():
    one = prior_standard_deviations(SIZE, 1.0, {})
    ten = prior_standard_deviations(SIZE, 10.0, {"Y_url": 5.0})
    assert tuple(one) == SYMBOLS
    assert ten.pop("Y_url") == 5.0
    assert ten == pytest.approx({symbol: 10.0 * one[symbol] for symbol in ten})
