"""Errors of the coefficients on estimates whose errors are known by hand."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.evaluation.accuracy import (
    average_steady_state_error,
    coefficient_results,
    normalised_estimation_error,
    one_speed_remarks,
    steady_part,
)
from auvid_cli.evaluation.judgement import Grade, Judgement

SOUND = Judgement(Grade.SOUND)


def test_rmse_counts_the_whole_run_from_zero(hand_made, truth_of):
    estimate = hand_made([0, 1, 2, 3], {"Y_url": [0.0, 3.0, 5.0, 4.0]})
    (result,) = coefficient_results(estimate, truth_of(Y_url=4.0), {}, SOUND)
    # Errors -4, -1, 1, 0.
    assert result.rmse == pytest.approx(np.sqrt(18 / 4))
    assert (result.estimate, result.true, result.standard_deviation) == (4.0, 4.0, 0.25)
    assert (result.filter, result.coefficient, result.unit) == ("tukf", "Y_url", "kg/rad")


def test_steady_state_error_is_that_of_the_mean_over_the_last_tenth_of_the_time(hand_made, truth_of):
    time = np.arange(101.0)
    course = np.where(time >= 90, -7.0, 1000.0)
    course[time >= 95] = -11.0
    estimate = hand_made(time, {"N_uudr": course})
    (result,) = coefficient_results(estimate, truth_of(N_uudr=-10.0), {}, SOUND)
    # Five events at -7 and six at -11: their mean is -101/11.
    assert result.steady_state_error_percent == pytest.approx(100 * (10 - 101 / 11) / 10)


def test_errors_that_cancel_leave_no_steady_state_error(hand_made, truth_of):
    time = np.arange(101.0)
    course = np.full(101, 2.0)
    course[91:] = 2.0 + np.tile([0.5, -0.5], 5)
    (result,) = coefficient_results(hand_made(time, {"Y_uvl": course}), truth_of(Y_uvl=2.0), {}, SOUND)
    assert result.steady_state_error_percent == pytest.approx(0.0, abs=1e-12)
    assert result.rmse == pytest.approx(np.sqrt(10 * 0.25 / 101))


def test_the_last_tenth_is_one_of_time_not_of_events(hand_made):
    time = np.concatenate([np.linspace(10.0, 100.0, 5), np.linspace(101.0, 110.0, 50)])
    steady = steady_part(hand_made(time, {"Y_url": np.zeros(55)}))
    assert time[steady][0] == 100.0


def test_a_true_zero_has_no_relative_error(hand_made, truth_of):
    (result,) = coefficient_results(hand_made([0, 1], {"Y_r|r|": [0.0, 2.0]}), truth_of(), {}, SOUND)
    assert result.steady_state_error_percent is None
    assert result.rmse == pytest.approx(np.sqrt(2.0))


def test_without_truth_there_are_estimates_but_no_errors(hand_made):
    (result,) = coefficient_results(hand_made([0, 1], {"Y_url": [0.0, 2.0]}), None, {}, SOUND)
    assert (result.true, result.rmse, result.steady_state_error_percent) == (None, None, None)
    assert result.estimate == 2.0


def test_after_divergence_there_are_no_errors(hand_made, truth_of):
    estimate = hand_made([0, 1], {"Y_url": [0.0, 2.0]}, status="diverged at t = 2.000 s: why")
    (result,) = coefficient_results(estimate, truth_of(Y_url=1.0), {"Y_url": 0.1}, SOUND)
    assert (result.rmse, result.steady_state_error_percent) == (None, None)
    assert result.times_bound is None
    assert not result.identified


def test_only_coefficients_have_results_in_the_order_of_the_state(hand_made, truth_of):
    estimate = hand_made([0, 1], {"Y_url": [0, 1], "N_url": [0, 2], "X_u|u|": [0, 3]})
    assert [r.coefficient for r in coefficient_results(estimate, truth_of(), {}, SOUND)] == [
        "Y_url",
        "N_url",
        "X_u|u|",
    ]


def test_the_average_is_over_those_that_have_an_error(hand_made, truth_of):
    estimate = hand_made([0, 1], {"Y_url": [0, 1.1], "N_url": [0, 2.0], "Y_r|r|": [0, 3.0]})
    results = coefficient_results(estimate, truth_of(Y_url=1.0, N_url=4.0), {}, SOUND)
    assert average_steady_state_error(results) == pytest.approx((10.0 + 50.0) / 2)
    assert average_steady_state_error(coefficient_results(estimate, None, {}, SOUND)) is None


def test_what_is_known_to_a_fifth_of_its_value_is_identified(hand_made, truth_of):
    """By the standard deviation of 0.25 that the estimates here state, and by the bound."""
    symbols = ("Y_url", "N_url", "N_uvl", "Z_uql")
    # A wrong estimate is no better known for being large.
    estimate = hand_made([0, 1], {symbol: [0.0, 100.0] for symbol in symbols})
    bounds = dict(zip(symbols, (0.1, 0.1, 1.1, np.inf), strict=True))
    results = coefficient_results(estimate, truth_of(Y_url=1.3, N_url=1.2, N_uvl=5.0, Z_uql=5.0), bounds, SOUND)
    assert [result.identified for result in results] == [True, False, False, False]
    assert [result.cramer_rao_bound for result in results] == [0.1, 0.1, 1.1, np.inf]
    assert [result.times_bound for result in results[:3]] == pytest.approx([2.5, 2.5, 0.25 / 1.1])
    assert results[3].times_bound is None


def test_what_is_claimed_is_the_corrected_standard_deviation_and_identified_goes_by_the_total(hand_made, truth_of):
    estimate = replace(hand_made([0, 1], {"Y_url": [0.0, 1.3], "N_url": [0.0, 1.3]}), corrected={"Y_url": 0.5})
    corrected, nominal = coefficient_results(
        estimate, truth_of(Y_url=1.3, N_url=1.3), {"Y_url": 0.1, "N_url": 0.1}, SOUND
    )
    assert (corrected.times_bound, nominal.times_bound) == (pytest.approx(5.0), pytest.approx(2.5))
    assert (corrected.standard_deviation, corrected.corrected_standard_deviation) == (0.25, 0.5)
    assert nominal.corrected_standard_deviation is None
    assert [corrected.identified, nominal.identified] == [False, True]


def test_a_true_zero_is_identified_by_the_natural_magnitude_of_the_vehicle(hand_made, truth_of):
    """Of Y_url that is 46 kg/rad: 3 rho/2 d^2 L/2 of the shipped vehicle."""
    estimate = hand_made([0, 1], {"Y_url": [0.0, 0.1]})
    size = estimate.experiment.vehicle.size
    natural = 3.0 * 0.5 * size.density * size.diameter**2 * 0.5 * size.length
    for bound, identified in ((0.19 * natural, True), (0.21 * natural, False)):
        (result,) = coefficient_results(estimate, truth_of(), {"Y_url": bound}, SOUND)
        assert result.identified is identified


def test_without_a_bound_the_standard_deviation_decides(hand_made):
    estimate = hand_made([0, 1], {"Y_url": [0.0, 1.3], "N_url": [0.0, -1.2]})
    results = coefficient_results(estimate, None, {}, SOUND)
    assert [result.identified for result in results] == [True, False]
    assert all(result.cramer_rao_bound is result.times_bound is None for result in results)


def test_a_covariance_that_claims_to_know_a_combination_exactly_is_infinitely_wrong(hand_made, truth_of):
    estimate = hand_made([0.0, 1.0], {"Y_url": [0.0, 3.0], "Y_uvl": [0.0, 5.0]})
    estimate.covariance[:] = 1.0
    assert normalised_estimation_error(estimate, truth_of(Y_url=4.0, Y_uvl=4.0)) == np.inf


@pytest.mark.parametrize(("spread", "is_said"), [(0.0, True), (0.04, True), (0.06, False)])
def test_drag_at_one_speed_is_effective_at_that_speed(spread, is_said, hand_made):
    time = np.arange(100.0)
    estimate = hand_made(time, {"X_u|u|": np.full(100, -5.0)})
    # Two values a standard deviation above and below the mean.
    estimate.mean[:, estimate.state.index("u")] = 1.5 * (1.0 + spread * (-1.0) ** time)
    (said,) = one_speed_remarks(estimate) or [""]
    assert ("effective at U = 1.5 m/s" in said) == is_said


def test_drag_that_is_held_needs_no_remark(hand_made):
    assert one_speed_remarks(hand_made([0, 1], {"Y_url": [0.0, 3.0]})) == []
