import re

import pytest

from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.errors import ConfigError

HULL = "{type: nose_cylinder_tail, nose: 20 cm, tail: 0.45 m}"
FINS = "{position: 2.087 m, span: 86 mm, area: 66.5 cm^2}"
SIZE = "vehicle.size={length: 2.194 m, diameter: 0.1753 m}"
GEOMETRY = f"vehicle.geometry={{hull: {HULL}, fins: {FINS}}}"


def test_geometry_is_read_with_units_and_survives_dump(text):
    experiment = parse_experiment(
        text,
        "test",
        (
            SIZE,
            GEOMETRY,
        ),
    )
    shape = experiment.vehicle.shape()
    assert (shape.hull.length, shape.hull.diameter, shape.density) == (2.194, pytest.approx(0.1753), 1025.0)
    assert (shape.fins.area, shape.fins.span) == pytest.approx((0.00665, 0.086))
    # Defaults: origin at the centre of the volume, and tips one span from the hull.
    assert shape.centre_of_buoyancy == shape.hull.centre
    assert shape.fins.chord == pytest.approx(0.00665 / 0.086)
    assert shape.fins.tip_radius == pytest.approx(float(shape.hull.radius_at(2.087)) + 0.086)
    assert parse_experiment(dump_experiment(experiment), "test") == experiment


def test_vehicle_without_geometry_has_no_shape(text):
    vehicle = parse_experiment(text, "test", ("vehicle.geometry=null",)).vehicle
    assert vehicle.shape() is None
    assert vehicle.derived_values() == ()


def test_hull_of_table_has_its_size(text):
    table = "{type: table, station: [0, 0.3 m, 1.7 m, 2.2 m], radius: [0, 9 cm, 9 cm, 1 cm]}"
    shape = parse_experiment(text, "test", (f"vehicle.geometry={{hull: {table}, fins: {FINS}}}",)).vehicle.shape()
    assert (shape.hull.length, shape.hull.diameter) == (2.2, 0.18)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("hull.type=sphere", "'sphere' is not a hull"),
        ("hull.nose=2 s", "expected a length such as '0.2 m'"),
        ("hull.nose=2 m", "nose and tail: together 2.45 m"),
        ("hull={type: table, station: [0, 1, 1], radius: [0, 0.1, 0]}", "stations must increase from 0"),
        ("hull={type: table, station: [0, 1, 2], radius: [0, 0.1]}", "at least 3 of them"),
        ("hull={type: table, station: [0, 1, 2, 3], radius: [0, 0.1, 0]}", "4 stations and 3 radii"),
        ("hull={type: table, station: [0, 1, 2], radius: [0, 0, 0]}", "at least one radius"),
        (
            "hull={type: table, station: [0, 1, 2], radius: [0, 0.95, 0]}",
            "length divided by diameter of the hull is 1.05",
        ),
        (
            "hull={type: myring, nose: 1, nose_offset: 1, middle: 1, tail: 1, tail_angle: 1}",
            "less than nose",
        ),
        ("fins.position=3 m", "fins.position is 3 m"),
        ("fins.position=0.8 m", "ahead of the centre of buoyancy at 1.027 m"),
        ("fins.area=66 cm", "a quantity such as '0.1 m^2'"),
        (
            "fins.area=66.5",
            "fins.area is 66.5 m^2; expected 0.00019 to 0.12 m^2",
        ),
        ("fins.area=66.5 mm^2", "fins.area is 6.65e-05 m^2"),
        ("fins.span=8.6", "fins.span is 8.6 m; expected 0.0035 to 0.53 m"),
        ("fins.span=8.6e-4", "fins.span is 0.00086 m"),
        ("fins.tail=y", "expected '+' or 'x', got 'y'"),
        ("fins={position: 2, span: 0.1, area: 0.01, number: 3, tail: x}", "an x tail has 4 fins, got 3"),
        ("fins.tip_radius=5 cm", "at least the span of 0.086 m"),
        ("centre_of_buoyancy=3 m", "centre_of_buoyancy is 3 m"),
        ("appendages=[{area: 0.01}]", "missing key 'drag_coefficient'"),
        ("keel=1", "unknown key 'keel'"),
    ],
)
def test_invalid_geometry_gives_one_line_message(change, words, text):
    with pytest.raises(ConfigError, match=re.escape(words)) as error:
        parse_experiment(text, "test", (SIZE, GEOMETRY, f"vehicle.geometry.{change}"))
    assert len(str(error.value).splitlines()) == 1
