"""What estimates are held against."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.filter_name import FilterName
from auvid_cli.evaluation.bounds import Bounds, cramer_rao_bounds, joint_deviation
from auvid_cli.evaluation.checks import check_estimate, failed
from auvid_cli.identification.fisher import information_at
from auvid_cli.vehicle.coefficients import SYMBOLS


@pytest.fixture
def ckf(short_estimates):
    return short_estimates[FilterName.CKF]


def test_with_truth_the_bound_is_one_for_all_and_that_of_the_true_motion(short_run, short_estimates):
    bounds = cramer_rao_bounds(short_run, list(short_estimates.values()))
    assert list(bounds) == [name.value for name in short_estimates]
    assert all(found == bounds["ckf"] for found in bounds.values())
    truth = short_run.truth
    at_start = truth.motion[np.argmin(np.abs(truth.time - short_estimates[FilterName.CKF].time[0]))]
    assert bounds["ckf"].by_symbol == information_at(short_run, truth.coefficients, at_start).bound()
    assert set(SYMBOLS) < set(bounds["ckf"].by_symbol)


def test_without_truth_it_is_that_of_each_estimate_and_nearly_the_same(short_run, short_estimates):
    estimates = [short_estimates[FilterName.CKF], short_estimates[FilterName.OUTPUT_ERROR]]
    with_truth = cramer_rao_bounds(short_run, estimates)["ckf"].by_symbol
    bounds = cramer_rao_bounds(short_run.without_truth(), estimates)
    assert bounds["ckf"] != bounds["output_error"]
    for found in bounds.values():
        ratio = [found.by_symbol[symbol] / with_truth[symbol] for symbol in SYMBOLS]
        assert np.abs(np.log(ratio)).max() < 0.2


def test_the_settings_are_those_of_the_estimate_and_an_earlier_one_is_not_looked_up(short_run, ckf):
    settings = ckf.experiment.identification
    prior = settings.prior.model_copy(update={"from_estimate": "no such file.h5"})
    changed = settings.model_copy(update={"prior": prior, "coefficients": ("X_u|u|", "N_url")})
    estimate = replace(ckf, experiment=ckf.experiment.model_copy(update={"identification": changed}))
    few, all_of_them = (cramer_rao_bounds(short_run, [e])["ckf"].by_symbol for e in (estimate, ckf))
    assert few.keys() & set(SYMBOLS) == {"X_u|u|", "N_url"}
    assert few["N_url"] < all_of_them["N_url"]


def test_coefficients_that_make_no_model_have_no_bound_and_fail_the_check(short_run, ckf):
    ckf = replace(ckf, mean=ckf.mean.copy())
    ckf.mean[-1, ckf.state.index("X_u|u|")] = 1e6
    dataset = short_run.without_truth()
    bounds = cramer_rao_bounds(dataset, [ckf])["ckf"]
    assert bounds.by_symbol == {}
    assert "blows up" in bounds.remark
    assert "bound" in {check.check for check in failed(check_estimate(dataset, ckf, bounds))}


@pytest.mark.parametrize(("share", "failing", "noted"), [(1.0, False, False), (0.5, True, False), (4.0, False, True)])
def test_standard_deviations_are_checked_against_the_least_that_are_possible(short_run, ckf, share, failing, noted):
    places = [ckf.state.index(symbol) for symbol in SYMBOLS]
    known = {symbol: ckf.standard_deviation[-1, i] for symbol, i in zip(SYMBOLS, places, strict=True)}
    # Priors are so wide that they do not count.
    bounds = Bounds({symbol: deviation / share for symbol, deviation in known.items()})
    checks = {check.check: check.passed for check in check_estimate(short_run, ckf, bounds)}
    assert checks["not below the bound"] is not failing
    assert checks["near the bound"] is (None if noted else True)


def test_data_and_prior_add_their_information():
    assert joint_deviation(3.0, 4.0) == pytest.approx(2.4)
    assert joint_deviation(np.inf, 4.0) == 4.0
    assert joint_deviation(3.0, np.inf) == 3.0
    assert joint_deviation(np.inf, np.inf) == np.inf
