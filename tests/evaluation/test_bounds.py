"""What estimates are held against."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.evaluation.bounds import (
    Bounds,
    BoundsOf,
    bounds_at,
    bounds_with_process_noise,
    information_with_process_noise,
    probable_motion,
    true_motion,
)
from auvid_cli.evaluation.estimate_checks import check_estimate
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.identification.information import information_at
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.run import identify
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.coefficients import SYMBOLS


@pytest.fixture
def ckf(short_estimates):
    return short_estimates[FilterName.CKF]


def with_identification(estimate, **changes):
    """The same estimate with other settings, as if it had been made with them."""
    settings = estimate.experiment.identification.model_copy(update=changes)
    return replace(estimate, experiment=estimate.experiment.model_copy(update={"identification": settings}))


@pytest.mark.slow
def test_with_truth_the_bound_is_one_for_all_and_that_of_the_true_motion(short_run, short_estimates):
    prepared = prepare(short_run)
    bounds_of = BoundsOf(prepared)
    bounds = {name: bounds_of(estimate).of_data for name, estimate in short_estimates.items()}
    assert all(bound is bounds[FilterName.CKF] for bound in bounds.values())
    truth = short_run.truth
    at_start = truth.motion[np.argmin(np.abs(truth.time - short_estimates[FilterName.CKF].time[0]))]
    assert (
        bounds[FilterName.CKF]
        == information_at(prepared, truth.coefficients, [at_start], true_motion(prepared)).bound()
    )
    assert set(SYMBOLS) < set(bounds[FilterName.CKF])


@pytest.mark.slow
def test_without_truth_it_is_that_of_each_estimate_and_nearly_the_same(short_run, short_estimates):
    with_truth = BoundsOf(prepare(short_run))(short_estimates[FilterName.CKF]).of_data
    bounds_of = BoundsOf(prepare(short_run.without_truth()))
    of_estimates = [bounds_of(short_estimates[name]).of_data for name in (FilterName.CKF, FilterName.OUTPUT_ERROR)]
    assert of_estimates[0] != of_estimates[1]
    for bounds in of_estimates:
        ratio = [bounds[symbol] / with_truth[symbol] for symbol in SYMBOLS]
        assert np.abs(np.log(ratio)).max() < 0.2


@pytest.mark.slow
def test_without_truth_it_goes_along_the_measured_motion_where_a_free_one_would_leave_it():
    """Left to itself a vehicle that is unstable in open loop would be promised a fifth of one bound."""
    doublets = "manoeuvre=manoeuvres/doublets.yaml", "manoeuvre.speed=1.54 m/s", "manoeuvre.duration=60 s"
    dataset = simulate(load_experiment(find_experiment("remus100"), [*doublets, "sensors.attitude.source=direct"]))
    known = dataset.known_coefficients()
    bounds, measured = (bounds_at(prepare(data), known).of_data for data in (dataset, dataset.without_truth()))
    assert_allclose([measured[symbol] for symbol in SYMBOLS], [bounds[symbol] for symbol in SYMBOLS], rtol=0.02)


@pytest.mark.slow
def test_without_process_noise_the_bound_with_it_is_that_of_the_free_motion(simulated_with):
    """From another algorithm: a smoother's posterior less its prior, against sensitivities of the free motion."""
    dataset = simulated_with(
        "manoeuvre.duration=30 s",
        "sensors.attitude={source: direct, rate: 20 Hz}",
        "sensors.gyroscope.rate=20 Hz",
        "identification.process_noise={velocity: 1e-9, rate: 1e-9, attitude: 1e-9}",
    )
    prepared, smoother = prepare(dataset), identify(dataset, FilterName.SMOOTHER)
    bounds = bounds_with_process_noise(prepared, smoother)
    free = information_at(prepared, smoother.final_coefficients()).bound()
    assert np.abs(np.log([bounds[symbol] / free[symbol] for symbol in SYMBOLS])).max() < 0.02


@pytest.mark.slow
def test_before_any_estimate_the_bound_with_process_noise_is_that_of_the_smoother(short_run, short_estimates):
    prepared, smoother = prepare(short_run), short_estimates[FilterName.SMOOTHER]
    about = probable_motion(prepared, smoother.final_coefficients())
    assert about is not None
    before = information_with_process_noise(about)
    after, bound = bounds_with_process_noise(prepared, smoother), before.bound()
    assert np.abs(np.log([bound[symbol] / after[symbol] for symbol in SYMBOLS])).max() < 0.05
    few = before.bound(held=[symbol for symbol in SYMBOLS if symbol not in ("N_url", "N_uudr")])
    assert few.keys() == {"N_url", "N_uudr"}
    assert all(few[symbol] < bound[symbol] for symbol in few)


