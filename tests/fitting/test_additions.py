"""Additions to a model, and the settings with and without them."""

import numpy as np
import pytest

from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.data.faults import Fault, FaultKind, FaultTest
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.fitting.additions import (
    FAMILIES,
    Addition,
    addition_for,
    size_text,
    why_implausible,
    with_addition,
    without_addition,
)
from auvid_cli.fitting.results import Fit
from auvid_cli.identification.problem_setup import Motion

LAG = Addition("lag", "", 0.1)
_ADDITIONS = (
    *(Addition(name.value) for name in BiasName if name not in (BiasName.DELAY, BiasName.DVL_ARM)),
    Addition("dvl_arm", "z"),
    Addition("delay", "gyroscope", 0.02),
    LAG,
    Addition("term", "N_|v|r"),
    Addition("prior", "", 4.0),
)


def score_test(kind, component="", size=0.5, deviation=0.01):
    return FaultTest(Fault(kind, component), "1", size, deviation, "X_u|u|", 1.0)


@pytest.mark.parametrize("addition", _ADDITIONS, ids=str)
def test_addition_taken_away_restores_the_model(experiment_with, addition):
    settings = experiment_with()
    changed = with_addition(settings, addition)
    assert changed != settings
    restored = without_addition(changed, addition)
    assert restored.identification.estimate.biases == settings.identification.estimate.biases
    assert restored.identification.delays == settings.identification.delays
    assert restored.vehicle == settings.vehicle


@pytest.mark.parametrize("addition", _ADDITIONS, ids=str)
def test_addition_gives_valid_settings(experiment_with, addition):
    inertial = addition.family in ("accelerometer", "accelerometer_scale", "magnetometer", "magnetic_field")
    source = f"identification.attitude_from={'inertial' if inertial else 'ahrs'}"
    changed = with_addition(experiment_with(source), addition)
    assert parse_experiment(dump_experiment(changed), "test", ()) == changed


def test_second_axis_of_the_arm_is_added_to_the_first(experiment_with):
    arm = with_addition(experiment_with(), Addition("dvl_arm", "x"))
    both = with_addition(arm, Addition("dvl_arm", "z"))
    assert both.identification.estimate.model_dump()["dvl_arm"]["axes"] == ("x", "z")
    one = without_addition(both, Addition("dvl_arm", "x"))
    assert one.identification.estimate.model_dump()["dvl_arm"]["axes"] == ("z",)


@pytest.mark.parametrize(
    ("test", "expected"),
    [
        (score_test(FaultKind.CURRENT, "north"), ("current", "")),
        (score_test(FaultKind.SENSOR_DELAY, "DVL"), ("delay", "dvl")),
        (score_test(FaultKind.INPUT_DELAY), ("delay", "inputs")),
        (score_test(FaultKind.DVL_LEVER_ARM, "y"), ("dvl_arm", "y")),
        (score_test(FaultKind.CENTRE_OF_GRAVITY), ("ballast", "")),
        (score_test(FaultKind.MISSING_TERM, "N_|v|r"), ("term", "N_|v|r")),
    ],
)
def test_fault_asks_for_its_addition(test, expected):
    addition = addition_for(test, 100.0)
    assert addition is not None
    assert addition.key == expected
    assert addition.family in FAMILIES


def test_fault_without_a_setting_asks_for_nothing():
    assert addition_for(score_test(FaultKind.ANTICIPATING_FIN, "rudder"), 100.0) is None


def test_name_of_a_term_keeps_its_symbol():
    assert str(Addition("term", "N_|v|r")) == "term N_|v|r"
    assert str(Addition("delay", "magnetic_field")) == "delay of the magnetic field"


def test_drift_walks_as_far_as_it_drifts():
    # A drift of 0.5 per second moves by 50 in 100 s; a walk of w has then the standard deviation 10 w.
    addition = addition_for(score_test(FaultKind.CURRENT_DRIFT, "north"), 100.0)
    assert addition is not None
    assert addition.size == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("symbol", "text"), [("r", "r 0 +- 14 deg/s"), ("u", "u 0 +- 0.25 m/s"), ("Y_url", "Y_url 7 +- 0.25 kg/rad")]
)
def test_sizes_of_angles_are_in_degrees(hand_made, symbol, text):
    """0.25 rad are 14.3 degrees; a coefficient keeps its unit."""
    estimate = hand_made([0.0], {"Y_url": [7.0]})
    assert size_text(estimate, Addition("term", symbol)) == text


def test_settings_of_a_fit_give_its_model_again(experiment_with, hand_made, tmp_path):
    settings = changed = experiment_with()
    for addition in (Addition("current"), Addition("delay", "dvl", 0.05), Addition("term", "N_|v|r"), LAG):
        changed = with_addition(changed, addition)
    fit = Fit(hand_made([0.0], {}), Judgement(Grade.SOUND), (), changed, ())
    (tmp_path / "fit.yaml").write_text(fit.settings(), encoding="utf-8")
    again = parse_experiment(dump_experiment(settings), "test", (str(tmp_path / "fit.yaml"),))
    assert again.identification == changed.identification
    assert again.vehicle.actuators == changed.vehicle.actuators
    assert again.vehicle.coefficient_set == changed.vehicle.coefficient_set


@pytest.mark.parametrize(("scale", "is_plausible"), [(0.14, True), (-0.16, False), (0.32, False)])
def test_error_far_beyond_its_spread_is_not_plausible(experiment_with, scale, is_plausible):
    # The scale of a DVL has a spread of 5 %.
    estimated = experiment_with("identification.estimate.biases=[dvl]").identification.estimate
    motion = Motion(("dvl_scale", "dvl_yaw"), np.zeros(1), np.array([[scale, 0.01]]))
    refused = why_implausible(estimated, Addition("dvl"), motion)
    assert refused == "" if is_plausible else refused.startswith("not plausible: dvl_scale")
