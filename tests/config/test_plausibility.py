import pytest

from auvid_cli.config import sanity
from auvid_cli.errors import ConfigError

DRAWN_TOO_THIN = {"the geometry's diameter", "the geometry's hull"}
DRAWN_TOO_LONG = {*DRAWN_TOO_THIN, "the geometry's length"}


@pytest.fixture
def warnings(experiment_with):
    """Function: warnings about the vehicle of the paper with changed numbers, by subject."""

    def of(*changes):
        vehicle = experiment_with(*(f"vehicle.{change}" for change in changes)).vehicle
        return {warning.subject: str(warning) for warning in sanity.sanity_warnings(vehicle)}

    return of


def test_shipped_vehicle_has_no_warnings(vehicle_file, experiment_with):
    assert sanity.sanity_warnings(experiment_with(f"vehicle=vehicles/{vehicle_file}").vehicle) == []


@pytest.mark.parametrize(
    ("change", "subjects"),
    [
        ("parameters.X_udot=+1.5 kg", {"X_udot"}),
        ("parameters.K_pdot=0.1", {"K_pdot"}),
        ("parameters.m=47.556 lb", {"W"}),
        ("parameters.W=47.556", {"W", "B"}),
        ("parameters.B=600", {"B"}),
        ("size.diameter=1.753", {"B", "Ixx", "the geometry's hull", "the geometry's length"}),
        ("parameters.Ixx=187.1", {"Ixx", "the inertia"}),
        ("parameters.Iyy=0.0151", {"Iyy", "the inertia"}),
        ("parameters.Izz=30", {"the inertia"}),
        ("parameters.zG=-0.0083 m", {"zG"}),
        ("parameters.xB=219.4", {"xB"}),
        ("geometry.centre_of_buoyancy=0.5 m", {"the geometry's centre_of_buoyancy"}),
        ("geometry.hull={type: table, station: [0, 1.2, 2.4], radius: [0.08, 0.088, 0.08]}", {"the geometry's length"}),
        ("geometry.hull={type: table, station: [0, 1.1, 2.2], radius: [0, 0.095, 0]}", DRAWN_TOO_THIN),
        ("geometry.hull={type: table, station: [0, 1.1, 2.2], radius: [0.06, 0.06, 0.06]}", DRAWN_TOO_LONG),
    ],
)
def test_wrong_sign_or_unit_gives_warning(warnings, change, subjects):
    assert set(warnings(change)) == subjects


def test_length_in_wrong_unit_raises_with_geometry_and_warns_without(warnings):
    with pytest.raises(ConfigError, match="ahead of the centre of buoyancy"):
        warnings("size.length=21.94")
    assert set(warnings("size.length=21.94", "geometry=null")) == {"B", "Iyy", "Izz"}


def test_warning_has_value_and_expected_value(warnings):
    assert warnings("parameters.m=60 lb", "parameters.W=588 N", "parameters.B=588 N")["W"] == (
        "W is 588 N; expected m g = 266.9 N for a mass m of 27.22 kg"
    )
    assert warnings("parameters.X_udot=1.5")["X_udot"].startswith("X_udot is +1.5 kg; expected 0 or less")


def test_an_inertia_that_no_body_has_is_refused_though_added_mass_hides_it(warnings):
    with pytest.raises(ConfigError, match="invalid inertia: the rigid-body"):
        warnings("parameters.zG=1 m", "parameters.K_pdot=-1e4", "parameters.M_qdot=-1e4")
