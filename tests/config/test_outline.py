"""Outline of a vehicle: units, defaults and invalid values."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.config.outline import Outline, missing_keys, outline_of_options, units
from auvid_cli.errors import ConfigError

GIVEN = {"length": "2 m", "diameter": "20 cm", "mass": "55", "fin_span": "10 cm", "fin_area": "80 cm^2"}


def test_quantities_are_read_with_their_units():
    outline = outline_of_options(GIVEN | {"speed": "3 knot", "fins": 3})
    assert (outline.length, outline.diameter, outline.mass) == (2.0, 0.2, 55.0)
    assert outline.fin_area == pytest.approx(0.008)
    assert outline.speed == pytest.approx(3 * 1852 / 3600)


def test_missing_keys_are_listed():
    assert missing_keys({}) == [*GIVEN]
    assert missing_keys({"mass": "1", "speed": "2"}) == ["length", "diameter", "fin_span", "fin_area"]
    assert missing_keys(GIVEN) == []
    assert {"fins", "tail"}.isdisjoint(units())


def test_assumed_lists_defaults_as_options():
    assert outline_of_options(GIVEN | {"mass": "50", "nose": "15 cm", "speed": "2"}).assumed() == (
        "--fin-position 1.88 m",
        "--fins 4",
        "--tail +",
        "--tail-length 0.5 m",
        "--density 1025 kg/m^3",
    )


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"length": "0 m"}, r"^--length 0 m: length: must be greater than 0, got '0 m'$"),
        ({"mass": "60 m"}, r"^--mass 60 m: mass: expected a mass such as"),
        ({"mass": "-1", "tail": "y"}, r"(?s)^--mass -1: .*\n--tail y: tail: expected '\+' or 'x', got 'y'$"),
        ({"fins": 2}, "--fins 2: fins: must be at least 3, got 2"),
        ({"fins": 3, "tail": "x"}, "outline: .*an x tail has 4 fins"),
        ({"nose": "1.5 m", "tail_length": "1 m"}, "outline: nose and tail: together 2.5 m"),
        ({"fin_span": "10"}, "outline: fins.span is 10 m; expected 0.004 to 0.6 m"),
        ({"fin_area": "80"}, r"outline: fins.area is 80 m\^2; expected 0.0002 to 0.12"),
        ({"fin_position": "4 m"}, "outline: fins.position is 4 m"),
        ({"diameter": "2 m"}, "outline: length divided by diameter of the hull is 1"),
        # Three times the displacement of a cylinder with nose and tail, which is less than 64 kg.
        (
            {"mass": "192 kg"},
            r"outline: mass: 192 kg is 3\.\d times .* expected 0.5 to 1.5",
        ),
        ({"mass": "55000"}, "outline: mass: 5.5e\\+04 kg is 1e\\+03 times"),
    ],
)
def test_invalid_outline_raises_with_value(wrong, message):
    with pytest.raises(ConfigError, match=message):
        outline_of_options(GIVEN | wrong)


@pytest.mark.slow
@given(key=st.sampled_from([*GIVEN, "tail", "speed", "fin_position"]), text=st.text() | st.from_regex(r"-?[\d.]+ ?\w*"))
def test_any_text_is_valid_or_raises_config_error(key, text):
    message = "--"
    try:
        outline_of_options(GIVEN | {key: text})
    except ConfigError as error:
        message = str(error)
    assert message.startswith(("--", "outline: "))


@given(length=st.floats(0.1, 50.0), slenderness=st.floats(3.0, 20.0))
def test_defaults_fit_any_hull(length, slenderness):
    diameter = length / slenderness
    geometry = Outline.model_construct(
        length=length, diameter=diameter, fin_span=0.5 * diameter, fin_area=0.1 * diameter**2
    ).geometry()
    shape = geometry.shape(length, diameter, 1025.0)
    # Between a cone and a cylinder, and fins behind the centre.
    cylinder = 0.25 * 3.141592653589793 * diameter**2 * length
    assert cylinder / 3 < shape.hull.volume < cylinder
    assert shape.fin_x < 0.0
