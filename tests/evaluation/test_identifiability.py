"""Bounds, their classes, contributions and groups, on information that is written down by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.evaluation.bounds import DataInformation
from auvid_cli.evaluation.identifiability import Assessed, assess, assess_dataset, coefficients_to_fix
from auvid_cli.filters.least_squares import Information
from auvid_cli.vehicle.coefficients import COEFFICIENTS

NAMES = ("X_u|u|", "Y_uvl", "Y_uudr", "K_p|p|")
VALUES = (-4.0, -28.0, 6.0, 0.5)


def information(*rows):
    """Of measurements that each see a combination of the four, with unit noise."""
    rows = np.column_stack([np.array(rows, dtype=float), np.zeros(len(rows))])
    return Information.empty(4).with_rows(rows, len(rows))


def judged(by_sensor, values=VALUES, to_si=(1.0, 1.0, 1.0, 1.0)):
    whole = Information.empty(4)
    for part in by_sensor.values():
        whole = whole.join(part)
    named = {name: Assessed(v, "kg", abs(v) or 40.0) for name, v in zip(NAMES, values, strict=True)}
    return assess(by_sensor, [(10.0, whole)], named, np.array(to_si), {})


def test_bounds_are_those_of_weighted_least_squares():
    rng = np.random.default_rng(4)
    rows, scale = rng.standard_normal((50, 4)), np.array([2.0, 0.1, 30.0, 1.0])
    identifiability = judged({"dvl": information(*rows[:20]), "gyroscope": information(*rows[20:])}, to_si=scale)
    covariance = np.linalg.inv(rows.T @ rows) * np.outer(scale, scale)
    deviation = np.sqrt(np.diag(covariance))
    assert_allclose([bound.cramer_rao_bound for bound in identifiability.bounds], deviation)
    assert_allclose([bound.percent for bound in identifiability.bounds], 100.0 * deviation / np.abs(VALUES))
    assert_allclose(identifiability.correlation, covariance / np.outer(deviation, deviation), atol=1e-12)
    assert [bound.coefficient for bound in identifiability.bounds] == list(NAMES)


def test_labels_follow_the_bound_in_percent():
    weights = 100.0 / np.abs(VALUES) / [0.5, 4.0, 19.0, 21.0]
    identifiability = judged({"dvl": information(*np.diag(weights))})
    assert [b.label for b in identifiability.bounds] == ["within 1 %", "within 5 %", "within 20 %", "not identified"]


def test_what_no_measurement_sees_has_no_bound_and_a_zero_goes_by_its_natural_magnitude():
    identifiability = judged(
        {"dvl": information([100, 0, 0, 0], [0, 100, 0, 0], [0, 0, 100, 0])}, values=(-4.0, 0.0, 6.0, 0.5)
    )
    assert identifiability.bounds[3].cramer_rao_bound == np.inf
    assert identifiability.bounds[3].label == "not identified"
    assert identifiability.bounds[1].cramer_rao_bound == pytest.approx(0.01)
    assert identifiability.bounds[1].percent == pytest.approx(1.0 / 40.0)
    assert identifiability.bounds[0].label == "within 1 %"


def test_each_sensor_has_its_share():
    identifiability = judged(
        {"dvl": information([3, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]), "gyroscope": information(*np.eye(4))}
    )
    assert_allclose(identifiability.shares["dvl"] + identifiability.shares["gyroscope"], 1.0)
    assert identifiability.shares["dvl"][0] == pytest.approx(0.9)
    assert identifiability.shares["dvl"][1] == pytest.approx(0.5)
    assert identifiability.bounds[0].best_sensor == "dvl"
    assert identifiability.bounds[0].best_share == pytest.approx(0.9)


def test_only_a_combination_is_determined():
    seen = information([0, 100, 90, 0], [0, 1, -1, 0], [50, 0, 0, 0], [0, 0, 0, 50])
    identifiability = judged({"dvl": seen})
    (group,) = identifiability.groups
    assert group.members == ("Y_uvl", "Y_uudr")
    heavy, _, factor, light = group.combination.replace("+ ", "+ ").split()
    assert {heavy, light} == {"Y_uvl", "Y_uudr"}
    ratio = float(factor) if heavy == "Y_uvl" else 1.0 / float(factor)
    assert ratio == pytest.approx(0.9, rel=0.02)
    assert group.percent < 0.1
    assert group.worst_percent > 5.0
    assert identifiability.bounds[1].group == "Y_uudr"
    assert identifiability.bounds[0].group == ""


def test_bounds_fall_with_the_duration_and_sensor_errors_stand_beside_their_priors():
    half, whole = information(*np.eye(4)), information(*np.eye(4), *np.eye(4))
    named = {name: Assessed(v, "kg", abs(v)) for name, v in zip(NAMES[:3], VALUES[:3], strict=True)}
    identifiability = assess({"dvl": whole}, [(5.0, half), (10.0, whole)], named, np.ones(4), {"bias_p": (3, 0.4)})
    (first, before), (last, after) = identifiability.growth
    assert (first, last) == (5.0, 10.0)
    assert_allclose(before / after, np.sqrt(2.0))
    error = identifiability.sensor_errors["bias_p"]
    assert error.bound == pytest.approx(np.sqrt(0.5))
    assert error.prior == 0.4
    # Together they leave 0.348, more than half of the prior.
    assert not error.observed
    wide = assess({"dvl": whole}, [(10.0, whole)], named, np.ones(4), {"bias_p": (3, 1.3)})
    assert wide.sensor_errors["bias_p"].observed


def test_process_noise_counts_where_it_promises_less():
    seen = {"dvl": information(*np.diag(100.0 / np.abs(VALUES) / 0.5))}
    named = {name: Assessed(v, "kg", abs(v)) for name, v in zip(NAMES, VALUES, strict=True)}
    noisy = {name: 0.1 * abs(v) for name, v in zip(NAMES, VALUES, strict=True)} | {"K_p|p|": 0.0}
    bounds = assess(seen, [(10.0, seen["dvl"])], named, np.ones(4), {}, noisy).bounds
    assert [bound.label for bound in bounds] == ["within 20 %"] * 3 + ["within 1 %"]
    assert bounds[0].percent == pytest.approx(0.5)
    assert bounds[0].percent_with_noise == pytest.approx(10.0)


def test_the_least_known_are_held_until_the_rest_is_known():
    """Of two that only their sum is known of, one is enough; what nothing tells is held as well."""
    rows = np.array([[100.0, 0, 0, 0], [0, 100.0, 100.0, 0], [0, 0.01, 0, 0]])
    values = {name: Assessed(1.0, "kg", 1.0) for name in NAMES}
    holding = coefficients_to_fix(DataInformation(NAMES, rows.T @ rows, np.ones(4)), values, {"K_p|p|"}, COEFFICIENTS)
    assert holding is not None
    assert holding.kept in (("X_u|u|", "Y_uvl"), ("X_u|u|", "Y_uudr"))
    assert holding.worst_percent == pytest.approx(1.0)
    assert holding.motions == ("surge", "sway")
    assert holding.unstated == tuple(name for name in holding.held if name != "K_p|p|")
    assert coefficients_to_fix(DataInformation(NAMES, 1e4 * np.eye(4), np.ones(4)), values, NAMES, COEFFICIENTS) is None
    assert (
        coefficients_to_fix(DataInformation(NAMES, np.zeros((4, 4)), np.ones(4)), values, NAMES, COEFFICIENTS) is None
    )


LATERAL = (
    "manoeuvre={type: zigzag, duration: 100 s, speed: 1.5 m/s, rudder: 15 deg, heading: 40 deg, approach: 5 s}",
    "sensors.attitude.source=direct",
    "identification.process_noise={velocity: 1e-2, rate: 1e-2, attitude: 1e-4}",
)


@pytest.mark.slow
def test_a_lateral_run_is_named_with_the_coefficients_to_hold(simulated_with, with_settings):
    dataset = simulated_with(*LATERAL).without_truth()
    found = assess_dataset(dataset)
    assert found.holding is not None
    assert set(found.holding.motions) == {"surge", "sway", "yaw"}
    assert {"Z_w|w|", "M_q|q|", "M_uude", "K_p|p|"} <= set(found.holding.held)
    assert {"X_u|u|", "N_url", "N_uudr"} <= set(found.holding.kept)
    assert "no current and no fin_trim and no ballast" in found.remark
    # Without process noise far more seemed to be known.
    assert sum(bound.percent <= 20.0 for bound in found.bounds) > len(found.holding.kept) + 3
    kept = with_settings(dataset, f"identification.coefficients=[{', '.join(found.holding.kept)}]")
    again = assess_dataset(kept)
    assert again.holding is None
    assert max(bound.percent_with_noise for bound in again.bounds) == pytest.approx(
        found.holding.worst_percent, rel=0.1
    )
    # What else is not known takes its part.
    unknown = with_settings(kept, "identification.estimate.biases=[current, fin_trim, ballast]")
    less = {bound.coefficient: bound.percent_with_noise for bound in assess_dataset(unknown).bounds}
    assert all(less[bound.coefficient] > 0.99 * bound.percent_with_noise for bound in again.bounds)
    assert less["X_u|u|"] > 1.2 * next(b.percent_with_noise for b in again.bounds if b.coefficient == "X_u|u|")


LEVEL = (
    "manoeuvre={type: lawnmower, duration: 60 s, speed: 1.5 m/s, leg: 20 s, turn_rate: 6 deg/s}",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
    "sensors.gyroscope.rate=10 Hz",
    "identification.coefficients=[X_u|u|, N_r|r|, N_uudr]",
)


@pytest.mark.slow
def test_at_one_speed_a_moment_of_trim_cannot_be_told_from_an_elevator_that_is_off(simulated_with, with_settings):
    """Level at a held speed both are one constant moment; the bound of each is then the prior's, and that is said."""
    level = simulated_with(*LEVEL).without_truth()
    alone, beside = (
        assess_dataset(with_settings(level, f"identification.estimate.biases=[{blocks}]")).sensor_errors
        for blocks in ("ballast", "ballast, fin_trim")
    )
    assert alone["trim_moment"].observed
    assert not beside["trim_moment"].observed or beside["trim_moment"].bound > 10.0 * alone["trim_moment"].bound
