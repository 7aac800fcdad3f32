import re

import pytest

from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.errors import ConfigError

HULL = "{type: nose_cylinder_tail, nose: 20 cm, tail: 0.45 m}"
FINS = "{position: 2.087 m, span: 86 mm, area: 66.5 cm^2}"
SIZE = "vehicle.size={length: 2.194 m, diameter: 0.1753 m}"
GEOMETRY = f"vehicle.geometry={{hull: {HULL}, fins: {FINS}}}"


def test_a_drawing_is_read_with_units_and_kept(text):
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
    # The origin is the volume's centre, unless it is stated; tips are a span from the hull.
    assert shape.centre_of_buoyancy == shape.hull.centre
    assert shape.fins.chord == pytest.approx(0.00665 / 0.086)
    assert shape.fins.tip_radius == pytest.approx(float(shape.hull.radius_at(2.087)) + 0.086)
    assert parse_experiment(dump_experiment(experiment), "test") == experiment


def test_a_vehicle_without_one_has_no_shape(text):
    vehicle = parse_experiment(text, "test", ("vehicle.geometry=null",)).vehicle
    assert vehicle.shape() is None
    assert vehicle.derived_values() == ()


def test_a_hull_may_be_a_table(text):
    table = "{type: table, station: [0, 0.3 m, 1.7 m, 2.2 m], radius: [0, 9 cm, 9 cm, 1 cm]}"
    shape = parse_experiment(text, "test", (f"vehicle.geometry={{hull: {table}, fins: {FINS}}}",)).vehicle.shape()
    assert (shape.hull.length, shape.hull.diameter) == (2.2, 0.18)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("hull.type=sphere", "'sphere' is not a hull; one of myring, nose_cylinder_tail, table"),
        ("hull.nose=2 s", "expected a length such as '0.2 m'"),
        ("hull.nose=2 m", "nose and tail are 2.45 m of a length of 2.194 m"),
        ("hull={type: table, station: [0, 1, 1], radius: [0, 0.1, 0]}", "stations must rise from 0"),
        ("hull={type: table, station: [0, 1, 2], radius: [0, 0.1]}", "at least 3 of them"),
        ("hull={type: table, station: [0, 1, 2, 3], radius: [0, 0.1, 0]}", "4 stations and 3 radii"),
        ("hull={type: table, station: [0, 1, 2], radius: [0, 0, 0]}", "one radius must be greater than 0"),
        (
            "hull={type: table, station: [0, 1, 2], radius: [0, 0.95, 0]}",
            "1.05 times as long as wide",
        ),
        (
            "hull={type: myring, nose: 1, nose_offset: 1, middle: 1, tail: 1, tail_angle: 1}",
            "less than nose",
        ),
        ("fins.position=3 m", "fins.position is 3 m, and the hull 2.194 m long"),
        ("fins.position=0.8 m", "fins.position is 0.8 m, ahead of the centre of buoyancy at 1.027 m"),
        ("fins.area=66 cm", "a quantity such as '0.1 m^2'"),
        (
            "fins.area=66.5",
            "on a hull of 2.194 m by 0.1753 m; expected 0.00019 to 0.12 m^2",
        ),
        ("fins.area=66.5 mm^2", "fins.area is 6.65e-05 m^2 each"),
        ("fins.span=8.6", "fins.span is 8.6 m, on a hull 0.1753 m wide; expected 0.0035 to 0.53 m"),
        ("fins.span=8.6e-4", "fins.span is 0.00086 m"),
        ("fins.tail=y", "expected '+' or 'x', got 'y'"),
        ("fins={position: 2, span: 0.1, area: 0.01, number: 3, tail: x}", "a tail like an x has 4 fins, got 3"),
        ("fins.tip_radius=5 cm", "at least the span of 0.086 m"),
        ("centre_of_buoyancy=3 m", "centre_of_buoyancy is 3 m, and the hull 2.194 m long"),
        ("appendages=[{area: 0.01}]", "missing key 'drag_coefficient'"),
        ("keel=1", "unknown key 'keel'"),
    ],
)
def test_what_is_no_vehicle_is_refused_in_one_line(change, words, text):
    with pytest.raises(ConfigError, match=re.escape(words)) as error:
        parse_experiment(text, "test", (SIZE, GEOMETRY, f"vehicle.geometry.{change}"))
    assert len(str(error.value).splitlines()) == 1
