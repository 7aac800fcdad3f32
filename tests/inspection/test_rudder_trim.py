"""A rudder angle on straight courses is noted; one that holds a turn is not."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.inspection.fins import RudderTrim, rudder_trim_checks
from auvid_cli.inspection.inspect import inspect_dataset

DEGREE = np.pi / 180.0


def with_rudder(dataset, degrees):
    """Return the run with an offset of the recorded rudder."""
    values = dataset.inputs.values + degrees * DEGREE * np.eye(4)[0]
    return replace(dataset, inputs=replace(dataset.inputs, values=values))


def trims(dataset):
    return [check for check in inspect_dataset(dataset).checks if (check.subject, check.check) == ("rudder", "trim")]


def angle(check):
    words = check.statistic.split()
    return float(words[0]), float(words[2])


@pytest.fixture(scope="module")
def zigzag(simulated_with):
    return simulated_with("manoeuvre=manoeuvres/zigzag_20_20.yaml", "manoeuvre.duration=100 s")


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [-2.0, 1.0])
def test_rudder_trim_is_noted_with_its_angle(degrees, zigzag):
    (check,) = trims(with_rudder(zigzag, degrees))
    stands, unsure = angle(check)
    assert check.passed is None
    assert abs(stands - degrees) < 4.0 * unsure
    assert "[fin_trim]" in check.advice


def test_rudder_trim_is_a_likely_cause(zigzag):
    (causes,) = [check for check in inspect_dataset(with_rudder(zigzag, 2.0)).checks if check.check == "likely causes"]
    assert "a rudder trim" in causes.statistic
    assert "[fin_trim]" in causes.advice


def test_no_trim_passes_with_biased_gyroscope(zigzag):
    gyroscope = zigzag.sensors["gyroscope"]
    biased = replace(gyroscope, values=gyroscope.values + DEGREE * np.eye(3)[2])
    (check,) = trims(replace(zigzag, sensors=zigzag.sensors | {"gyroscope": biased}))
    assert check.passed
    assert abs(angle(check)[0]) < 4.0 * angle(check)[1]


def test_survey_shows_rudder_trim_in_a_current(experiment_with, simulated_with):
    settings = "manoeuvre=manoeuvres/lawnmower.yaml", "sensors=sensors/field.yaml", "manoeuvre.duration=200 s"
    trim = experiment_with(*settings).manoeuvre.fin_trim.rudder / DEGREE
    (check,) = trims(simulated_with(*settings))
    stands, unsure = angle(check)
    assert check.passed is None
    # The record is smaller than the actual angle, which is zero on a straight course.
    assert abs(stands + trim) < 4.0 * unsure


def test_trim_needs_straight_course(simulated_with):
    assert not trims(simulated_with("manoeuvre.duration=100 s"))


def test_trim_needs_level_vehicle(zigzag):
    attitude = zigzag.sensors["attitude"]
    tilted = replace(attitude, values=attitude.values + 5.0 * DEGREE * np.eye(3)[0])
    assert not trims(with_rudder(replace(zigzag, sensors=zigzag.sensors | {"attitude": tilted}), 2.0))


def test_trim_needs_heading(zigzag):
    assert not trims(replace(zigzag, sensors={k: v for k, v in zigzag.sensors.items() if k in ("gyroscope", "dvl")}))


def test_uncertain_trim_is_not_checked():
    assert rudder_trim_checks(RudderTrim(0.1, 0.19 * DEGREE))
    assert not rudder_trim_checks(RudderTrim(0.1, 0.21 * DEGREE))
    assert not rudder_trim_checks(None)
