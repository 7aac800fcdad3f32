"""Raw inertial sensors in place of an AHRS: what is used, where it starts, and what estimators make of it."""

from dataclasses import replace
from itertools import chain

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.evaluation.bounds import true_initial_motions
from auvid_cli.filters.linear_smoother import LinearSmoothing
from auvid_cli.filters.problem import Gaussian
from auvid_cli.filters.sensitivities import responses
from auvid_cli.filters.smoother import follow_measurements
from auvid_cli.identification.information import information_at
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.run import identify
from auvid_cli.identification.timeline import initial_motion, measuring_sensors
from auvid_cli.vehicle.rigid_body import GRAVITY

INERTIAL = "identification.attitude_from=inertial"
LEVER = "sensors.accelerometer.position=[0.4 m, -0.2 m, 0.1 m]"
FEW = "identification.coefficients=[X_u|u|, N_url, N_uudr]"


@pytest.fixture(scope="module")
def raw_run(simulated_with):
    """20 s of the spiral, with an accelerometer off the origin."""
    return simulated_with("manoeuvre.duration=20 s", LEVER, INERTIAL, FEW)


@pytest.mark.parametrize("spans", ["[[0, 20]]", "[[0, 8], [10, 20]]"])
def test_given_parameters_are_like_parameters_with_a_narrow_prior(spans, raw_run, with_settings):
    """The sensors depend on parameters, and the data have one segment or two."""
    problem = augmented_problem(prepare(with_settings(raw_run, f"identification.use.spans={spans}"))).joint
    start, factor = follow_measurements(problem), problem.prior.factor.copy()
    factor[:, : problem.n_parameters] *= 1e-11
    narrow = problem._replace(prior=problem.prior._replace(factor=factor))
    given, known = LinearSmoothing(problem, parameters_are_given=True), LinearSmoothing(narrow)
    found, expected = given.filter(start), known.filter(start)
    assert found.cost == pytest.approx(expected.cost, rel=1e-9)
    assert found.least == pytest.approx(expected.least, rel=1e-9)
    assert found.log_determinant == pytest.approx(expected.log_determinant, rel=1e-9)
    step, expected_step = given.step(found), known.step(expected)
    assert not step.parameters.any()
    for chunk, expected_chunk in zip(chain(*step.moving), chain(*expected_step.moving), strict=True):
        assert_allclose(chunk, expected_chunk, rtol=1e-4, atol=1e-7)
    assert_allclose(step.initial, expected_step.initial, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("spans", ["[[0, 20]]", "[[0, 8], [10, 20]]"])
def test_step_with_given_parameters_equals_that_with_a_narrow_prior(spans, raw_run, with_settings):
    problem = augmented_problem(prepare(with_settings(raw_run, f"identification.use.spans={spans}"))).joint
    start, n, factor = follow_measurements(problem), problem.n_parameters, problem.prior.factor.copy()
    parameter_step = 0.1 * np.diagonal(factor)[:n] * np.array([1.0, -1.0, 0.5])
    factor[:, :n] *= 1e-11
    mean = np.concatenate([start.parameters + parameter_step, problem.prior.mean[n:]])
    narrow = LinearSmoothing(problem._replace(prior=Gaussian(mean, factor)))
    smoothing = LinearSmoothing(problem)
    step, expected = smoothing.step(smoothing.filter(start), parameter_step), narrow.step(narrow.filter(start))
    assert_allclose(step.parameters, parameter_step, rtol=1e-12)
    assert_allclose(expected.parameters, parameter_step, rtol=1e-6)
    for chunk, expected_chunk in zip(chain(*step.moving), chain(*expected.moving), strict=True):
        assert_allclose(chunk, expected_chunk, rtol=1e-4, atol=1e-7)
    assert_allclose(step.initial, expected.initial, rtol=1e-4, atol=1e-7)


def test_raw_sensors_replace_the_attitude(short_run, with_settings):
    assert set(measuring_sensors(short_run)) == {"attitude", "dvl", "gyroscope"}
    inertial = with_settings(short_run, INERTIAL)
    assert set(measuring_sensors(inertial)) == {"accelerometer", "dvl", "gyroscope", "magnetometer"}


@pytest.mark.parametrize("missing", ["accelerometer", "magnetometer"])
def test_missing_raw_sensor_is_named(missing, raw_run):
    sensors = {name: record for name, record in raw_run.sensors.items() if name != missing}
    with pytest.raises(DataError, match=rf"attitude_from: inertial.*{missing}"):
        prepare(replace(raw_run, sensors=sensors))


@pytest.mark.parametrize(
    ("source", "bias"),
    [
        *(("ahrs", name) for name in ("accelerometer", "accelerometer_scale", "magnetometer", "magnetic_field")),
        ("inertial", "attitude"),
    ],
)
def test_bias_of_an_unused_sensor_is_refused(source, bias, experiment_with):
    with pytest.raises(ConfigError, match=rf"{bias}.*{source}"):
        experiment_with(f"identification.attitude_from={source}", f"identification.estimate.biases=[{bias}]")


@pytest.mark.parametrize("roll", [-0.4, 0.0, 0.3])
@pytest.mark.parametrize("pitch", [-0.5, 0.2])
def test_initial_roll_and_pitch_follow_from_gravity(roll, pitch, raw_run):
    """But for the turning of the velocity."""
    up = np.array([np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)])
    velocity, rate = np.array([3.0, 0.2, -0.1]), np.array([0.01, 0.02, 0.3])
    said = {
        "dvl": velocity,
        "gyroscope": rate,
        "magnetometer": np.array([2.5]),
        "accelerometer": GRAVITY * up + np.cross(rate, velocity),
    }
    records = {name: SensorRecord(np.zeros(1), values[None], np.ones(values.size)) for name, values in said.items()}
    start, motion = initial_motion(raw_run, records)
    assert start == 0.0
    assert_allclose(motion, [*velocity, *rate, roll, pitch, 2.5], atol=1e-12)


