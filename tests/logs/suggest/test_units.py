"""Only what physics fixes tells the unit of a column; the rest is a question in the map."""

from itertools import product

import numpy as np
import pytest

from auvid_cli.config.log_map import load_map
from auvid_cli.errors import ConfigError
from tests.logs.suggest.test_evidence import TRUTH, suggested

DEGREE = 180.0 / np.pi
RATES, ANGLES, VELOCITY = ("p", "q", "r"), ("phi", "theta", "psi"), ("u", "v", "w")


def log(dvl=True, ahrs=True, rates_in_deg=False, angles_in_deg=False, depth=1.0):
    factors = dict.fromkeys(RATES, DEGREE if rates_in_deg else 1.0) | {"down": depth}
    factors |= dict.fromkeys((*ANGLES, "rudder", "elevator"), DEGREE if angles_in_deg else 1.0)
    names = (*RATES, "down", "rudder", "elevator", *(VELOCITY if dvl else ()), *(ANGLES if ahrs else ()))
    return {name: factors.get(name, 1.0) * TRUTH[name] for name in names}


def units(columns):
    _, found = suggested(columns)
    return {name: sensor["unit"] for name, sensor in found["sensors"].items()}


@pytest.mark.slow
@pytest.mark.parametrize(("dvl", "ahrs", "rates", "angles"), list(product((True, False), repeat=4)))
def test_unit_is_right_or_question(dvl, ahrs, rates, angles):
    found = units(log(dvl, ahrs, rates, angles))
    assert found["gyroscope"] in ("deg/s" if rates else "rad/s", None)
    assert found.get("attitude") in ("deg" if angles else "rad", None)
    assert found["depth"] in ("m", None)
    assert found.get("dvl") in ("m/s", None)


@pytest.mark.slow
@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize("angles", [True, False])
def test_log_with_dvl_and_ahrs_leaves_no_question(rates, angles):
    assert None not in units(log(True, True, rates, angles)).values()


def test_depth_without_speed_is_question():
    text, found = suggested(log(dvl=False))
    assert found["sensors"]["depth"]["unit"] is None
    assert "unit: null # required: m or ft" in text


def test_fins_do_not_tell_unit_of_turn_rate():
    """The response of r to the rudder depends on the vehicle."""
    assert units({"r": 3.0 * TRUTH["r"], "rudder": TRUTH["rudder"]}) == {"gyroscope": None}


def test_heading_up_to_two_pi_is_in_radians():
    columns = {"psi": np.mod(TRUTH["psi"], 2.0 * np.pi), "r": TRUTH["r"]}
    assert columns["psi"].max() > 6.2
    assert units(columns) == {"attitude": "rad", "gyroscope": "rad/s"}


def test_open_unit_is_refused_with_its_key(tmp_path):
    text, _ = suggested(log(dvl=False))
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"sensors\.depth\.unit: got nothing; fill in the unit"):
        load_map(path)


def test_contradiction_is_question():
    """Depth that changes twice as fast as u sin(theta) fits neither m nor ft."""
    _, found = suggested(log(depth=2.0))
    assert found["sensors"]["depth"]["unit"] is None
