"""The identified model left to itself."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.evaluation.free_run import free_run
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.rigid_body import Ballast

NOISELESS = (
    *(f"sensors.{name}.noise=1e-12" for name in ("dvl",)),
    "sensors.gyroscope={rate: 100 Hz, noise: 1e-12}",
    "sensors.attitude={source: direct, rate: 100 Hz, noise: 1e-12}",
)


@pytest.fixture(scope="module")
def noiseless(simulated_with):
    return simulated_with(
        "manoeuvre.duration=20 s", "manoeuvre.initial_speed=2 m/s", "manoeuvre.input_rate=100 Hz", *NOISELESS
    )


@pytest.fixture
def with_coefficients(hand_made):
    """Function: an estimate that ends with the given 22 coefficients."""

    def make(coefficients, **changes):
        return hand_made([0, 1], {symbol: [0.0, (coefficients | changes)[symbol]] for symbol in SYMBOLS})

    return make


def test_the_true_coefficients_reproduce_the_true_motion(noiseless, with_coefficients):
    run, _ = free_run(prepare(noiseless), with_coefficients(noiseless.truth.coefficients))
    on_ticks = np.isin(np.round(run.time, 9), np.round(noiseless.truth.time, 9))
    tick = np.searchsorted(noiseless.truth.time, run.time[on_ticks] - 1e-9)
    assert on_ticks.sum() > 1900
    assert run.time[0] == 0.0
    assert_allclose(run.motion[on_ticks], noiseless.truth.motion[tick], atol=1e-5)


def test_errors_of_the_true_coefficients_vanish(noiseless, with_coefficients):
    estimate = with_coefficients(noiseless.truth.coefficients)
    _, errors = free_run(prepare(noiseless), estimate)
    assert [e.component for e in errors] == ["u", "v", "w", "p", "q", "r"]
    assert [e.unit for e in errors] == ["m/s"] * 3 + ["rad/s"] * 3
    assert max(e.mean_absolute_error for e in errors) < 1e-5


def test_ballast_that_was_found_acts(noiseless, with_coefficients, with_settings):
    ballast = Ballast(5.0, -1.5)
    stated = Ballast(-5.0, 1.5).added_to(noiseless.experiment.vehicle.known_parameters())
    misstated = with_settings(noiseless, *(f"vehicle.parameters.{name}={value!r}" for name, value in stated.items()))
    blind = with_coefficients(noiseless.truth.coefficients)
    seeing = replace(
        blind, state=(*blind.state, *Ballast._fields), mean=np.hstack([blind.mean, np.tile(ballast, (2, 1))])
    )
    (_, errors), (_, worse) = (free_run(prepare(misstated), estimate) for estimate in (seeing, blind))
    assert max(e.mean_absolute_error for e in errors) < 1e-5
    assert worse[2].mean_absolute_error > 0.01


def test_a_current_and_the_errors_of_the_dvl_are_seen_through(simulated_with, with_coefficients):
    drifting = simulated_with(
        "manoeuvre.duration=20 s",
        "manoeuvre.initial_speed=2 m/s",
        "manoeuvre.current_north=0.3 m/s",
        "manoeuvre.current_east=-0.2 m/s",
        "sensors.dvl.scale_error=0.02",
        "sensors.dvl.mounting_yaw=0.1 rad",
        *NOISELESS,
    )
    blind = with_coefficients(drifting.truth.coefficients)
    sensor_errors = np.tile([0.3, -0.2, 0.02, 0.1], (len(blind.mean), 1))
    knowing = replace(
        blind,
        state=(*blind.state, "current_north", "current_east", "dvl_scale", "dvl_yaw"),
        mean=np.hstack([blind.mean, sensor_errors]),
    )
    (run, errors), (_, worse) = (free_run(prepare(drifting), estimate) for estimate in (knowing, blind))
    assert max(e.mean_absolute_error for e in errors) < 1e-5
    assert worse[0].mean_absolute_error > 0.1
    # What is drawn is what the DVL reads.
    dvl = drifting.sensors["dvl"]
    for component in range(3):
        drawn = np.interp(dvl.time, run.time, run.motion[:, component])
        assert_allclose(drawn[1:], dvl.values[1:, component], atol=1e-3)


def test_a_wrong_coefficient_shows_where_it_acts(noiseless, with_coefficients):
    true = noiseless.truth.coefficients
    estimate = with_coefficients(true, **{"X_u|u|": 2.0 * true["X_u|u|"]})
    _, errors = free_run(prepare(noiseless), estimate)
    assert errors[0].mean_absolute_error > 0.1


def test_the_error_is_the_mean_absolute_difference_from_the_measurements(noiseless, with_coefficients):
    estimate = with_coefficients(noiseless.truth.coefficients)
    dvl = noiseless.sensors["dvl"]
    values = dvl.values.copy()
    # The first measurement stays: the free run starts from it.
    values[1::2, 1] += 0.3
    values[2::2, 1] -= 0.3
    values[1:, 2] = np.nan
    values[1:4, 2] = dvl.values[1:4, 2] + [0.1, -0.2, 0.6]
    shifted = replace(noiseless, sensors=noiseless.sensors | {"dvl": replace(dvl, values=values)})
    _, errors = free_run(prepare(shifted), estimate)
    assert errors[1].mean_absolute_error == pytest.approx(0.3 * (1 - 1 / len(values)), abs=1e-4)
    assert errors[2].mean_absolute_error == pytest.approx(0.9 / 4, abs=1e-4)


def test_a_component_that_is_not_measured_has_no_error(noiseless, with_coefficients):
    sensors = {name: record for name, record in noiseless.sensors.items() if name != "gyroscope"}
    blind = replace(noiseless, sensors=sensors)
    estimate = with_coefficients(noiseless.truth.coefficients)
    _, errors = free_run(prepare(blind), estimate)
    assert [e.mean_absolute_error is None for e in errors] == [False] * 3 + [True] * 3


def test_a_model_that_blows_up_has_no_error(noiseless, with_coefficients):
    estimate = with_coefficients(noiseless.truth.coefficients, **{"X_u|u|": 1e6})
    _, errors = free_run(prepare(noiseless), estimate)
    assert errors[0].mean_absolute_error is None


def test_evaluation_holds_a_row_for_each_filter_and_coefficient(short_run, short_estimates):
    estimates = list(short_estimates.values())
    evaluation = evaluate(prepare(short_run), estimates, BoundsOf(prepare(short_run)))
    filters = [name.value for name in short_estimates]
    assert [row.filter for row in evaluation.summary] == filters
    assert [(row.filter, row.coefficient) for row in evaluation.coefficients] == [
        (name, symbol) for name in filters for symbol in SYMBOLS
    ]
    assert list(evaluation.free_runs) == filters
    for row in evaluation.summary:
        own = [r.steady_state_error_percent for r in evaluation.coefficients if r.filter == row.filter]
        assert row.average_steady_state_error_percent == pytest.approx(np.mean(own))
        assert row.microseconds_per_step * row.steps == pytest.approx(1e6 * row.cpu_time_s)
        assert row.status == "completed"


@pytest.mark.slow
def test_evaluation_without_truth_has_velocity_errors_only(short_run, short_estimates):
    dataset = short_run.without_truth()
    estimates = [short_estimates[name] for name in (FilterName.CKF, FilterName.OUTPUT_ERROR)]
    evaluation = evaluate(prepare(dataset), estimates, BoundsOf(prepare(dataset)))
    assert all(row.rmse is None and row.steady_state_error_percent is None for row in evaluation.coefficients)
    assert all(row.average_steady_state_error_percent is None for row in evaluation.summary)
    assert all(row.mean_absolute_error is not None for row in evaluation.velocity_errors)
