import re

import pytest

from auvid_cli.config.loading import parse_experiment
from auvid_cli.errors import ConfigError


def errors(text: str, *overrides: str) -> list[str]:
    """First lines of the mistakes, without the excerpts."""
    with pytest.raises(ConfigError) as caught:
        parse_experiment(text, "e.yaml", overrides)
    return [line for line in str(caught.value).splitlines() if not re.match(r"    +\d* *\|", line)]


def error(text: str, old: str, new: str) -> str:
    """The only mistake of a valid text with one part replaced."""
    assert text.count(old) == 1
    (only,) = errors(text.replace(old, new))
    return only


def test_message_has_position_and_excerpt(text):
    with pytest.raises(ConfigError) as caught:
        parse_experiment(text.replace("rate: 7 Hz", "rate: 7 furlong"), "e.yaml")
    assert str(caught.value) == (
        "e.yaml:8:11: sensors.dvl.rate: "
        "expected a frequency such as '7 Hz' or a bare number in Hz, got '7 furlong'\n"
        "    8 |     rate: 7 furlong\n"
        "      |           ^"
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "rate: 7 Hz",
            "rat: 7 Hz\n    rate: 7 Hz",
            "8:5: sensors.dvl.rat: unknown key 'rat'; did you mean 'rate'?",
        ),
        (
            "name: small",
            "name: a\nqq: 1",
            "2:1: qq: unknown key 'qq'; known keys: name, seed, vehicle, identification,",
        ),
        (
            "    rate: 7 Hz\n",
            "",
            "7:3: sensors.dvl: missing key 'rate' (samples per second): a frequency such as",
        ),
        ("  speed: 3.9 m/s", "  speed: 0", "14:10: manoeuvre.speed: must be greater than 0, got 0"),
        (
            "  pitch: -10 deg",
            "  pich: -10 deg\n  pitch: 0",
            "16:3: manoeuvre.pich: unknown key 'pich'; did you mean 'pitch'?",
        ),
        (
            "  pitch: -10 deg\n",
            "",
            "11:1: manoeuvre: missing key 'pitch' (mean pitch",
        ),
        (
            "type: spiral",
            "type: sprial",
            "12:9: manoeuvre.type: 'sprial' is not a manoeuvre; did you mean 'spiral'?",
        ),
        (
            "  type: spiral\n",
            "",
            "11:1: manoeuvre: missing key 'type': one of spiral, zigzag, turning_circle,",
        ),
        (
            "attitude: ahrs",
            "attitude: ahsr",
            "10:13: sensors.attitude: expected 'ahrs' or 'direct', got 'ahsr'",
        ),
        (
            "noise: 0.1 cm/s",
            "noise: [1, 2]",
            "9:12: sensors.dvl.noise: expected one quantity or a list of 1 or 3",
        ),
        ("noise: 0.1 cm/s", "noise: 1\n    range: 1", "7:3: sensors.dvl: expected exactly one of 'noise'"),
        ("name: small", "name: 3", "1:7: name: expected text, got 3"),
        ("name: small", "name: s\nseed: 1.5", "2:7: seed: expected a whole number, got 1.5"),
        (
            "name: small",
            "name: s\nidentification: 3",
            "2:17: identification: expected a mapping with the keys filters",
        ),
    ],
)
def test_mistake_is_reported_at_its_position(text, old, new, message):
    line = error(text, old, new)
    assert line.startswith(f"e.yaml:{message}")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("coefficients: [K_p|p|, 3]", "identification.coefficients.1: expected text, got 3"),
        ("coefficients: 5", "identification.coefficients: expected 'all'"),
        (
            "coefficients: {X_u|u|: -5}",
            "identification.coefficients: expected 'all' or a list of names; values belong in vehicle.coefficients",
        ),
        (
            "coefficients: [X_uu]",
            "identification.coefficients: 'X_uu' is not a coefficient; did you mean 'X_u|u|'?",
        ),
        (
            "filters: [ekf, efk]",
            "identification.filters.1: expected 'ekf', 'ckf', 'tukf', 'ukf', 'smoother' or 'output_error', got 'efk'",
        ),
        ("filters: []", "identification.filters: expected at least 1 of them, got a list"),
        ("prior: {factor: x}", "identification.prior.factor: expected a number, got 'x'"),
        ("ukf: {alpha: 3, beta: 1}", "identification.ukf: beta must be at least alpha^2"),
        ("ekf:", "identification.ekf: expected a mapping with the key transition, got nothing"),
    ],
)
def test_mistake_in_identification_is_reported(text, settings, message):
    (line,) = errors(f"{text}identification:\n  {settings}\n")
    assert re.match(r"e\.yaml:18:\d+: " + re.escape(message), line)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("vehicle.parameters.mm=3", "unknown key 'mm'; did you mean 'm'?"),
        (
            "vehicle.coefficients.X_uu=3",
            "unknown key 'X_uu'; did you mean 'X_u|u|'?",
        ),
        (
            "vehicle.parameters.m=3 m",
            "expected a mass such as '47.5 kg' or a bare number in kg",
        ),
        ("vehicle.parameters.m={value: 3 m}", "vehicle.parameters.m.value: expected a mass such as"),
        ("vehicle.size={}", "missing key 'length' (hull length): a length such as"),
        ("vehicle.parameters={}", "missing key 'm' (mass): a mass such as '47.5 kg'"),
        (
            "manoeuvre.excitation.rudder.amplitude=-1 deg",
            "must be at least 0",
        ),
    ],
)
def test_mistake_in_override_is_reported_there(text, override, message):
    assert f"--set {override}: {message}" in errors(text, override)[0]