@pytest.mark.slow
def test_beside_a_current_that_is_sought_it_is_promised_what_an_estimate_then_has(simulated_with):
    """Without the current what that does looks like slip, which would tell of coefficients that nothing moves."""
    dataset = simulated_with(
        "manoeuvre=manoeuvres/zigzag_20_20.yaml",
        "manoeuvre.duration=60 s",
        *("manoeuvre.current_north=0.15 m/s", "manoeuvre.current_east=-0.2 m/s"),
        *("sensors.attitude={source: direct, rate: 20 Hz}", "sensors.gyroscope.rate=20 Hz"),
        *("sensors.dvl.noise=1 cm/s", "identification.integration_step=0.05 s"),
        "identification.coefficients=[X_u|u|, Y_url, Y_uvl, N_url, N_uvl, Y_uudr, N_uudr]",
        "identification.estimate={biases: [current, thrust, fin_trim], current: {walk: 0 m/s/s^0.5}}",
        "identification.process_noise={velocity: 1e-3, rate: 1e-3}",
    )
    prepared, smoother = prepare(dataset), identify(dataset, FilterName.SMOOTHER)
    after = bounds_with_process_noise(prepared, smoother)
    about = probable_motion(prepared, dataset.truth.coefficients)
    before = information_with_process_noise(about).bound()
    assert np.abs(np.log([before[symbol] / after[symbol] for symbol in after])).max() < 0.2
    layout, parameters = about.augmented.layout, about.filtered.trajectory.parameters
    known = layout.symbols[: parameters.size]
    found = dict(zip(known, parameters * layout.scale[: parameters.size], strict=True))
    assert (found["current_north"], found["current_east"]) == pytest.approx((0.15, -0.2), abs=0.01)


@pytest.mark.slow
def test_process_noise_leaves_less_to_be_said_and_no_measurement_nothing(short_run, short_estimates):
    prepared, smoother = prepare(short_run), short_estimates[FilterName.SMOOTHER]
    bounds = bounds_with_process_noise(prepared, smoother)
    free = BoundsOf(prepared)(smoother).of_data
    assert all(bounds[symbol] > 0.98 * free[symbol] for symbol in SYMBOLS)
    problem = augmented_problem(prepared)
    scale = problem.layout.scale[:, None]
    ignorant = replace(smoother, covariance=(scale * problem.prior.factor) @ (scale * problem.prior.factor).T)
    assert set(bounds_with_process_noise(prepared, ignorant).values()) == {np.inf}


def test_with_the_prior_it_is_that_of_both_informations_together(simulated_with, ckf):
    """On 10 s of data the prior on one coefficient helps others a good deal; checked with plain matrices."""
    dataset = simulated_with("manoeuvre.duration=10 s")
    estimate = replace(ckf, experiment=dataset.experiment)
    bounds = BoundsOf(prepare(dataset))(estimate)
    start = dataset.truth.motion[np.argmin(np.abs(dataset.truth.time - 0.01))]
    information = information_at(prepare(dataset), dataset.truth.coefficients, [start], true_motion(prepare(dataset)))
    prior = augmented_problem(prepare(dataset)).prior
    total = information.total.factor.T @ information.total.factor + np.linalg.inv(prior.factor @ prior.factor.T)
    expected = information.scale * np.sqrt(np.diag(np.linalg.inv(total)))
    assert_allclose([bounds.with_prior[symbol] for symbol in information.state], expected, rtol=1e-6)
    alone = np.array([bounds.of_data[symbol] for symbol in SYMBOLS]), information.scale[: len(SYMBOLS)]
    each_alone = 1.0 / np.hypot(1.0 / alone[0], 1.0 / alone[1])
    assert np.min(np.array([bounds.with_prior[s] for s in SYMBOLS]) / each_alone) < 0.8


def test_the_prior_counts_for_the_output_error_method_only_if_it_was_used(short_run, short_estimates):
    bounds_of, estimate = BoundsOf(prepare(short_run)), short_estimates[FilterName.OUTPUT_ERROR]
    assert bounds_of(estimate).with_prior == bounds_of(estimate).of_data
    settings = estimate.experiment.identification.output_error.model_copy(update={"use_prior": True})
    used = bounds_of(with_identification(estimate, output_error=settings))
    assert used.with_prior != used.of_data


def test_the_settings_are_those_of_the_estimate_and_an_earlier_one_is_not_looked_up(short_run, ckf):
    prior = ckf.experiment.identification.prior.model_copy(update={"from_estimate": "no such file.h5"})
    bounds_of = BoundsOf(prepare(short_run))
    few = bounds_of(with_identification(ckf, prior=prior, coefficients=("X_u|u|", "N_url")))
    assert few.of_data.keys() & set(SYMBOLS) == {"X_u|u|", "N_url"}
    assert few.of_data["N_url"] < bounds_of(ckf).of_data["N_url"]
    assert few.with_prior == {}


