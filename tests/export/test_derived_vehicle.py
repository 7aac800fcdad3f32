import pytest
import yaml

from auvid_cli.config.coefficients import Prior
from auvid_cli.config.loading import find_experiment, load_experiment, parse_drawing, parse_vehicle
from auvid_cli.config.outline import derived_vehicle_yaml
from auvid_cli.config.sanity import sanity_warnings
from auvid_cli.errors import ConfigError
from auvid_cli.identification.states import coefficient_priors
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import PARAMETER_SYMBOLS

DRAWING = {
    "name": "mine: a 'first' one",
    "mass": "53 kg",
    "size": {"length": "2 m", "diameter": "20 cm"},
    "geometry": {
        "hull": {"type": "nose_cylinder_tail", "nose": "0.25 m", "tail": "0.5 m"},
        "fins": {"position": "1.9 m", "span": "10 cm", "area": 0.008},
    },
}


@pytest.fixture(scope="module")
def text():
    return derived_vehicle_yaml(parse_drawing(DRAWING))


@pytest.fixture(scope="module")
def vehicle(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("vehicle") / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return load_experiment(find_experiment(None), (f"vehicle={path}", "identification.prior=geometry")).vehicle


def test_derived_vehicle_is_complete_and_sane(vehicle):
    assert tuple(vehicle.all_coefficients()) == (*SYMBOLS, "K_up")
    assert set(vehicle.known_parameters()) == set(PARAMETER_SYMBOLS)
    assert sanity_warnings(vehicle) == []
    known = vehicle.known_parameters()
    assert (known["m"], known["B"]) == (53.0, known["W"])
    assert known["X_prop"] == pytest.approx(-vehicle.all_coefficients()["X_u|u|"] * 1.5**2, rel=1e-4)


def test_derived_numbers_are_those_of_the_geometry(vehicle):
    """So that a simulation of this file and a prior from its geometry are known to be the same."""
    stated = vehicle.known_parameters() | vehicle.all_coefficients()
    unsure = vehicle.parameters.deviations() | vehicle.stated_deviations()
    derived = vehicle.derived_values()
    assert {each.name: each.mean for each in derived} == {each.name: stated[each.name] for each in derived}
    # Of 53 kg and a diameter of 20 cm.
    assumed = {"B": 2.6, "zG": 0.006}
    assert {each.name: each.standard_deviation for each in derived} | assumed == unsure


def test_each_number_has_formula_and_source(text, vehicle):
    lines = {line.split(":")[0].strip(): line for line in text.splitlines()}
    lines |= {term["name"]: str(term) for term in yaml.safe_load(text)["terms"]}
    for each in vehicle.derived_values():
        assert f"derived: {each.formula}".replace("'", "''") in lines[each.name]
        assert each.source in lines[each.name]


def test_geometry_is_written_with_units():
    hull = {"type": "table", "station": ["0 m", "40 cm", "1.4 m", 2.0], "radius": [0.0, 0.1, "10 cm", 0.02]}
    shape = {
        "hull": hull,
        "fins": DRAWING["geometry"]["fins"] | {"chord": "7 cm"},
        "appendages": [{"name": "sail", "area": "20 cm^2", "drag_coefficient": 0.5}],
    }
    drawing = parse_drawing(DRAWING | {"geometry": shape})
    text = derived_vehicle_yaml(drawing)
    written = yaml.safe_load(text)
    assert written["size"] == {"length": "2.0 m", "diameter": "0.2 m", "density": "1025.0 kg/m^3"}
    assert written["geometry"]["hull"]["station"] == ["0.0 m", "0.4 m", "1.4 m", "2.0 m"]
    assert (written["geometry"]["fins"]["chord"], written["geometry"]["fins"]["taper"]) == ("0.07 m", 1.0)
    assert written["geometry"]["appendages"] == [{"name": "sail", "area": "0.002 m^2", "drag_coefficient": 0.5}]
    assert written["geometry"]["speed"] == "1.5 m/s"
    assert parse_vehicle(text, "vehicle.yaml").geometry == drawing.geometry


def test_roll_damping_by_speed_is_a_term(text, vehicle):
    (entry,) = yaml.safe_load(text)["terms"]
    assert (entry["name"], entry["row"], entry["factors"]) == ("K_up", "K", ["u", "p"])
    (derived,) = (each for each in vehicle.derived_values() if each.name == "K_up")
    prior = coefficient_priors(vehicle, Prior(mean="geometry"))["K_up"]
    assert prior == (derived.mean, derived.standard_deviation)
    assert prior == coefficient_priors(vehicle, Prior(mean="vehicle"))["K_up"]
    # Four fins of 80 cm^2, their middles some 8 cm off the axis where the tail is thin: rho/2 S c_L r^2, c_L about 3.
    by_hand = -4 * 512.5 * 0.008 * 3.0 * 0.08**2
    assert by_hand * 1.5 < prior.mean < by_hand / 1.5


def test_all_mistakes_in_a_drawing_are_named():
    fins = {"position": "9 m", "span": "1 s", "area": 0.008}
    with pytest.raises(ConfigError) as error:
        parse_drawing(DRAWING | {"mass": "heavy", "geometry": DRAWING["geometry"] | {"fins": fins}})
    assert "mass: expected a mass" in str(error.value)
    assert "geometry.fins.span: expected a length" in str(error.value)
    with pytest.raises(ConfigError, match=r"geometry: fins.position is 9 m.*2 m long"):
        parse_drawing(DRAWING | {"geometry": DRAWING["geometry"] | {"fins": fins | {"span": 0.1}}})
