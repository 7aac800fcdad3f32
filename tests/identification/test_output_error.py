"""The output-error method on the vehicle, and the information that a dataset holds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from auvid_cli.config.enums import FilterName
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.evaluation.innovations import sensor_consistency
from auvid_cli.evaluation.judgement import status_of
from auvid_cli.identification.information import information_at
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

N = len(SYMBOLS)
# 20 s in which every coefficient shows, with errors that are independent from one measurement to the next.
SHORT = (
    "manoeuvre.duration=20 s",
    "manoeuvre.initial_speed=2 m/s",
    "manoeuvre.excitation.fade_in=2 s",
    "manoeuvre.input_rate=25 Hz",
    "sensors.gyroscope.rate=25 Hz",
)
WHITE = (*SHORT, "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}")
NOISELESS = (
    *SHORT,
    "sensors.dvl={rate: 7 Hz, noise: 1e-12, standard_deviation: 1 mm/s}",
    "sensors.gyroscope={rate: 100 Hz, noise: 1e-12, standard_deviation: 1e-3}",
    "sensors.attitude={source: direct, rate: 100 Hz, noise: 1e-12, standard_deviation: 1e-3}",
)
SEEDS = 10


@pytest.fixture(scope="module")
def white_run(simulated_with):
    return simulated_with(*WHITE)


def values_of(coefficients):
    return np.array([coefficients[symbol] for symbol in SYMBOLS])


@pytest.mark.slow
def test_without_noise_it_finds_the_true_coefficients(simulated_with):
    dataset = simulated_with(*NOISELESS)
    estimate = identify(dataset, FilterName.OUTPUT_ERROR)
    assert estimate.status == "completed"
    assert_allclose(values_of(estimate.final_coefficients()), values_of(dataset.truth.coefficients), rtol=1e-4)


@pytest.mark.slow
def test_output_error_scatter_attains_the_bound(simulated_with):
    """Normalised errors of 22 coefficients, by the bound at the truth and by what the fit says itself."""
    by_bound, by_itself = [], []
    for seed in range(1, SEEDS + 1):
        dataset = simulated_with(*WHITE, f"seed={seed}")
        estimate = identify(dataset, FilterName.OUTPUT_ERROR)
        assert estimate.status == "completed"
        error = values_of(estimate.final_coefficients()) - values_of(dataset.truth.coefficients)
        information = information_at(prepare(dataset), dataset.truth.coefficients)
        scale = information.scale[:N]
        bound = information.total.uncertainty().covariance(np.eye(len(information.state)))[:N, :N]
        for covariance, result in (
            (bound, by_bound),
            (estimate.covariance[:N, :N] / np.outer(scale, scale), by_itself),
        ):
            result.append((error / scale) @ np.linalg.solve(covariance, error / scale))
    low, high = chi2.ppf([1e-3, 1.0 - 1e-3], SEEDS * N)
    assert low < sum(by_bound) < high
    assert low < sum(by_itself) < high


def test_output_error_residuals_are_consistent(white_run):
    estimate = identify(white_run, FilterName.OUTPUT_ERROR)
    for result in sensor_consistency(estimate):
        spread = np.sqrt(2.0 / (3 * result.measurements))
        assert result.mean_nis == pytest.approx(1.0, abs=5 * spread), result.sensor
    assert status_of(estimate) == "completed"


def test_coefficients_and_their_uncertainty_are_the_same_at_all_times(short_estimates):
    estimate = short_estimates[FilterName.OUTPUT_ERROR]
    assert np.ptp(estimate.mean[:, :N], axis=0).max() == 0.0
    assert np.ptp(estimate.standard_deviation[:, :N], axis=0).max() == 0.0
    assert_allclose(np.sqrt(np.diag(estimate.covariance)), estimate.standard_deviation[-1], rtol=1e-9)


@pytest.mark.slow
def test_output_error_needs_no_filter_start(simulated_with, monkeypatch):
    def hopeless(*arguments):
        return vehicle_process(*arguments)._replace(noise_density=np.full(9, np.inf))

    # Over a minute; from 20 s it ends in another minimum.
    slow = "sensors.gyroscope.rate=25 Hz", "sensors.attitude.rate=25 Hz"
    run = simulated_with("manoeuvre.duration=60 s", "manoeuvre.input_rate=100 Hz", *slow)
    usual = identify(run, FilterName.OUTPUT_ERROR)
    monkeypatch.setattr("auvid_cli.identification.problem_setup.vehicle_process", hopeless)
    estimate = identify(run, FilterName.OUTPUT_ERROR)
    assert estimate.status == "completed"
    assert np.abs((estimate.mean - usual.mean)[-1, :N] / usual.standard_deviation[-1, :N]).max() < 0.01


def test_one_evaluation_is_reported_as_unconverged(white_run, with_settings):
    estimate = identify(
        with_settings(white_run, "identification.output_error.max_evaluations=1"), FilterName.OUTPUT_ERROR
    )
    assert estimate.status.startswith("unconverged")
    assert "max_evaluations = 1;" in estimate.status
    assert "NIS" in estimate.status
    assert "the next step moves" in estimate.status
    assert not estimate.completed
    (row,) = evaluate(prepare(white_run), [estimate], BoundsOf(prepare(white_run))).summary
    assert row.status == estimate.status
    assert row.average_steady_state_error_percent is None


def test_a_vehicle_whose_motion_blows_up_from_every_start_is_reported(white_run, monkeypatch):
    """A righting moment of the wrong sign and size: the motion turns over at once whatever the coefficients are."""

    def impossible(vehicle, *arguments):
        vehicle = vehicle.copy()
        vehicle[36:72] *= 1e6
        return vehicle_process(vehicle, *arguments)

    monkeypatch.setattr("auvid_cli.identification.problem_setup.vehicle_process", impossible)
    estimate = identify(white_run, FilterName.OUTPUT_ERROR)
    assert estimate.status.startswith("diverged at t = ")
    assert np.isfinite(estimate.mean).all()
    assert estimate.time[-1] < 20.0


def test_without_an_attitude_sensor_the_heading_is_infinitely_uncertain(white_run):
    sensors = {name: record for name, record in white_run.sensors.items() if name != "attitude"}
    dataset = replace(white_run, sensors=sensors)
    estimate = identify(dataset, FilterName.OUTPUT_ERROR)
    assert estimate.status == "completed"
    heading = estimate.state.index("psi")
    assert np.all(estimate.standard_deviation[:, heading] == np.inf)
    assert np.isfinite(np.delete(estimate.standard_deviation, heading, axis=1)).all()
    assert np.isfinite(estimate.mean).all()
    error = values_of(estimate.final_coefficients()) - values_of(white_run.truth.coefficients)
    assert np.abs(error / estimate.standard_deviation[-1, :N]).max() < 5.0


@pytest.mark.slow
def test_the_prior_counts_only_if_it_is_asked_for(white_run, with_settings):
    def fit(*overrides):
        settings = ("identification.prior.standard_deviation={'M_w|w|': 0.01}", *overrides)
        return identify(with_settings(white_run, *settings), FilterName.OUTPUT_ERROR)

    column = SYMBOLS.index("M_w|w|")
    free, held = fit(), fit("identification.output_error.use_prior=true")
    assert free.standard_deviation[-1, column] > 0.1
    assert held.standard_deviation[-1, column] == pytest.approx(0.01, rel=0.01)
    assert abs(held.mean[-1, column]) < 0.05


def test_bounds_hold_a_coefficient_where_it_is_known_to_be(white_run, with_settings):
    setting = "identification.output_error.bounds={X_u|u|: [-5 kg/m, -4.9 kg/m]}"
    estimate = identify(with_settings(white_run, setting), FilterName.OUTPUT_ERROR)
    assert -5.0 <= estimate.final_coefficients()["X_u|u|"] <= -4.9 + 1e-9


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("{X_u|v|: [0, 1]}", ("X_u|v|", "did you mean")),
        ("{X_u|u|: [1, 0]}", ("X_u|u|", "less than")),
        ("{X_u|u|: 1}", ("X_u|u|", "[lowest, highest]")),
        ("{X_u|u|: [1 m, 2]}", ("kg/m", "1 m")),
    ],
)
def test_wrong_bounds_are_refused(setting, words, experiment_with):
    with pytest.raises(ConfigError, match=r"identification\.output_error\.bounds") as caught:
        experiment_with(f"identification.output_error.bounds={setting}")
    for word in words:
        assert word in str(caught.value)


def test_bounds_of_a_coefficient_that_is_held_are_refused(experiment_with):
    with pytest.raises(ConfigError, match="Y_url"):
        experiment_with("identification.coefficients=[N_url]", "identification.output_error.bounds={Y_url: [0, 1]}")


def test_the_information_of_all_sensors_is_the_sum_of_each(white_run):
    found = information_at(prepare(white_run), white_run.truth.coefficients)
    assert found.state == (*SYMBOLS, *MOTION_SYMBOLS)
    assert set(found.by_sensor) == {"dvl", "gyroscope", "attitude"}
    normal = sum(part.factor.T @ part.factor for part in found.by_sensor.values())
    size = np.sqrt(np.outer(np.diag(normal), np.diag(normal)))
    assert_allclose(found.total.factor.T @ found.total.factor / size, normal / size, atol=1e-12)
    assert found.total.n_measurements == sum(part.n_measurements for part in found.by_sensor.values())
    start = found.total.n_measurements / 3
    assert start == pytest.approx(sum(len(white_run.sensors[name].time) for name in found.by_sensor), abs=3)


def test_bound_is_infinite_for_unobservable_components(white_run, with_settings):
    found = information_at(prepare(white_run), white_run.truth.coefficients)
    bound = found.bound()
    estimate = identify(white_run, FilterName.OUTPUT_ERROR)
    assert_allclose([bound[s] for s in SYMBOLS], estimate.standard_deviation[-1, :N], rtol=0.05)
    other = with_settings(white_run, "identification.prior.factor=17")
    assert_allclose(
        list(information_at(prepare(other), white_run.truth.coefficients).bound().values()),
        list(bound.values()),
        rtol=1e-9,
    )
    assert found.bound("dvl")["psi"] == found.bound("gyroscope")["psi"] == np.inf
    assert all(
        found.bound(name)[symbol] >= bound[symbol] * (1.0 - 1e-9) for name in found.by_sensor for symbol in bound
    )


def test_the_information_is_taken_at_the_motion_that_is_given(white_run):
    measured = information_at(prepare(white_run), white_run.truth.coefficients)
    given = information_at(prepare(white_run), white_run.truth.coefficients, [white_run.truth.motion[1]])
    other = information_at(prepare(white_run), white_run.truth.coefficients, [white_run.truth.motion[1] + 0.1])
    assert_allclose(list(given.bound().values()), list(measured.bound().values()), rtol=0.05)
    assert not np.allclose(list(other.bound().values()), list(measured.bound().values()), rtol=0.05)


def test_information_where_the_model_blows_up_is_refused(white_run):
    with pytest.raises(DataError, match="diverges at t = "):
        information_at(prepare(white_run), white_run.truth.coefficients | {"X_u|u|": 1e6})
