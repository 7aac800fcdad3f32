import importlib.util
import math
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from auvid_cli.config.units import Unit, parse_components, parse_quantity

DEG = math.pi / 180.0
FINITE = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.parametrize(
    ("stated", "unit", "si"),
    [
        ("7 Hz", "Hz", 7.0),
        ("2 kHz", "Hz", 2000.0),
        ("0.1 cm/s", "m/s", 1e-3),
        ("2 knot", "m/s", 2 * 1852 / 3600),
        ("0.2 deg/s", "rad/s", 0.2 * DEG),
        ("3 °/s", "rad/s", 3 * DEG),
        ("30 rpm", "rad/s", math.pi),
        ("1.5 deg", "rad", 1.5 * DEG),
        ("0.003 g", "m/s^2", 0.003 * 9.80665),
        ("5 mg", "m/s^2", 0.005 * 9.80665),
        ("60 ug/Hz^0.5", "m/s^2/Hz^0.5", 60e-6 * 9.80665),
        ("3 g", "kg", 0.003),
        ("4.85 kg/m", "kg/m", 4.85),
        ("466N", "N", 466.0),
        ("2 N m", "N*m", 2.0),
        ("1 m/s^2/Hz^0.5", "m/s^2/Hz^0.5", 1.0),
        ("0.5 deg/s^0.5", "rad/s^0.5", 0.5 * DEG),
        ("6 deg/hour^0.5", "rad/s^0.5", 0.1 * DEG),
        ("2 kg/m", "kg/(m*rad)", 2.0),
        ("2 kg/m/deg", "kg/(m*rad)", 2.0 / DEG),
        ("1e-3", "m", 1e-3),
        ("-2e-3 km", "m", -2.0),
        (5, "rad", 5.0),
    ],
)
def test_quantity_is_converted_to_si(stated, unit, si):
    assert parse_quantity(stated, unit) == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize("value", ["7 furlong", "7 Hz 3", "7 hz", "", "Hz", "7 kg", True, None, [7], {"a": 7}])
def test_invalid_frequency_raises_with_example(value):
    with pytest.raises(ValueError, match=r"^expected a frequency .*'7 Hz'.* in Hz, got "):
        parse_quantity(value, "Hz")


@pytest.mark.parametrize(("stated", "unit"), [("7 Hz", "rad/s"), ("7 rad/s", "Hz"), ("7 rpm", "Hz"), ("3 %", "rad")])
def test_cycles_and_angles_are_not_confused(stated, unit):
    with pytest.raises(ValueError, match=f"in {unit}, got '{stated}'"):
        parse_quantity(stated, unit)


@pytest.mark.parametrize(("stated", "unit"), [("5 kg", "m/s^2"), ("5 g", "m/s"), ("5 m/s^2", "kg")])
def test_g_is_gravity_only_in_accelerations(stated, unit):
    with pytest.raises(ValueError, match="expected"):
        parse_quantity(stated, unit)


@pytest.mark.parametrize("value", [math.nan, math.inf, "nan", "inf m", "1e999 m", 10**400])
def test_infinite_value_raises(value):
    with pytest.raises(ValueError, match="expected a length"):
        parse_quantity(value, "m")


@pytest.mark.parametrize(
    "unit", ["m^9^9^9^9", "9**9**9**9*m", "(m", "m/", "()", "(" * 5000, "m.real", "__class__", "x" * 200_000]
)
def test_hostile_unit_raises(unit):
    with pytest.raises(ValueError, match="expected a length"):
        parse_quantity(f"1 {unit}", "m")


@pytest.mark.parametrize("unit", ["m/s", "kg*m^2/rad^2", "kg/(m*rad)", "rad/s^2/Hz^0.5", "Hz", "m/s^2/s^0.5"])
@given(value=FINITE)
def test_number_in_the_si_unit_is_exact(unit, value):
    assert parse_quantity(f"{value!r} {unit}", unit) == parse_quantity(value, unit) == value


@given(value=st.floats(-1e6, 1e6))
def test_degrees_round_trip(value):
    assert parse_quantity(f"{math.degrees(value)!r} deg", "rad") == pytest.approx(value, rel=1e-14)


@given(st.text())
def test_any_text_gives_a_number_or_a_value_error(text):
    try:
        assert math.isfinite(parse_quantity(text, "m/s^2"))
    except ValueError as error:
        assert str(error).startswith("expected an acceleration")  # noqa: PT017


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("1 cm", (0.01,)),
        (["1 cm"], (0.01,)),
        ([1, "2 cm", 3], (1.0, 0.02, 3.0)),
        ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0)),
    ],
)
def test_components_are_parsed(value, expected):
    assert parse_components(value, "m", 3) == expected


@pytest.mark.parametrize("value", [[], [1, 2], [1, 2, 3, 4]])
def test_wrong_number_of_components_raises(value):
    with pytest.raises(ValueError, match=f"1 or 3, .*{len(value)}"):
        parse_components(value, "m", 3)


def test_wrong_component_is_named():
    with pytest.raises(ValueError, match="component 2: expected a length"):
        parse_components([1, "2 s", 3], "m", 3)


def test_field_with_unit_converts_quantity():
    class Model(BaseModel):
        speed: Annotated[float, Unit("m/s")]

    assert Model.model_validate({"speed": "10 cm/s"}).speed == 0.1
    with pytest.raises(ValidationError, match=r"expected a speed .*'0.1 cm/s'.* in m/s"):
        Model.model_validate({"speed": "1 s"})


@pytest.mark.slow
def test_import_does_not_load_pint():
    code = "import sys, auvid_cli.config.loading; sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_usual_units_agree_with_pint():
    root = Path(__file__).parents[2]
    spec = importlib.util.spec_from_file_location("make_reference", root / "docs/make_reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    stated = (root / "auvid_cli/config/usual_units.json").read_text(encoding="utf-8")
    assert module.usual_units() == stated, "python docs/make_reference.py"


@pytest.mark.slow
def test_shipped_experiment_loads_without_pint():
    code = (
        "import sys; from auvid_cli.config.loading import find_experiment, load_experiment;"
        "load_experiment(find_experiment(None), ()); print('pint' in sys.modules)"
    )
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "False\n"
