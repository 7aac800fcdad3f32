"""Own terms of a vehicle: units, symbols and invalid terms."""

import re
from pathlib import Path

import pytest

from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.coefficients import SYMBOLS

CROSS = '{name: N_|v|r, row: N, factors: ["|v|", r], value: -120 kg*m/rad}'


def with_terms(*terms):
    return f"vehicle.terms=[{', '.join(terms)}]"


@pytest.mark.slow
def test_term_is_coefficient_after_the_22(text):
    experiment = parse_experiment(text, "test", (with_terms(CROSS, "{name: K_up, row: K, factors: [u, p]}"),))
    vehicle = experiment.vehicle
    assert vehicle.coefficient_set.symbols[22:] == ("N_|v|r", "K_up")
    assert vehicle.coefficient_set.units["N_|v|r"] == "kg*m/rad"
    assert vehicle.stated_coefficients()["N_|v|r"] == -120.0
    assert "K_up" not in vehicle.stated_coefficients()
    assert experiment.identification.estimated(vehicle) == vehicle.coefficient_set.symbols
    assert parse_experiment(dump_experiment(experiment), "test") == experiment
    with pytest.raises(ConfigError, match="no value for K_up"):
        vehicle.all_coefficients()


@pytest.mark.parametrize(
    ("row", "factors", "quantity", "si"),
    [
        ("Y", "[v]", "2 g/ms", 2.0),
        ("K", "[thrust]", "3 mm", 3e-3),
        ("X", "[thrust]", "0.1", 0.1),
        ("X", "[u, u, rudder, rudder]", "5 kg/m", 5.0),
        ("N", "[p, q]", "1 g*m^2", 1e-3),
        ("X", '["|thrust|", u]', "4 s/m", 4.0),
        ("X", '[n, "|n|"]', "0.3 N*s^2", 0.3),
        ("K", '[n, "|n|"]', "30 g*m^2", 0.03),
        ("X", '["|n|", u]', "-900 g", -0.9),
        ("X", "[voltage]", "20 mN/V", 0.02),
        ("X", "[voltage, voltage]", "0.1 kg*m/(s^2*V^2)", 0.1),
    ],
)
def test_value_is_converted_from_any_unit(row, factors, quantity, si, text):
    override = with_terms(f"{{name: {row}_t, row: {row}, factors: {factors}, value: {quantity}}}")
    turns = "manoeuvre.propeller={revolutions: 20 turn/s, voltage: 24 V}"
    (term,) = parse_experiment(text, "test", (override, turns)).vehicle.terms
    assert term.value == pytest.approx(si, rel=1e-12)


def test_unknown_factor_is_reported_once(text):
    term = "{name: X_a, row: X, factors: [nn], value: 1 kg, prior: {mean: 2 kg, standard_deviation: 1 kg}}"
    with pytest.raises(ConfigError) as error:
        parse_experiment(text, "test", (with_terms(term),))
    assert "unknown factor 'nn'" in str(error.value)
    assert str(error.value).count("\n") == 0


@pytest.mark.parametrize(
    ("terms", "place", "message"),
    [
        ("{row: N, factors: [v]}", 3, "terms.0: missing key 'name'"),
        ("{name: N_|v|, row: N}", 3, "terms.0: missing key 'factors'"),
        ("{name: yaw, row: N, factors: [v]}", 10, "terms.0.name: must match"),
        ("{name: N_a, row: L, factors: [v]}", 20, "terms.0.row: expected 'X', 'Y', 'Z', 'K', 'M' or 'N'"),
        ("{name: N_a, row: M, factors: [v]}", 20, "terms.0.row: N_a: the name begins with N"),
        ("{name: N_a, row: N, factors: []}", 32, "terms.0.factors: expected at least 1 of them"),
        ("{name: N_a, row: N, factors: [vv]}", 32, "terms.0.factors: unknown factor 'vv'; expected one of u, v"),
        ("{name: N_a, row: N, factors: ['|v']}", 32, "terms.0.factors: '|v': incomplete modulus; expected |v|"),
        ("{name: N_a, row: N, factors: [v], value: 1 kg}", 44, "terms.0.value: expected a quantity such as '0.1"),
        ("{name: N_a, row: N, factors: [v], size: 1}", 37, "terms.0.size: unknown key 'size'"),
        (
            "{name: N_a, row: N, factors: [v], prior: {mean: 1 kg}}",
            37,
            "terms.0.prior: expected a quantity such as '0.1 kg*m/s'",
        ),
        (
            "{name: N_vv, row: N, factors: [v, v]}",
            10,
            "terms.0.name: N_vv: this name is already taken by N_v|v|",
        ),
        (
            "{name: N_a, row: N, factors: [v, '|v|']}",
            10,
            "terms.0.name: N_a: same factors as N_v|v|",
        ),
        (
            "{name: K_prop, row: K, factors: [thrust]}",
            10,
            "terms.0.name: K_prop: this name is already taken",
        ),
    ],
)
def test_invalid_term_gives_one_line_message_at_its_position(terms, place, message, text, tmp_path):
    (line,) = errors_of(terms, text, tmp_path)
    assert line.startswith(f"+0:{place}: vehicle.{message}")