def test_coefficients_whose_model_diverges_have_no_bound_and_that_is_said(short_run, ckf):
    ckf = replace(ckf, mean=ckf.mean.copy())
    ckf.mean[-1, ckf.state.index("X_u|u|")] = 1e6
    dataset = short_run.without_truth()
    bounds = BoundsOf(prepare(dataset))(ckf)
    assert bounds.of_data == bounds.with_prior == {}
    assert "diverges" in bounds.remark
    (check,) = (
        check
        for check in check_estimate(prepare(dataset), ckf, bounds, judge_one(ckf, None), [])
        if check.check == "bound"
    )
    assert check.passed is None
    assert "diverges" in check.advice


@pytest.fixture(scope="module")
def unstable_run():
    """300 s of a vehicle that is unstable in open loop."""
    slow = "sensors.attitude={source: direct, rate: 20 Hz}", "sensors.gyroscope.rate=20 Hz"
    return simulate(load_experiment(find_experiment("dive"), (*slow, "manoeuvre.input_rate=20 Hz")))


@pytest.fixture(scope="module")
def of_unstable_run(unstable_run):
    return assess_dataset(unstable_run)


@pytest.mark.slow
def test_a_motion_too_unstable_for_sensitivities_is_judged_as_long_as_they_hold(unstable_run, of_unstable_run):
    """More data cannot say less; after 300 s this vehicle's seem to say nothing at all."""
    identifiability = of_unstable_run
    assert "unstable in open loop" in identifiability.remark
    assert identifiability.growth[-1][0] < 200.0
    assert all(bound.cramer_rao_bound < np.inf for bound in identifiability.bounds)
    estimate = identify(unstable_run, FilterName.CKF)
    bounds = BoundsOf(prepare(unstable_run))(estimate)
    assert bounds.of_data == {}
    assert "unstable in open loop" in bounds.remark


@pytest.mark.slow
def test_in_segments_that_are_short_enough_it_is_judged_to_the_end(unstable_run, of_unstable_run, with_settings):
    whole, short = of_unstable_run, "identification.use.spans=[[0, 100], [100.5, 200], [200.5, 300]]"
    cut = assess_dataset(with_settings(unstable_run, short))
    assert cut.remark == ""
    assert cut.growth[-1][0] > 298.0
    assert np.median(cut.growth[-1][1]) < np.median(whole.growth[-1][1])
    lost = assess_dataset(with_settings(unstable_run, "identification.use.spans=[[0, 100], [101, 300]]"))
    assert "unstable in open loop" in lost.remark
    assert 100.0 < lost.growth[-1][0] < 298.0


@pytest.mark.slow
@pytest.mark.parametrize(("share", "failing", "noted"), [(1.0, False, False), (0.5, True, False), (4.0, False, True)])
def test_standard_deviations_are_checked_against_the_least_that_are_possible(short_run, ckf, share, failing, noted):
    places = [ckf.state.index(symbol) for symbol in SYMBOLS]
    known = {symbol: ckf.standard_deviation[-1, i] / share for symbol, i in zip(SYMBOLS, places, strict=True)}
    checks = {
        check.check: check.passed
        for check in check_estimate(prepare(short_run), ckf, Bounds({}, known), judge_one(ckf, None), [])
    }
    assert checks["not below the bound"] is not failing
    assert checks["near the bound"] is (None if noted else True)


def test_a_fit_that_ends_at_a_limit_is_no_estimate_and_that_is_said(short_run, short_estimates):
    estimate = short_estimates[FilterName.OUTPUT_ERROR]
    place = estimate.state.index("N_uvl")
    value, deviation = estimate.mean[-1, place], estimate.standard_deviation[-1, place]
    for upper, passed in ((value + 1e-6 * deviation, False), (value + 0.5 * deviation, True)):
        settings = estimate.experiment.identification.output_error.model_copy(
            update={"bounds": {"N_uvl": (0.0, upper)}}
        )
        limited = with_identification(estimate, output_error=settings)
        checks = {
            check.check: check.passed
            for check in check_estimate(prepare(short_run), limited, Bounds({}, {}), judge_one(limited, None), [])
        }
        assert checks["within its limits"] is passed


def test_with_an_earlier_estimate_the_information_is_what_was_added_to_it(short_run, ckf):
    prior = ckf.experiment.identification.prior.model_copy(update={"from_estimate": "earlier.h5"})
    estimate = with_identification(ckf, prior=prior)
    nothing_new = replace(estimate, standard_deviation=np.repeat(estimate.standard_deviation[-1:], 6360, axis=0))
    for one, passed in ((estimate, True), (nothing_new, False)):
        checks = {
            check.check: check.passed
            for check in check_estimate(prepare(short_run), one, Bounds({}, {}), judge_one(one, None), [])
        }
        assert checks["information"] is passed


def test_of_a_diverged_estimate_nothing_is_said_of_the_coefficients(short_run, ckf):
    diverged = replace(ckf, status="diverged at t = 1 s: why")
    judgement, prepared = judge_one(diverged, None), prepare(short_run)
    checks = check_estimate(prepared, diverged, BoundsOf(prepared)(diverged), judgement, [])
    # But for that.
    assert [check.check for check in checks if check.subject == "coefficients"] == ["sound"]
