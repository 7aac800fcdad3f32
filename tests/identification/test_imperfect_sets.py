"""Data that lack what a laboratory has: depth instead of rates, a DVL in a current."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.evaluation.accuracy import average_steady_state_error, coefficient_results
from auvid_cli.evaluation.judgement import Grade, Judgement, status_of
from auvid_cli.identification.run import identify

SOUND = Judgement(Grade.SOUND)

DIRECT = "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg}"
DEPTH = "sensors.depth={rate: 10 Hz, noise: 0.02 m}"
CURRENT = "manoeuvre.current_north=0.2 m/s", "manoeuvre.current_east=-0.15 m/s"


def without(dataset, *names):
    return replace(dataset, sensors={name: record for name, record in dataset.sensors.items() if name not in names})


def average_error(dataset, estimate):
    return average_steady_state_error(coefficient_results(estimate, dataset.truth, {}, SOUND))


@pytest.fixture(scope="module")
def with_depth(simulated_with):
    return simulated_with("manoeuvre.duration=60 s", DIRECT, DEPTH, "sensors.gyroscope.rate=100 Hz")


@pytest.mark.slow
def test_depth_is_a_state_where_it_is_measured(with_depth, filter_name):
    estimate = identify(with_depth, filter_name)
    assert status_of(estimate) == "completed"
    assert estimate.state[-1] == "down"
    true = np.interp(estimate.time, with_depth.truth.time, with_depth.truth.position[:, 2])
    error = (estimate.mean[:, -1] - true)[100:]
    assert np.abs(error).max() < 0.1
    assert (np.abs(error) < 4.0 * estimate.standard_deviation[100:, -1]).all()


def test_depth_and_pitch_replace_a_dvl(with_depth):
    """The speed then follows from how fast it sinks, and from nothing without the depth."""
    silent = without(with_depth, "dvl")
    with_it, without_it = (identify(data, FilterName.CKF) for data in (silent, without(silent, "depth")))
    known = [e.standard_deviation[-1, e.state.index("u")] for e in (with_it, without_it)]
    assert known[0] < 0.3 * known[1]


@pytest.fixture(scope="module")
def drifting(simulated_with):
    return simulated_with("manoeuvre.duration=60 s", DIRECT, *CURRENT)


@pytest.mark.slow
def test_estimated_current_does_not_bias_drag(drifting, with_settings):
    """By the EKF from a narrow prior only: an unsure current makes for unsure speeds, and the model is nonlinear."""
    factor, name = 0.3, FilterName.EKF
    blind = identify(with_settings(drifting, f"identification.prior.factor={factor}"), name)
    settings = "identification.estimate.biases=[current]", "identification.estimate.current.walk=0"
    seeing = identify(with_settings(drifting, f"identification.prior.factor={factor}", *settings), name)
    assert status_of(blind).startswith("inconsistent")
    assert status_of(seeing) == "completed"
    for symbol, true in (("current_north", 0.2), ("current_east", -0.15)):
        i = seeing.state.index(symbol)
        assert abs(seeing.mean[-1, i] - true) < 4.0 * seeing.standard_deviation[-1, i]
        assert seeing.standard_deviation[-1, i] < 0.001
    assert average_error(drifting, seeing) < 0.3 * average_error(drifting, blind)


@pytest.mark.slow
def test_ignored_current_makes_the_filter_inconsistent(drifting, with_settings, kalman_filter):
    estimate = identify(with_settings(drifting, "identification.estimate.biases=[current]"), kalman_filter)
    error = average_error(drifting, estimate)
    assert status_of(estimate).startswith("inconsistent") or error < 1.0


def test_a_current_carries_the_vehicle_away(simulated_with):
    still, drifting = (simulated_with("manoeuvre.duration=10 s", *current) for current in ((), CURRENT))
    apart = drifting.truth.position - still.truth.position
    assert np.allclose(apart, still.truth.time[:, None] * [0.2, -0.15, 0.0], atol=1e-12)


@pytest.mark.parametrize("missing", [("gyroscope",), ("gyroscope", "accelerometer", "magnetometer")])
def test_without_a_gyroscope_and_without_roll_coefficients_are_found(with_depth, missing):
    """Data of a compass, a pressure gauge and a DVL."""
    attitude = with_depth.sensors["attitude"]
    no_roll = attitude.values.copy()
    no_roll[:, 0] = np.nan
    poor = without(with_depth, *missing)
    poor = replace(poor, sensors=poor.sensors | {"attitude": replace(attitude, values=no_roll)})
    estimate = identify(poor, FilterName.CKF)
    assert status_of(estimate) == "completed"
    rows = {row.coefficient: row for row in coefficient_results(estimate, with_depth.truth, {}, SOUND)}
    for symbol in ("X_u|u|", "N_uudr", "Y_uudr", "M_uude"):
        row = rows[symbol]
        assert abs(row.estimate - row.true) < 4.0 * row.standard_deviation, symbol


@pytest.mark.slow
def test_the_gain_of_a_propeller_is_found(with_depth, with_settings, kalman_filter):
    """The mass is known, so the coast and the steps of the thrust tell force from drag."""
    inputs = with_depth.inputs
    weaker = replace(with_depth, inputs=replace(inputs, values=inputs.values / [1.0, 1.0, 1.2, 1.0]))
    blind = identify(weaker, kalman_filter)
    seeing = identify(with_settings(weaker, "identification.estimate.biases=[thrust]"), kalman_filter)
    assert status_of(seeing) == "completed"
    assert seeing.final_actuators().thrust == pytest.approx(1.2, rel=0.01)
    wrong, right = (
        {r.coefficient: r for r in coefficient_results(e, with_depth.truth, {}, SOUND)} for e in (blind, seeing)
    )
    drag = right["X_u|u|"]
    assert abs(drag.estimate - drag.true) < 4.0 * drag.standard_deviation
    assert abs(drag.estimate - drag.true) < 0.1 * abs(wrong["X_u|u|"].estimate - drag.true)
