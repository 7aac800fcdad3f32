"""Mistaken units by the factor that they make."""

import pytest

from auvid_cli.inspection.inspection import mistaken_unit, mistaken_units


@pytest.mark.parametrize(
    ("unit", "times", "name"),
    [
        ("m/s", 1.944, "knots"),
        ("m/s", 3.281, "ft/s"),
        ("m/s", 3.6, "km/h"),
        ("m", 3.281, "feet"),
        ("m", 1000.0, "mm"),
        ("rad/s", 57.3, "deg/s"),
        ("rad/s", 60.0, "rad/min"),
        ("rad", 57.3, "degrees"),
        ("m/s^2", 1 / 9.80665, "g"),
    ],
)
def test_factor_names_unit_and_inverse_names_conversion(unit, times, name):
    assert mistaken_unit("x", unit, times) == f"x is in {name}, but was read as {unit}."
    assert mistaken_unit("x", unit, 1.0 / times) == f"x was in {unit}, but was converted from {name}."


@pytest.mark.parametrize("times", [1.0, 1.3, 0.7, 2.5, 300.0])
def test_unusual_factor_names_no_unit(times):
    assert mistaken_unit("x", "m/s", times) == ""


def test_gain_names_units_of_both_signals():
    advice = mistaken_units(-3.281, ("depth", "m"), ("u", "m/s"))
    assert advice == "depth is in feet, but was read as m. Or: u was in m/s, but was converted from ft/s."
    assert mistaken_units(0.514, ("depth", "m"), ("u", "m/s")) == "u is in knots, but was read as m/s."
    assert mistaken_units(0.0, ("depth", "m"), ("u", "m/s")) == ""
