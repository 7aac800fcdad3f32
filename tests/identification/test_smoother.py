"""The smoother on vehicles: right where filters go astray, the same where they do not."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.errors import ConfigError
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import Motion, augmented_problem
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS

ZIGZAG = (
    "manoeuvre=manoeuvres/zigzag_20_20.yaml",
    "manoeuvre.speed=2 m/s",
    "manoeuvre.duration=60 s",
    "sensors.attitude={source: direct, rate: 25 Hz}",
    "sensors.gyroscope.rate=25 Hz",
)


def coefficients(estimate):
    return estimate.mean[-1, :N_COEFFICIENTS], estimate.standard_deviation[-1, :N_COEFFICIENTS]


def normalised_errors(dataset, estimate):
    mean, deviation = coefficients(estimate)
    return (mean - [dataset.truth.coefficients[symbol] for symbol in SYMBOLS]) / deviation


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_smoother_converges_from_wide_priors(seed, simulated_with):
    dataset = simulated_with(*ZIGZAG, f"seed={seed}")
    astray, right = (identify(dataset, name) for name in (FilterName.EKF, FilterName.SMOOTHER))
    assert astray.status == right.status == "completed"
    assert np.abs(normalised_errors(dataset, astray)).max() > 5.0
    errors = normalised_errors(dataset, right)
    assert np.abs(errors).max() < 3.0
    assert np.sqrt(np.mean(errors**2)) < 1.3


@pytest.mark.slow
def test_start_from_an_estimate_gives_the_same_one(short_run, short_estimates):
    earlier = short_estimates[FilterName.SMOOTHER]
    again = identify(short_run, FilterName.SMOOTHER, Motion.of_estimate(earlier))
    (again, _), (mean, deviation) = map(coefficients, (again, earlier))
    assert np.abs((again - mean) / deviation).max() < 0.1


def test_motion_and_trajectory_are_the_same_states(short_run, short_estimates):
    motion = Motion.of_estimate(short_estimates[FilterName.SMOOTHER])
    augmented = augmented_problem(prepare(short_run))
    again = Motion.of_trajectory(augmented, motion.trajectory(augmented))
    assert again.state == motion.state
    np.testing.assert_array_equal(again.time, motion.time)
    np.testing.assert_allclose(again.mean, motion.mean, rtol=1e-12)


def test_motion_of_another_model_is_completed(short_run, short_estimates):
    motion = Motion.of_estimate(short_estimates[FilterName.SMOOTHER])
    augmented = augmented_problem(prepare(short_run))
    kept = [column for column, symbol in enumerate(motion.state) if symbol not in ("w", "X_u|u|")]
    part = Motion([motion.state[column] for column in kept], motion.time[::2], motion.mean[::2, kept])
    trajectory = part.trajectory(augmented)
    symbols, n = list(augmented.layout.symbols), augmented.layout.n_parameters
    unknown = symbols.index("X_u|u|")
    assert trajectory.parameters[unknown] == augmented.prior.mean[unknown]
    moving = np.vstack(trajectory.moving[0]) * augmented.layout.scale[n:]
    w, q = (symbols.index(symbol) for symbol in ("w", "q"))
    assert np.ptp(moving[:, w - n]) == 0.0
    # Between two times of the motion its states are on a straight line.
    halfway = 0.5 * (motion.mean[0:-2:2, q] + motion.mean[2::2, q])
    share = (motion.time[1:-1:2] - motion.time[0:-2:2]) / (motion.time[2::2] - motion.time[0:-2:2])
    line = motion.mean[0:-2:2, q] + share * 2.0 * (halfway - motion.mean[0:-2:2, q])
    np.testing.assert_allclose(moving[1:-1:2, q - n], line, rtol=1e-9, atol=1e-12)


def test_smoother_agrees_with_a_consistent_filter(short_run, short_estimates):
    smoothed, filtered = (short_estimates[name] for name in (FilterName.SMOOTHER, FilterName.TUKF))
    (mean, deviation), (other, of_other) = coefficients(smoothed), coefficients(filtered)
    assert np.abs((mean - other) / of_other).max() < 1.0
    assert np.abs(np.log(deviation / of_other)).max() < 0.2
    # Parameters are those of all data from the first event on; the motion is known better than to a filter.
    assert np.ptp(smoothed.mean[:, :N_COEFFICIENTS], axis=0).max() == 0.0
    late = filtered.time > 10.0
    motion = slice(N_COEFFICIENTS, None)
    assert np.all(smoothed.standard_deviation[late, motion] <= filtered.standard_deviation[late, motion] * 1.05)


@pytest.mark.slow
def test_without_process_noise_it_is_the_output_error_fit(simulated_with):
    dataset = simulated_with(
        "manoeuvre.duration=30 s",
        "sensors.attitude={source: direct, rate: 20 Hz}",
        "sensors.gyroscope.rate=20 Hz",
        "identification.output_error.use_prior=true",
        "identification.process_noise={velocity: 1e-9, rate: 1e-9, attitude: 1e-9}",
    )
    (mean, deviation), (other, of_other) = (
        coefficients(identify(dataset, name)) for name in (FilterName.SMOOTHER, FilterName.OUTPUT_ERROR)
    )
    assert np.abs((mean - other) / of_other).max() < 0.05
    assert np.abs(np.log(deviation / of_other)).max() < 0.02


@pytest.mark.slow
def test_annealed_process_noise_leads_to_convergence(simulated_with):
    """From a slow start, with few measurements, no filter finishes and no other start leads to a minimum."""
    dataset = simulated_with(
        "manoeuvre=manoeuvres/multisine.yaml",
        "manoeuvre.duration=40 s",
        "sensors={attitude: {source: direct, rate: 10 Hz, noise: 0.15 deg}, dvl: {rate: 5 Hz, noise: 1 cm/s}}",
        "identification.process_noise={velocity: 1e-5, rate: 1e-5, attitude: 1e-6}",
        "identification.integration_step=0.05 s",
    )
    assert not identify(dataset, FilterName.CKF).completed
    estimate = identify(dataset, FilterName.SMOOTHER)
    assert estimate.completed
    assert np.abs(normalised_errors(dataset, estimate)).max() < 4.0


def test_too_few_passes_are_reported_as_unconverged(short_run, with_settings):
    dataset = with_settings(short_run, "identification.smoother.max_passes=1")
    estimate = identify(dataset, FilterName.SMOOTHER)
    assert estimate.status.startswith("unconverged")
    assert "max_passes = 1" in estimate.status


def test_smoother_refuses_a_gate(short_run, with_settings):
    with pytest.raises(ConfigError, match=r"gate.*smoother"):
        identify(with_settings(short_run, "identification.gate=6"), FilterName.SMOOTHER)


def test_impossible_data_are_reported_for_any_segments(short_run, with_settings):
    values = short_run.inputs.values.copy()
    values[short_run.inputs.time > 50.0] = 1e6
    broken = replace(short_run, inputs=replace(short_run.inputs, values=values))
    estimate = identify(with_settings(broken, "identification.use.spans=[[5, 25], [40, 60]]"), FilterName.SMOOTHER)
    assert estimate.status.startswith("diverged at t = ")
    assert estimate.covariance.shape == (len(estimate.state),) * 2


PUSHES = "{force: {standard_deviation: 5 N}, moment: {standard_deviation: [0.2 N*m, 2 N*m, 2 N*m]}}"
DISTURBED = f"identification.estimate={{biases: [disturbance], disturbance: {PUSHES}}}"


@pytest.mark.parametrize(
    ("overrides", "marginal"),
    [
        ((), False),
        (("identification.noise=estimate",), True),
        ((DISTURBED,), True),
        ((DISTURBED, "identification.smoother.answer=joint"), False),
        (("identification.smoother.answer=marginal",), True),
    ],
)
def test_the_motion_is_integrated_out_where_noise_drives_it(overrides, marginal, experiment_with):
    assert experiment_with(*overrides).identification.is_marginal is marginal


@pytest.mark.slow
def test_marginal_smoother_agrees_with_a_filter(simulated_with, with_settings):
    """The filter does not know the motion either."""
    # The filter adds the noise of a disturbance at the end of an interval, so intervals are short.
    slow = "sensors.attitude={source: direct, rate: 20 Hz}", "sensors.gyroscope.rate=20 Hz"
    dataset = simulated_with(
        "manoeuvre.duration=25 s", "manoeuvre.input_rate=100 Hz", *slow, f"manoeuvre.disturbance={PUSHES}", DISTURBED
    )
    joint = with_settings(dataset, "identification.smoother.answer=joint")
    (mean, deviation), *others = (
        coefficients(identify(data, name))
        for data, name in (
            (dataset, FilterName.CKF),
            (dataset, FilterName.SMOOTHER),
            (joint, FilterName.SMOOTHER),
        )
    )
    distance = [np.abs((other - mean) / deviation).max() for other, _ in others]
    assert distance[0] < 0.5
    assert distance[1] > 2.0
