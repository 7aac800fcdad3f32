"""Verdicts on numbers made by hand."""

import pytest

from auvid_cli.validation.prediction_errors import prediction_checks
from auvid_cli.validation.results import AHEAD, Prediction


def row(
    signal="r", horizon=1.0, rmse=0.02, prior=1.0, unchanged=0.5, share=0.95, expected=0.01, count=100, independent=60.0
):
    errors = 90.0, rmse, prior, None, unchanged, expected
    return Prediction(signal, "rad/s", AHEAD, horizon, count, 0.01, *errors, share, 50, 0, independent)


def check_of(check, rows, excursion=None, nis=None, status="completed"):
    checks = prediction_checks("ckf", rows, excursion or {"u": 1.0}, nis or {"dvl": 1.0}, status)
    (found,) = [candidate for candidate in checks if candidate.check == check]
    return found


def test_a_better_model_passes():
    checks = prediction_checks("ckf", [row()], {"u": 1.0}, {"dvl": 1.0}, "completed")
    assert len(checks) == 7
    assert all(check.passed for check in checks)


def test_worse_than_constant_velocity_over_the_horizons_fails():
    verdict = check_of("better than constant velocity", [row(), row("v", 5.0, rmse=0.5), row("v", 10.0, rmse=2.0)])
    assert verdict.passed is False
    assert verdict.statistic == "v 2 times"  # geometric mean of 1 and 4


def test_one_bad_horizon_among_good_ones_passes():
    rows = [*(row("u", horizon, rmse=0.1) for horizon in (1.0, 5.0, 10.0, 20.0)), row("u", 50.0, rmse=1.0)]
    assert check_of("better than constant velocity", rows).passed is True


def test_errors_of_noise_are_not_compared():
    rows = [row(), row("v", rmse=0.025, unchanged=0.02)]
    assert check_of("better than constant velocity", rows).passed is True
    only = check_of("better than constant velocity", rows[1:])
    assert (only.passed, only.statistic) == (None, "-")


@pytest.mark.parametrize(("rmse", "passed"), [(0.9, True), (1.2, False), (None, False)])
def test_worse_than_prior_fails(rmse, passed):
    assert check_of("better than the prior", [row(rmse=rmse, unchanged=2.0)]).passed is passed


def test_diverged_prior_is_not_compared():
    assert check_of("better than the prior", [row(prior=None)]).passed is None


def test_errors_beyond_the_band_fail():
    verdict = check_of("uncertainty not too small", [row(), row("v", share=0.5), row("v", 5.0, share=0.2)])
    assert (verdict.passed, verdict.statistic) == (False, "v at 5 s 20 %")
    assert check_of("uncertainty not too small", [row(), row("v", share=0.5, count=20)]).passed is True


def test_diverged_model_without_band_fails():
    verdict = check_of("uncertainty not too small", [row(), row("q", 50.0, share=None, expected=None)])
    assert (verdict.passed, verdict.statistic) == (False, "q at 50 s 0 %")
    unknown = row("q", 50.0, share=None, expected=None)._replace(draws=0)
    assert check_of("uncertainty not too small", [row(), unknown]).passed is True


def test_too_wide_band_fails():
    rows = [row(share=1.0), row("v", share=1.0, expected=0.05), row("v", 5.0, share=0.98, expected=0.05)]
    assert check_of("uncertainty not too large", rows[:1]).passed is True
    assert check_of("uncertainty not too large", rows).passed is True
    verdict = check_of("uncertainty not too large", rows[:2])
    assert (verdict.passed, verdict.statistic) == (False, "v 100 %")


def test_wide_band_with_few_independent_errors_passes():
    rows = [row("v", horizon, share=1.0, expected=0.05, independent=50.0) for horizon in (1.0, 5.0)]
    assert check_of("uncertainty not too large", rows).passed is True
    one_says_enough = [*rows, row("v", 10.0, share=1.0, expected=0.05)]
    assert check_of("uncertainty not too large", one_says_enough).passed is False


def test_unstable_run_and_incomplete_filter_fail():
    assert check_of("stable", [row()], excursion={"u": 1.0, "phi": float("inf")}).passed is False
    assert check_of("filter completed", [row()], status="diverged at t = 3 s").passed is False


def test_large_nis_is_noted():
    verdict = check_of("NIS", [row()], nis={"dvl": 2.0, "gyroscope": 1.0})
    assert (verdict.passed, verdict.statistic) == (None, "dvl 2")
