"""Contradictory data are refused before a search, and coefficients that data cannot determine are held."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.errors import DataError
from auvid_cli.fitting.look import refuse_contradictions, with_still_planes_held
from auvid_cli.fitting.search import FitLimits, fit_model
from auvid_cli.simulation.simulate import simulate

AT_FILE = "identification.prior={mean: vehicle, relative: 50 %}"


@pytest.fixture(scope="module")
def survey():
    return simulate(load_experiment(find_experiment("field"), ("manoeuvre.duration=60 s", AT_FILE)))


def test_survey_at_constant_depth_holds_vertical_plane_and_roll(survey):
    settings, still = with_still_planes_held(survey)
    assert still == ("the vertical plane", "roll")
    assert {symbol[0] for symbol in settings.identification.coefficients} == {"X", "Y", "N"}
    assert set(settings.identification.fixed(settings.vehicle)) == {
        symbol for symbol in survey.experiment.vehicle.coefficient_set.symbols if symbol[0] in "ZKM"
    }


@pytest.mark.parametrize("excited", ["elevator", "w"])
def test_moving_elevator_or_heave_keeps_the_vertical_plane(survey, excited):
    if excited == "w":
        dvl = survey.sensors["dvl"]
        moved = replace(
            survey, sensors=survey.sensors | {"dvl": replace(dvl, values=dvl.values + np.array([0.0, 0.0, 0.1]))}
        )
    else:
        values = survey.inputs.values.copy()
        values[:, 1] = 0.05 * np.sign(np.sin(survey.inputs.time))
        moved = replace(survey, inputs=replace(survey.inputs, values=values))
    assert with_still_planes_held(moved)[1] == ("roll",)


@pytest.mark.parametrize("setting", ["identification.prior=zero", "identification.coefficients=[N_uudr, M_uude]"])
def test_nothing_is_held_without_values_or_if_the_user_chose(survey, with_settings, setting):
    stated = with_settings(survey, setting)
    assert with_still_planes_held(stated) == (stated.experiment, ())


def with_values(dataset, name, change):
    record = dataset.sensors[name]
    return replace(dataset, sensors=dataset.sensors | {name: replace(record, values=change(record.values))})


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("gyroscope", lambda values: -values, "gyroscope: .* against "),
        ("gyroscope", lambda values: np.rad2deg(values), "gyroscope: "),
        ("dvl", lambda values: 1e3 * values, "dvl: (speed|range)"),
    ],
)
def test_wrong_sign_or_unit_ends_the_search(multisine_with, name, change, said):
    steps: list[str] = []
    wrong = with_values(multisine_with(), name, change)
    with pytest.raises(DataError, match=said) as caught:
        fit_model(wrong, FitLimits(), steps.append)
    assert steps == ["inspect the data"]
    assert "--ignore-inspection" in str(caught.value)


@pytest.mark.parametrize(
    "fault", ["sensors.gyroscope.bias=0.1 deg/s", "sensors.gyroscope.delay=20 ms", "manoeuvre.current_north=0.2"]
)
def test_errors_that_a_model_explains_are_not_refused(multisine_with, fault):
    refuse_contradictions(multisine_with(fault))