def test_equal_terms_are_reported(text, tmp_path):
    terms = "{name: N_a, row: N, factors: [v, v]}\n- {name: N_b, row: N, factors: ['|v|', '|v|']}"
    (line,) = errors_of(terms, text, tmp_path)
    assert "+1:10: vehicle.terms.1.name: N_b: same factors as N_a" in line


def errors_of(terms, text, folder):
    """Return the messages about a vehicle file with terms at its end, with lines relative to the first term."""
    named = Path(re.search(r"vehicle: (\S+)", text).group(1))
    shipped, path = named.read_text(encoding="utf-8"), folder / "vehicle.yaml"
    path.write_text(f"{shipped}terms:\n- {terms}\n", encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        parse_experiment(text.replace(str(named), str(path)), "test")
    first = shipped.count("\n") + 2
    return [
        re.sub(r"^\S+vehicle.yaml:(\d+)", lambda place: f"+{int(place[1]) - first}", line)
        for line in str(caught.value).splitlines()
        # Other lines are excerpts.
        if "vehicle.yaml:" in line
    ]


def test_settings_may_name_terms_and_unknown_ones_raise(text):
    settings = (
        "identification.coefficients=[N_|v|r, X_u|u|]",
        "identification.prior.standard_deviation.N_|v|r=50 kg*m/rad",
        "identification.output_error.bounds.N_|v|r=[-1e3, 0]",
    )
    experiment = parse_experiment(text, "test", (with_terms(CROSS), *settings))
    assert experiment.identification.estimated(experiment.vehicle) == ("X_u|u|", "N_|v|r")
    assert "N_|v|r" not in experiment.identification.fixed(experiment.vehicle)
    for setting in settings:
        with pytest.raises(ConfigError, match=r"'N_\|v\|r' is not a coefficient"):
            parse_experiment(text, "test", (setting,))


def test_coefficients_with_estimate_false_are_fixed(text):
    fixed_coefficient = "vehicle.coefficients.M_w|w|={value: 0 kg, estimate: false}"
    fixed_term = with_terms(CROSS.replace("}", ", estimate: false}"))
    experiment = parse_experiment(text, "test", (fixed_coefficient, fixed_term))
    assert experiment.identification.fixed(experiment.vehicle) == ("M_w|w|", "N_|v|r")
    assert parse_experiment(dump_experiment(experiment), "test") == experiment
    named = parse_experiment(text, "test", (fixed_coefficient, fixed_term, "identification.coefficients=[M_w|w|]"))
    assert named.identification.estimated(named.vehicle) == ("M_w|w|",)
    with pytest.raises(ConfigError, match=r"bounds names M_w\|w\|, .*not among"):
        parse_experiment(text, "test", (fixed_coefficient, "identification.output_error.bounds.M_w|w|=[-1, 1]"))


def test_no_coefficient_to_estimate_raises(text):
    assert "identification" not in text
    known = [f"vehicle.coefficients.{symbol}.estimate=false" for symbol in SYMBOLS]
    with pytest.raises(ConfigError, match="no coefficient to estimate"):
        parse_experiment(text, "test", known)