def test_value_in_list_of_names_gives_hint(text):
    for before in ([], ["identification.coefficients=all"]):
        (line,) = errors(text, *before, "identification.coefficients.X_u|u|=-5")
        assert line.startswith("--set identification.coefficients.X_u|u|=-5")
        assert "vehicle.coefficients" in line


def test_changed_type_is_reported_at_the_override(text):
    """Keys of the old type are valid in the file, so the override of the type is reported."""
    lines = errors(text, "manoeuvre.type=turning_circle", "manoeuvre.keel=1")
    assert {line.partition(": ")[0] for line in lines} == {
        "--set manoeuvre.type=turning_circle",
        "--set manoeuvre.keel=1",
    }
    assert any("missing key 'rudder'" in line for line in lines)
    assert any("manoeuvre.pitch: unknown key" in line for line in lines)


def test_missing_key_of_referenced_file_is_reported_there(text, tmp_path):
    vehicle = tmp_path / "v.yaml"
    vehicle.write_text("name: v\nsize: {length: 1, diameter: 1}\n")
    (line,) = errors(text, f"vehicle={vehicle}")
    assert line.startswith(f"{vehicle}:1:1: vehicle: missing key 'parameters'")
    assert "a mapping with the keys m, W, B, Ixx," in line


def test_all_mistakes_are_reported_at_once(text, tmp_path):
    vehicle = tmp_path / "v.yaml"
    vehicle.write_text("name: v\nname: w\nsize: {length: 1 kg, diameter: 1}\n")
    wrong = text.replace("rate: 7 Hz", "rate: 7").replace("speed: 3.9 m/s", "speed: x").replace("ahrs", "x")
    lines = errors(wrong + "seed: -1\nmanoeuvre: {}\n", f"vehicle={vehicle}", "seed", "sensors=nope.yaml")
    expected = [
        "manoeuvre.speed",
        "seed: must",
        "duplicate key 'manoeuvre'",
        "duplicate key 'name'",
        "size.length",
        "missing key 'parameters'",
        "--set seed: expected key.key=value",
        "nope.yaml: no such file",
    ]
    assert [[part in line for line in lines].count(True) for part in expected] == [1] * len(expected)
    assert not any(": sensors." in line for line in lines)
