"""Estimates from a dataset: consistency, missing data, chunks, and status."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import ConfigError
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.evaluation.judgement import status_of
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.run import identify, set_up_filters
from auvid_cli.identification.timeline import Timelines
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS


def with_sensor(dataset, name, **changes):
    return replace(dataset, sensors=dataset.sensors | {name: replace(dataset.sensors[name], **changes)})


def is_sound(estimate):
    """Completed, finite, and with a positive-definite covariance at the end.

    Without process noise a fit's last motion follows from the coefficients alone: its covariance may be singular.
    """
    least = -1e-12 if estimate.filter == "output_error" else 0.0
    scale = 1.0 / estimate.standard_deviation[-1]
    smallest = np.linalg.eigvalsh(estimate.covariance * np.outer(scale, scale)).min()
    finite = np.isfinite(estimate.mean).all() and np.isfinite(estimate.standard_deviation).all()
    return estimate.status == "completed" and finite and smallest > least


def relative_errors(estimate, truth):
    """Return the relative error of each coefficient at the end."""
    final = estimate.final_coefficients()
    return np.array([abs(final[symbol] / truth.coefficients[symbol] - 1.0) for symbol in SYMBOLS])


def distance_in_deviations(estimate, truth):
    """Largest distance of a coefficient from the truth at the end, in its own standard deviations."""
    true = np.array([truth.coefficients[symbol] for symbol in SYMBOLS])
    return np.abs((estimate.mean[-1, :N_COEFFICIENTS] - true) / estimate.standard_deviation[-1, :N_COEFFICIENTS]).max()


@pytest.fixture(scope="module")
def long_run(simulated_with):
    """A fifth of the default spiral, 60 s, with all measurements."""
    rates = "manoeuvre.input_rate=100 Hz", "sensors.gyroscope.rate=100 Hz", "sensors.attitude.rate=100 Hz"
    return simulated_with("manoeuvre.duration=60 s", *rates)


def in_chunks_of(measurements):
    """Return a replacement of `Timelines` with another chunk length."""
    return lambda inputs, measuring, start, step: Timelines(inputs, measuring, start, step, measurements)


def assert_same(a, b):
    assert np.array_equal(a.mean, b.mean)
    assert np.array_equal(a.covariance, b.covariance)
    assert a.status == b.status


def test_estimates_find_the_coefficients(short_run, short_estimates, filter_name):
    estimate = short_estimates[filter_name]
    assert is_sound(estimate)
    errors = relative_errors(estimate, short_run.truth)
    assert np.median(errors) < 0.05
    assert errors.max() < 0.5


def test_estimates_are_consistent(short_run, short_estimates, filter_name):
    assert distance_in_deviations(short_estimates[filter_name], short_run.truth) < 5.0


def test_estimates_start_at_zero_with_the_prior(short_estimates, kalman_filter):
    first = short_estimates[kalman_filter]
    assert np.abs(first.mean[0, :N_COEFFICIENTS] / first.standard_deviation[0, :N_COEFFICIENTS]).max() < 3.0
    assert first.state == (*SYMBOLS, *MOTION_SYMBOLS)


@pytest.mark.slow
def test_truth_of_the_dataset_is_not_used(short_run, short_estimates, filter_name):
    assert_same(identify(short_run.without_truth(), filter_name), short_estimates[filter_name])


@pytest.mark.slow
def test_coefficients_of_the_settings_are_not_used(short_run, short_estimates, filter_name, with_settings):
    scrambled = with_settings(short_run, *(f"vehicle.coefficients.{symbol}=123" for symbol in SYMBOLS))
    assert scrambled.experiment.vehicle.all_coefficients()["Y_url"] == 123.0
    assert_same(identify(scrambled, filter_name), short_estimates[filter_name])


def test_estimating_needs_no_coefficients_in_the_settings(short_run, short_estimates, with_settings):
    bare = with_settings(short_run, "vehicle.coefficients={}")
    assert_same(identify(bare, FilterName.TUKF), short_estimates[FilterName.TUKF])


@pytest.mark.slow
def test_a_subset_is_estimated_with_the_others_held(short_run, filter_name, with_settings):
    chosen = ("Z_w|w|", "N_uudr", "X_u|u|")
    estimate = identify(with_settings(short_run, f"identification.coefficients=[{', '.join(chosen)}]"), filter_name)
    in_table_order = tuple(symbol for symbol in SYMBOLS if symbol in chosen)
    assert estimate.state == (*in_table_order, *MOTION_SYMBOLS)
    assert set(estimate.held) == set(SYMBOLS) - set(chosen)
    assert is_sound(estimate)
    assert relative_errors(estimate, short_run.truth).max() < 0.02
    for symbol, value in estimate.held.items():
        assert value == short_run.truth.coefficients[symbol]


def test_a_coefficient_held_at_a_wrong_value_spoils_the_estimate_of_others(short_run, with_settings):
    """Else the held values would not be used at all."""
    subset = with_settings(short_run, "identification.coefficients=[Y_url, N_url]")
    wrong = with_settings(subset, "vehicle.coefficients.N_uudr=-20")
    right = relative_errors(identify(subset, FilterName.TUKF), short_run.truth)
    spoiled = identify(wrong, FilterName.TUKF).final_coefficients()
    true = short_run.truth.coefficients
    assert right.max() < 0.02
    assert abs(spoiled["N_url"] / true["N_url"] - 1.0) > 0.2


def test_holding_a_coefficient_without_a_value_is_refused(short_run, with_settings):
    bare = with_settings(short_run, "vehicle.coefficients={}", "identification.coefficients=[Y_url]")
    with pytest.raises(ConfigError, match=r"X_u\|u\|") as caught:
        identify(bare, FilterName.TUKF)
    assert "\n" not in str(caught.value)


# The smoother goes through the data many times, and output error knows of no prior.
FACTORS = {FilterName.SMOOTHER: (1, 100), FilterName.OUTPUT_ERROR: (1,)}
WIDE = [(name, factor) for name in FilterName for factor in FACTORS.get(name, (1, 30, 300))]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "factor"), WIDE)
def test_wide_priors_give_a_sound_estimate_or_a_reason(long_run, name, factor, with_settings):
    estimate = identify(with_settings(long_run, f"identification.prior.factor={factor}"), name)
    if factor <= 30:
        assert is_sound(estimate), estimate.status
    assert np.isfinite(estimate.mean).all()
    assert estimate.time.size > 0
    said = status_of(estimate)
    assert "\n" not in said
    if said == "completed":
        assert np.median(relative_errors(estimate, long_run.truth)) < 0.01
        assert distance_in_deviations(estimate, long_run.truth) < 5.0
    else:
        assert said.startswith(("diverged", "inconsistent", "unconverged"))
        if said.startswith("diverged") and not name.in_one_batch:
            assert re.search(r"\(last innovation [\d.e+-]+ sigma, condition of the factor [\d.e+]+\)$", said), said


def test_the_exact_transition_of_the_ekf_is_at_least_as_good(short_run, short_estimates, with_settings):
    exact = identify(with_settings(short_run, "identification.ekf.transition=exact"), FilterName.EKF)
    assert is_sound(exact)
    assert not np.array_equal(exact.mean, short_estimates[FilterName.EKF].mean)
    assert np.median(relative_errors(exact, short_run.truth)) < 0.05


def test_lost_samples_do_no_harm(short_run, filter_name, rng):
    holed = short_run
    for name in ("dvl", "gyroscope", "attitude"):
        values = short_run.sensors[name].values.copy()
        values[rng.random(len(values)) < 0.2] = np.nan
        values[rng.random(values.shape) < 0.1] = np.nan
        holed = with_sensor(holed, name, values=values)
    estimate = identify(holed, filter_name)
    assert is_sound(estimate)
    assert np.median(relative_errors(estimate, short_run.truth)) < 0.05


@pytest.mark.slow
def test_gap_of_ten_seconds_does_no_harm(short_run, filter_name):
    silent = short_run
    for name in ("dvl", "gyroscope", "attitude"):
        record = short_run.sensors[name]
        kept = (record.time < 40.0) | (record.time > 50.0)
        silent = with_sensor(silent, name, time=record.time[kept], values=record.values[kept])
    estimate = identify(silent, filter_name)
    assert is_sound(estimate)
    assert np.diff(estimate.time).max() == pytest.approx(10.0, abs=0.2)
    assert np.median(relative_errors(estimate, short_run.truth)) < 0.1


def test_absent_samples_equal_nan_samples(short_run):
    record = short_run.sensors["dvl"]
    lost = (record.time > 20.0) & (record.time < 25.0)
    blank = record.values.copy()
    blank[lost] = np.nan
    absent = with_sensor(short_run, "dvl", time=record.time[~lost], values=record.values[~lost])
    blanked = with_sensor(short_run, "dvl", values=blank)
    assert_same(identify(blanked, FilterName.TUKF), identify(absent, FilterName.TUKF))


@pytest.mark.slow
def test_without_a_gyroscope_the_rates_follow_from_the_attitude(short_run, filter_name):
    sensors = {name: record for name, record in short_run.sensors.items() if name != "gyroscope"}
    estimate = identify(replace(short_run, sensors=sensors), filter_name)
    assert is_sound(estimate)
    late = estimate.time > 40.0
    true_rate = np.interp(estimate.time[late], short_run.truth.time, short_run.truth.motion[:, 5])
    rate = estimate.mean[late, estimate.state.index("r")]
    assert np.sqrt(np.mean((rate - true_rate) ** 2)) < 0.1 * true_rate.std()


@pytest.mark.slow
def test_heading_that_wraps_does_no_harm(simulated_with, filter_name):
    slow = "sensors.gyroscope.rate=25 Hz", "sensors.attitude.rate=25 Hz"
    dataset = simulated_with("manoeuvre.duration=80 s", *slow)
    heading = dataset.sensors["attitude"].values[:, 2]
    assert (np.abs(np.diff(heading[np.isfinite(heading)])) > np.pi).any(), "the test should cross south"
    estimate = identify(dataset, filter_name)
    assert is_sound(estimate)
    psi = estimate.mean[:, estimate.state.index("psi")]
    true = np.interp(estimate.time, dataset.truth.time, dataset.truth.motion[:, 8])
    # Without a jump, and right modulo a turn.
    assert np.abs(np.diff(psi)).max() < 0.1
    assert np.abs(np.angle(np.exp(1j * (psi - true)))).max() < np.deg2rad(5.0)
    innovation = estimate.innovations["attitude"].innovation[:, 2]
    assert np.nanmax(np.abs(innovation)) < 0.2


def test_motion_follows_the_truth(short_run, short_estimates, filter_name):
    estimate = short_estimates[filter_name]
    late = estimate.time > 30.0
    for i, symbol in enumerate(MOTION_SYMBOLS[:6]):
        true = np.interp(estimate.time[late], short_run.truth.time, short_run.truth.motion[:, i])
        error = estimate.mean[late, estimate.state.index(symbol)] - true
        assert np.sqrt(np.mean(error**2)) < 0.05 * true.std()


def test_innovations_have_the_times_of_their_sensor(short_run, short_estimates, filter_name):
    for name, innovations in short_estimates[filter_name].innovations.items():
        record = short_run.sensors[name]
        start = short_estimates[filter_name].time[0]
        used = np.isfinite(record.values).any(axis=1) & (record.time >= start - 1e-9)
        assert_allclose(innovations.time, record.time[used], atol=1e-9)
        assert np.isfinite(innovations.innovation).all()
        # A filter adds its own uncertainty to a new measurement's; a fit has used up some of the noise.
        more = innovations.variance - record.standard_deviation**2
        assert np.all(more <= 0.0 if filter_name is FilterName.OUTPUT_ERROR else more >= 0.0)


def test_chunks_of_any_length_follow_each_other_and_make_the_whole(
    short_run, short_estimates, kalman_filter, monkeypatch
):
    monkeypatch.setattr("auvid_cli.identification.prepared_data.Timelines", in_chunks_of(111))
    (run,), chunks = set_up_filters(prepare(short_run), [kalman_filter]), []
    outcome = run.run(chunks.append)
    assert len(chunks) > 15
    assert_allclose((chunks[0].time[0], chunks[-1].time[-1]), run.span, rtol=1e-12)
    assert sum(chunk.time.size for chunk in chunks) == outcome.steps
    assert_same(Estimate.of(run.header, chunks, outcome), short_estimates[kalman_filter])


def test_a_filter_can_be_stopped_whenever_it_asks_for_data(short_run, filter_name, monkeypatch):
    """A fit hands over nothing until its end; it asks for the data again and again."""
    monkeypatch.setattr("auvid_cli.identification.prepared_data.Timelines", in_chunks_of(500))
    asked = []

    def stop():
        asked.append(1)
        if len(asked) == 2:
            raise InterruptedError

    (run,) = set_up_filters(prepare(short_run), [filter_name], stop)
    with pytest.raises(InterruptedError):
        run.run(lambda chunk: None)
    assert len(asked) == 2


def test_keep_every_keeps_the_last_state_and_all_innovations(short_run, short_estimates, with_settings):
    thin = identify(with_settings(short_run, "identification.keep_every=700"), FilterName.TUKF)
    whole = short_estimates[FilterName.TUKF]
    rows = [*range(0, whole.time.size, 700), whole.time.size - 1]
    assert np.array_equal(thin.time, whole.time[rows])
    assert np.array_equal(thin.mean, whole.mean[rows])
    assert np.array_equal(thin.standard_deviation, whole.standard_deviation[rows])
    assert thin.steps == whole.steps == whole.time.size
    assert np.array_equal(thin.innovations["dvl"].nis, whole.innovations["dvl"].nis)


@pytest.mark.slow
def test_a_filter_that_fails_at_its_first_event_leaves_the_prior(short_run, kalman_filter, monkeypatch):
    def hopeless(*arguments, **options):
        process = vehicle_process(*arguments, **options)
        return process._replace(noise_density=np.full(9, np.inf))

    monkeypatch.setattr("auvid_cli.identification.problem_setup.vehicle_process", hopeless)
    estimate = identify(short_run, kalman_filter)
    assert estimate.status.startswith("diverged")
    assert estimate.time.size >= 1
    assert np.isfinite(estimate.mean).all()
    assert (
        not evaluate(prepare(short_run), [estimate], BoundsOf(prepare(short_run)))
        .summary[0]
        .status.startswith("completed")
    )


def test_infinite_measurements_count_as_missing(short_run):
    gyroscope = short_run.sensors["gyroscope"]
    values = gyroscope.values.copy()
    values[1::50] = np.inf
    dropped = values.copy()
    dropped[1::50] = np.nan
    runs = [
        identify(
            replace(short_run, sensors={**short_run.sensors, "gyroscope": replace(gyroscope, values=changed)}),
            FilterName.TUKF,
        )
        for changed in (values, dropped)
    ]
    assert (runs[0].mean == runs[1].mean).all()


def test_a_gate_for_output_error_is_refused(short_run, with_settings):
    with pytest.raises(ConfigError, match=r"gate.*output_error"):
        identify(with_settings(short_run, "identification.gate=6"), FilterName.OUTPUT_ERROR)


@pytest.mark.slow
def test_outliers_are_gated_and_counted(short_run, short_estimates, with_settings, kalman_filter):
    dvl = short_run.sensors["dvl"]
    values = dvl.values.copy()
    values[20::40, 0] += 3.0
    wild = with_sensor(short_run, "dvl", values=values)
    bad = identify(wild, kalman_filter)
    assert status_of(bad) != "completed"
    good = identify(with_settings(wild, "identification.gate=6"), kalman_filter)
    assert status_of(good) == "completed"
    assert good.innovations["dvl"].sums().rejected == len(values[20::40])
    assert good.innovations["gyroscope"].sums().rejected == 0
    shift = np.abs(good.mean[-1, :N_COEFFICIENTS] - short_estimates[kalman_filter].mean[-1, :N_COEFFICIENTS])
    assert (shift / good.standard_deviation[-1, :N_COEFFICIENTS]).max() < 1.0


@pytest.mark.parametrize("name", FilterName)
def test_in_one_batch_agrees_with_the_filter_name(short_run, name):
    (run,) = set_up_filters(prepare(short_run), [name])
    assert (run.estimator.name, run.estimator.in_one_batch) == (name, name.in_one_batch)
