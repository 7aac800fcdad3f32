"""Raw sensors: measured quantities and each error."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from auvid_cli.simulation.motion import sample_motion
from auvid_cli.simulation.simulate import measure
from auvid_cli.vehicle.rigid_body import GRAVITY

RAW = ("gyroscope", "accelerometer", "magnetometer", "dvl")
STILL_WATER = np.zeros(3)
FAULTS = "dropout_probability=0.5", "coloured_share=0.5", "vibration=0.1", "delay=0.1 s", "delay_spread=0.1 s"
NOISELESS = tuple(f"sensors.{name}={{rate: 50 Hz, noise: 0}}" for name in RAW)


@pytest.fixture
def measurement(experiment_with, standing_still):
    """Function: samples of one sensor of a vehicle at rest."""

    @cache
    def suite(name: str, settings: str):
        """Return a suite in which the other sensors have one sample."""
        others = (f"sensors.{other}.rate=0.001 Hz" for other in RAW if other != name)
        return experiment_with(f"sensors.{name}={settings}", *others).sensors

    def read(name: str, settings: str, duration: float, seed: int = 1):
        return measure(standing_still(duration), suite(name, settings), STILL_WATER, seed)[name]

    return read


def within_chance(sum_of_squares, count):
    """Whether a sum of squares of standard normal numbers passes a chi-squared test at one in a million."""
    low, high = stats.chi2.ppf([5e-7, 1 - 5e-7], count)
    return low < sum_of_squares < high


def credible_share(hits, count, probability):
    low, high = stats.binom.ppf([5e-7, 1 - 5e-7], count, probability)
    return low <= hits <= high


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ("{rate: 7 Hz, noise: 0.01}", np.arange(71) / 7),
        ("{rate: 7 Hz, noise: 0.01, start: 0.35 s}", 0.35 + np.arange(68) / 7),
        ("{rate: 0.3 Hz, noise: 0.01}", np.arange(4) / 0.3),
        ("{rate: 7 Hz, noise: 0.01, start: 11 s}", np.zeros(0)),
    ],
)
def test_sample_times_follow_rate_and_start(settings, expected, measurement):
    assert_allclose(measurement("dvl", settings, 10.0).time, expected, rtol=1e-12)


def test_noise_is_white_with_standard_deviation_of_settings(measurement):
    record = measurement("dvl", "{rate: 100 Hz, noise: [0.01, 0.02, 0.03]}", 100.0)
    normal = record.values / [0.01, 0.02, 0.03]
    assert_allclose(record.standard_deviation, [0.01, 0.02, 0.03])
    count = normal.shape[0]
    for component in range(3):
        assert within_chance((normal[:, component] ** 2).sum(), count)
        assert abs(normal[:, component].mean()) < 5 / np.sqrt(count)
        assert abs(np.mean(normal[1:, component] * normal[:-1, component])) < 5 / np.sqrt(count)
        assert abs(np.mean(normal[:, component] * normal[:, component - 1])) < 5 / np.sqrt(count)


def test_range_is_three_standard_deviations(measurement):
    assert_allclose(measurement("dvl", "{rate: 1 Hz, range: 0.3}", 1.0).standard_deviation, 0.1)


def test_record_has_stated_standard_deviation(measurement):
    record = measurement("dvl", "{rate: 100 Hz, noise: 0.01, standard_deviation: 0.5}", 20.0)
    assert_allclose(record.standard_deviation, 0.5)
    assert record.values.std() == pytest.approx(0.01, rel=0.1)


def test_constant_bias_is_added(measurement):
    record = measurement("gyroscope", "{rate: 10 Hz, noise: 0, bias: [0.1, -0.2, 0.3]}", 5.0)
    assert_allclose(record.values, np.tile([0.1, -0.2, 0.3], (51, 1)))


def test_bias_spread_is_drawn_per_seed(measurement):
    settings = "{rate: 10 Hz, noise: 0, bias_spread: 0.02}"
    biases = []
    for seed in range(60):
        values = measurement("gyroscope", settings, 0.5, seed).values
        assert np.all(values == values[0])
        biases.append(values[0])
    assert len(np.unique(biases)) == 180
    assert within_chance((np.array(biases) ** 2).sum() / 0.02**2, 180)


@pytest.mark.slow
def test_drift_grows_with_square_root_of_time(measurement):
    settings = "{rate: 4 Hz, noise: 0, drift: 0.001}"
    walks = np.array([measurement("gyroscope", settings, 64.0, seed).values for seed in range(60)])
    for time in (1, 4, 16, 64):
        at_time = walks[:, 4 * time]
        assert within_chance((at_time**2).sum() / (0.001**2 * time), at_time.size)
    assert np.all(walks[:, 0] == 0.0)


def test_quantisation_rounds_to_step(measurement):
    plain = measurement("dvl", "{rate: 50 Hz, noise: 0.02}", 10.0).values
    stepped = measurement("dvl", "{rate: 50 Hz, noise: 0.02, quantisation: [0.01, 0, 0.004]}", 10.0).values
    for component, step in ((0, 0.01), (2, 0.004)):
        assert_allclose(stepped[:, component] / step, np.round(stepped[:, component] / step), atol=1e-9)
        assert np.abs(stepped - plain)[:, component].max() <= 0.5 * step * (1 + 1e-9)
    assert np.array_equal(stepped[:, 1], plain[:, 1])


def test_dropouts_lose_whole_samples_and_keep_others(measurement):
    plain = measurement("dvl", "{rate: 100 Hz, noise: 0.02}", 100.0)
    holed = measurement("dvl", "{rate: 100 Hz, noise: 0.02, dropout_probability: 0.3}", 100.0)
    lost = np.isnan(holed.values).any(axis=1)
    assert np.isnan(holed.values[lost]).all()
    assert credible_share(lost.sum(), lost.size, 0.3)
    assert np.array_equal(holed.values[~lost], plain.values[~lost])
    assert np.array_equal(holed.time, plain.time)


def test_outliers_have_share_and_size_of_settings(measurement):
    plain = measurement("dvl", "{rate: 100 Hz, noise: 0.02}", 100.0).values
    wild = measurement("dvl", "{rate: 100 Hz, noise: 0.02, outlier_probability: 0.05, outlier_size: 3}", 100.0).values
    hit = (wild != plain).any(axis=1)
    assert credible_share(hit.sum(), hit.size, 0.05)
    error = (wild - plain)[hit]
    assert within_chance((error**2).sum() / 3.0**2, error.size)


@pytest.mark.slow
def test_coloured_share_has_autocorrelation_and_keeps_variance(measurement):
    settings = "{rate: 10 Hz, noise: 0.02, coloured_share: 0.6, coloured_time_constant: 0.5 s}"
    rows = np.array([measurement("dvl", settings, 2.0, seed).values.T / 0.02 for seed in range(400)])
    rows = rows.reshape(1200, 21)
    lag = 0.1 * np.abs(np.arange(21)[:, None] - np.arange(21))
    expected = np.where(lag == 0.0, 1.0, 0.6 * np.exp(-lag / 0.5))
    assert (np.abs(rows.T @ rows / 1200 - expected) < 5.0 * np.sqrt((1.0 + expected**2) / 1200)).all()
    assert_allclose(measurement("dvl", settings, 1.0).standard_deviation, 0.02)


def test_vibration_is_sine_with_random_phase(measurement):
    settings = "{rate: 50 Hz, noise: 0, vibration: [0.1, 0.2, 0], vibration_frequency: 3 Hz}"
    phases = []
    for seed in (1, 2):
        record = measurement("gyroscope", settings, 4.0, seed)
        turns = 2.0 * np.pi * 3.0 * record.time
        shape, residual, *_ = np.linalg.lstsq(np.stack([np.sin(turns), np.cos(turns)], axis=1), record.values)
        assert_allclose(np.hypot(*shape), [0.1, 0.2, 0.0], atol=1e-12)
        assert_allclose(residual, 0.0, atol=1e-20)
        phases += np.arctan2(shape[1], shape[0])[:2].tolist()
    assert len(np.unique(np.round(phases, 6))) == 4


@pytest.mark.parametrize("delay", [0.25, -0.25])
def test_delay_shifts_time_stamps_only(delay, measurement):
    settings = "{rate: 20 Hz, noise: 0.02, dropout_probability: 0.1"
    prompt, late = (measurement("dvl", f"{settings}{more}}}", 10.0) for more in ("", f", delay: {delay} s"))
    assert late.time[0] >= 0.0
    assert late.time[-1] <= 10.0
    assert late.time.size == prompt.time.size - 5
    kept = slice(None, -5) if delay > 0.0 else slice(5, None)
    assert_allclose(late.time, prompt.time[kept] + delay)
    assert np.array_equal(late.values, prompt.values[kept], equal_nan=True)


@pytest.mark.slow
def test_delay_spread_is_drawn_per_sensor_and_seed(experiment_with, standing_still):
    spread = [f"sensors.{name}={{rate: 1 Hz, noise: 0, start: 50 s, delay_spread: 1 s}}" for name in RAW]
    suite, truth = experiment_with(*spread).sensors, standing_still(60.0)
    offsets = [
        record.time[0] - 50.0 for seed in range(8) for record in measure(truth, suite, STILL_WATER, seed).values()
    ]
    assert len(np.unique(offsets)) == 32
    assert within_chance(np.sum(np.square(offsets)), 32)


def test_delay_of_ahrs_shifts_time_stamps(simulated_with):
    prompt, late = (
        simulated_with("manoeuvre.duration=3 s", f"sensors.attitude.delay={delay} s").sensors["attitude"]
        for delay in (0.0, 0.5)
    )
    assert_allclose(late.time, prompt.time[:-50] + 0.5)
    assert np.array_equal(late.values, prompt.values[:-50], equal_nan=True)


@pytest.mark.parametrize("changed", RAW)
@pytest.mark.parametrize("change", ["rate=3 Hz", "noise=0.5", "drift=0.1", "start=1 s", *FAULTS])
def test_change_of_one_sensor_keeps_others_bit_identical(changed, change, experiment_with, standing_still):
    truth = standing_still(5.0)
    plain = [f"sensors.{name}={{rate: 20 Hz, noise: 0.01, bias_spread: 0.01}}" for name in RAW]
    before = measure(truth, experiment_with(*plain).sensors, STILL_WATER, 1)
    after = measure(truth, experiment_with(*plain, f"sensors.{changed}.{change}").sensors, STILL_WATER, 1)
    for name in RAW:
        same = np.array_equal(before[name].values, after[name].values, equal_nan=True)
        assert same == (name != changed)


def test_seeds_differ_and_repeat(experiment_with, standing_still):
    suite, truth = experiment_with().sensors, standing_still(1.0)
    for name in RAW:
        first, again, other = (measure(truth, suite, STILL_WATER, seed)[name].values for seed in (1, 1, 2))
        assert np.array_equal(first, again)
        assert not np.any(first == other)


def test_noise_does_not_depend_on_block_size(measurement, monkeypatch):
    whole = measurement("gyroscope", "{rate: 50 Hz, noise: 0.1 deg/s}", 2.0)
    monkeypatch.setattr("auvid_cli.simulation.simulate.BLOCK", 7)
    assert np.array_equal(measurement("gyroscope", "{rate: 50 Hz, noise: 0.1 deg/s}", 2.0).values, whole.values)


def test_sensors_with_equal_clocks_share_times(experiment_with, standing_still):
    records = measure(standing_still(2.0), experiment_with(*NOISELESS).sensors, STILL_WATER, 1)
    assert records["gyroscope"].time is records["accelerometer"].time is records["dvl"].time


def test_sensors_have_independent_noise(experiment_with, standing_still):
    suite = experiment_with(*(f"sensors.{name}={{rate: 20 Hz, noise: 1}}" for name in RAW)).sensors
    records = measure(standing_still(2.0), suite, STILL_WATER, 1)
    drawn = [records[name].values[:, 0] - records[name].values[:, 0].mean() for name in RAW]
    correlation = np.corrcoef(drawn)
    assert np.abs(correlation - np.eye(len(RAW))).max() < 0.75


def test_accelerometer_at_rest_measures_gravity_upwards(experiment_with, standing_still):
    suite = experiment_with(*NOISELESS).sensors
    level = measure(standing_still(1.0), suite, STILL_WATER, 1)["accelerometer"].values
    assert_allclose(level, np.tile([0.0, 0.0, -GRAVITY], (51, 1)), atol=1e-12)
    bow_up = measure(standing_still(1.0, (0.0, np.pi / 6, 1.0)), suite, STILL_WATER, 1)["accelerometer"].values
    assert_allclose(bow_up[0], [GRAVITY / 2, 0.0, -GRAVITY * np.sqrt(0.75)], atol=1e-12)
    to_starboard = measure(standing_still(1.0, (np.pi / 6, 0.0, 0.0)), suite, STILL_WATER, 1)["accelerometer"].values
    assert_allclose(to_starboard[0], [0.0, -GRAVITY / 2, -GRAVITY * np.sqrt(0.75)], atol=1e-12)


def rotation(attitude):
    (a, b, c), (d, e, f) = np.cos(attitude), np.sin(attitude)
    roll = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
    pitch = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    yaw = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    return yaw @ pitch @ roll


@pytest.mark.slow
@pytest.mark.parametrize("sea", ["{}", "{force: {standard_deviation: 5 N}}"])
def test_specific_force_is_acceleration_minus_gravity(sea, fly, experiment_with):
    truth = fly(None, "manoeuvre.duration=40 s", f"manoeuvre.disturbance={sea}")
    suite = experiment_with("sensors.accelerometer={rate: 100 Hz, noise: 0, start: 0.005 s}").sensors
    felt = measure(truth, suite, STILL_WATER, 1)["accelerometer"].values
    over_ground = np.array([rotation(m[6:]) @ m[:3] for m in truth.motion])
    acceleration = np.diff(over_ground, axis=0) / truth.time[1]
    middle = 0.5 * (truth.motion[1:, 6:] + truth.motion[:-1, 6:])
    down = np.array([0.0, 0.0, GRAVITY])
    expected = [rotation(attitude).T @ (a - down) for attitude, a in zip(middle, acceleration, strict=True)]
    assert_allclose(felt[: len(expected)], expected, atol=2e-3)


def test_specific_force_in_steady_turn_is_omega_cross_v_minus_gravity(fly, experiment_with):
    circle = "{type: turning_circle, duration: 120 s, speed: 3 m/s, rudder: -8 deg, approach: 5 s}"
    truth = fly(circle)
    felt = measure(truth, experiment_with(*NOISELESS).sensors, STILL_WATER, 1)["accelerometer"].values[-1]
    motion = truth.motion[-1]
    centripetal = np.cross(motion[3:6], motion[:3])
    assert np.abs(centripetal).max() > 0.2
    assert_allclose(felt, centripetal - rotation(motion[6:]).T @ [0.0, 0.0, GRAVITY], atol=1e-3)


@pytest.mark.slow
def test_specific_force_includes_lever_arm(fly, experiment_with):
    truth, arm = fly(None, "manoeuvre.duration=40 s"), np.array([0.5, -0.3, 0.2])
    stated = "sensors.accelerometer={rate: 100 Hz, noise: 0, start: 0.005 s, position: [50 cm, -30 cm, 20 cm]}"
    record = measure(truth, experiment_with(stated).sensors, STILL_WATER, 1)["accelerometer"]
    over_ground = np.array([rotation(m[6:]) @ (m[:3] + np.cross(m[3:6], arm)) for m in truth.motion])
    acceleration = np.diff(over_ground, axis=0) / truth.time[1]
    middle = 0.5 * (truth.motion[1:, 6:] + truth.motion[:-1, 6:])
    down = np.array([0.0, 0.0, GRAVITY])
    expected = [rotation(attitude).T @ (a - down) for attitude, a in zip(middle, acceleration, strict=True)]
    assert_allclose(record.values[: len(expected)], expected, atol=2e-3)
    assert record.position == tuple(arm)


def test_magnetic_field_is_earth_field_in_body_axes(fly, experiment_with):
    truth = fly(None, "manoeuvre.duration=20 s")
    field = "{rate: 10 Hz, noise: 0, strength: 50 uT, declination: 90 deg, dip: 60 deg}"
    suite = experiment_with(f"sensors.magnetic_field={field}").sensors
    record = measure(truth, suite, STILL_WATER, 1)["magnetic_field"]
    assert_allclose(record.earth_field, [0.0, 25e-6, 50e-6 * np.sin(np.pi / 3)], atol=1e-18)
    expected = [rotation(m[6:]).T @ record.earth_field for m in sample_motion(truth, record.time)[0]]
    assert_allclose(record.values, expected, atol=1e-12)


def test_other_sensors_measure_the_motion(fly, experiment_with):
    truth = fly(None, "manoeuvre.duration=60 s")
    direct = "sensors.attitude={source: direct, rate: 50 Hz, noise: 0}"
    records = measure(truth, experiment_with(*NOISELESS, direct).sensors, STILL_WATER, 1)
    every_other = truth.motion[::2]
    assert every_other[-1, 8] > np.pi, "the test should turn past south"
    assert_allclose(records["gyroscope"].values, every_other[:, 3:6], atol=1e-12)
    assert_allclose(records["dvl"].values, every_other[:, :3], atol=1e-12)
    assert_allclose(records["attitude"].values[:, :2], every_other[:, 6:8], atol=1e-12)
    for heading in (records["magnetometer"].values[:, 0], records["attitude"].values[:, 2]):
        assert np.all(np.abs(heading) <= np.pi)
        assert_allclose(np.exp(1j * heading), np.exp(1j * every_other[:, 8]), atol=1e-12)