def test_accelerometer_without_one_axis_starts_level_about_it(raw_run):
    felt = np.array([[0.5, np.nan, np.nan]])
    _, motion = initial_motion(raw_run, {"accelerometer": SensorRecord(np.zeros(1), felt, np.ones(3))})
    assert_allclose(motion[6:8], [0.0, np.arctan2(0.5, GRAVITY)])


@pytest.mark.parametrize("manoeuvre", ["spiral", "doublets"])
def test_accelerometer_is_predicted_along_the_true_motion(manoeuvre, simulated_with):
    """As it feels the inputs that hold from then on, off the origin too: doublets switch while it samples."""
    dataset = simulated_with(
        f"manoeuvre=manoeuvres/{manoeuvre}.yaml", "manoeuvre.duration=30 s", LEVER, INERTIAL, FEW,
        "sensors.accelerometer.range=3e-6 m/s^2", "identification.integration_step=2.5 ms",
    )  # fmt: skip
    prepared = prepare(dataset)
    assert dataset.truth is not None
    problem = augmented_problem(prepared)
    (motion,), start = true_initial_motions(prepared), problem.prior.mean.copy()
    symbols = problem.layout.symbols
    true = dataset.truth.coefficients
    start[:3] = [true[symbol] for symbol in symbols[:3]] / problem.layout.scale[:3]
    start[3:] = motion
    sensor = list(problem.measuring).index("accelerometer")
    normal = []
    for response in responses(problem.process, problem.sensors, prepared.segments[0].timelines, start):
        mine = response.timeline.measurement_sensor == sensor
        normal.append(response.innovation[mine] / np.sqrt(problem.sensors.variance[sensor]))
    assert np.abs(np.concatenate(normal)).max() < 6.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ekf", "ckf", "ukf", "tukf", "smoother", "output_error"])
def test_every_estimator_finds_coefficients_and_biases(name, raw_run, with_settings):
    biases = "identification.estimate.biases=[gyro, accelerometer, accelerometer_scale, magnetometer]"
    dataset = with_settings(raw_run, biases, "identification.ekf.transition=exact", "identification.prior.factor=1")
    shifted = {name: dataset.sensors[name].values.copy() for name in ("accelerometer", "magnetometer")}
    shifted["accelerometer"] *= [1.01, 0.99, 1.005]
    shifted["accelerometer"] += [0.02, -0.03, 0.01]
    shifted["magnetometer"] += 0.02
    records = {name: replace(dataset.sensors[name], values=values) for name, values in shifted.items()}
    estimate = identify(replace(dataset, sensors=dataset.sensors | records), FilterName(name))
    assert estimate.completed
    assert dataset.truth is not None
    expected = {"bias_fx": 0.02, "bias_fy": -0.03, "scale_fx": 0.01, "scale_fy": -0.01, "scale_fz": 0.005} | {
        symbol: dataset.truth.coefficients[symbol] for symbol in estimate.state[:3]
    }
    for symbol, value in expected.items():
        i = estimate.state.index(symbol)
        assert abs(estimate.mean[-1, i] - value) < 4.0 * estimate.standard_deviation[-1, i], symbol
    for innovations in estimate.innovations.values():
        tally = innovations.sums()
        assert 0.8 < tally.squares.sum() / tally.components.sum() < 1.2


FIELD = (
    "sensors.magnetic_field={rate: 20 Hz, noise: 0.3 uT, bias: [2 uT, -1 uT, 0.5 uT], strength: 48 uT, "
    "declination: -20 deg, dip: 65 deg}"
)


@pytest.fixture(scope="module")
def in_the_field(simulated_with):
    """20 s of the spiral, with a magnetometer of three axes and iron in the hull, and no heading."""
    few = "identification.coefficients=[X_u|u|, N_url]"
    dataset = simulated_with("manoeuvre.duration=20 s", INERTIAL, few, FIELD)
    return replace(dataset, sensors={k: r for k, r in dataset.sensors.items() if k != "magnetometer"})


def test_initial_heading_follows_from_the_magnetic_field(in_the_field):
    start, motion = initial_motion(in_the_field, measuring_sensors(in_the_field))
    true = np.interp(start, in_the_field.truth.time, in_the_field.truth.motion[:, 8])
    # But for what is magnetic in the hull, 2.2 of some 20 uT that are level.
    assert motion[8] == pytest.approx(true, abs=0.12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ekf", "ckf", "smoother", "output_error"])
def test_magnetic_bias_is_estimated(name, in_the_field, with_settings):
    dataset = with_settings(in_the_field, "identification.estimate.biases=[magnetic_field]")
    estimate = identify(dataset, FilterName(name))
    assert estimate.completed
    expected = {"bias_mx": 2e-6, "bias_my": -1e-6, "bias_mz": 0.5e-6, "N_url": dataset.truth.coefficients["N_url"]}
    for symbol, value in expected.items():
        i = estimate.state.index(symbol)
        assert abs(estimate.mean[-1, i] - value) < 4.0 * estimate.standard_deviation[-1, i], symbol
    assert estimate.standard_deviation[-1, estimate.state.index("bias_mx")] < 1e-7


@pytest.mark.slow
def test_unmodelled_magnetic_bias_is_named(in_the_field):
    faults = identify(in_the_field, FilterName.SMOOTHER).faults
    worst = max(faults, key=lambda test: abs(test.z))
    assert str(worst.fault) in ("bias of mx", "bias of my", "bias of mz")
    assert abs(worst.z) > 10.0


def test_raw_sensors_are_more_informative_than_an_ahrs(raw_run, with_settings):
    assert raw_run.truth is not None
    bounds = []
    for source in ("ahrs", "inertial"):
        dataset = with_settings(raw_run, f"identification.attitude_from={source}")
        prepared = prepare(dataset)
        information = information_at(prepared, raw_run.truth.coefficients, true_initial_motions(prepared))
        bounds.append([information.bound()[symbol] for symbol in information.state[:3]])
    assert (np.array(bounds[1]) < np.array(bounds[0])).all()


def without_its_place(dataset):
    accelerometer = replace(dataset.sensors["accelerometer"], position=(0.0, -0.2, 0.1))
    return replace(dataset, sensors=dataset.sensors | {"accelerometer": accelerometer})


def biased(dataset):
    accelerometer = dataset.sensors["accelerometer"]
    felt = replace(accelerometer, values=accelerometer.values + np.array([0.0, 0.01, 0.0]))
    return replace(dataset, sensors=dataset.sensors | {"accelerometer": felt})


def trimmed(dataset):
    values = dataset.inputs.values.copy()
    values[:, 1] -= 0.002
    return replace(dataset, inputs=replace(dataset.inputs, values=values))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoil", "fault", "size"),
    [
        (without_its_place, "position of the accelerometer, x", 0.4),
        (biased, "bias of fy", 0.01),
        (trimmed, "trim of the elevator", 0.002),
    ],
)
def test_fault_measured_by_the_accelerometer_is_sized(spoil, fault, size, raw_run):
    tests = identify(spoil(raw_run), FilterName("smoother")).faults
    found = max(tests, key=lambda test: abs(test.z))
    assert str(found.fault) == fault
    assert found.size == pytest.approx(size, abs=0.02 * size + 4.0 * found.standard_deviation)
