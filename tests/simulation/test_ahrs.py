"""Attitude of the AHRS against the true attitude."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.arrays import wrap
from auvid_cli.errors import SimulationError
from auvid_cli.simulation.ahrs import attitude_reference
from auvid_cli.simulation.simulate import measure, simulate

STRAIGHT = "manoeuvre={type: multisine, duration: 60 s, speed: 2 m/s}"
NOISELESS = tuple(
    f"sensors.{name}={{rate: {rate} Hz, noise: 0}}"
    for name, rate in (("gyroscope", 100), ("accelerometer", 100), ("magnetometer", 10), ("dvl", 7))
)


def error_in_degrees(attitude, truth):
    """Return the errors of roll, pitch and yaw, wrapped; the attitude has the ticks of the truth."""
    difference = attitude.values - truth.motion[:, 6:9]
    return np.rad2deg((difference + np.pi) % (2 * np.pi) - np.pi)


def rms(error):
    return np.sqrt(np.nanmean(error**2, axis=0))


@pytest.fixture(scope="module")
def spiral(simulated_with):
    return simulated_with("manoeuvre.duration=120 s")


def test_perfect_sensors_on_straight_run_give_true_attitude(simulated_with):
    dataset = simulated_with(STRAIGHT, *NOISELESS)
    error = error_in_degrees(dataset.sensors["attitude"], dataset.truth)
    assert np.isfinite(error[20:]).all()
    assert np.nanmax(np.abs(error)) < 1e-9


def test_perfect_sensors_on_straight_climb_give_true_attitude(simulated_with):
    climb = "manoeuvre={type: spiral, duration: 60 s, speed: 2 m/s, turn_rate: 0, pitch: 20 deg, initial_pitch: 20 deg}"
    dataset = simulated_with(climb, *NOISELESS)
    error = error_in_degrees(dataset.sensors["attitude"], dataset.truth)
    assert np.rad2deg(dataset.truth.motion[-1, 7]) == pytest.approx(20.0, abs=1.0)
    assert np.abs(error[-1000:]).max() < 0.01


def test_attitude_error_in_spiral_is_below_a_degree(spiral):
    error = rms(error_in_degrees(spiral.sensors["attitude"], spiral.truth))
    assert np.all(error < 0.3)
    # Smaller than the 0.5 deg of the magnetometer alone.
    assert error[2] < 0.25


def without_velocity(dataset):
    dvl = dataset.sensors["dvl"]
    blind = dataset.sensors | {"dvl": replace(dvl, values=np.zeros_like(dvl.values))}
    return attitude_reference(blind, dataset.experiment.sensors.ahrs(), dataset.sensors["attitude"].time)


def test_tilt_error_in_steady_turn_is_much_larger_without_dvl(simulated_with):
    circle = "{type: turning_circle, duration: 200 s, speed: 3 m/s, rudder: -8 deg, approach: 5 s}"
    dataset = simulated_with(f"manoeuvre={circle}")
    good = rms(error_in_degrees(dataset.sensors["attitude"], dataset.truth))
    bad = rms(error_in_degrees(without_velocity(dataset), dataset.truth))
    assert np.all(good < 0.1)
    assert np.all(bad[:2] > 5.0 * good[:2])


def test_tilt_error_in_spiral_is_larger_without_dvl(spiral):
    good = rms(error_in_degrees(spiral.sensors["attitude"], spiral.truth))
    bad = rms(error_in_degrees(without_velocity(spiral), spiral.truth))
    assert np.hypot(*bad[:2]) > 1.2 * np.hypot(*good[:2])


def test_heading_is_smooth_across_wrap(spiral):
    heading = spiral.sensors["attitude"].values[:, 2]
    heading = heading[np.isfinite(heading)]
    jumps = np.abs(np.diff(heading)) > np.pi
    assert jumps.sum() >= 2, "the test should cross north-south more than once"
    assert np.all(np.abs(heading) <= np.pi)
    steps = np.diff(np.unwrap(heading))
    assert np.rad2deg(np.abs(steps).max()) < 2.0
    error = np.abs(error_in_degrees(spiral.sensors["attitude"], spiral.truth)[:, 2])
    crossing = np.abs(np.abs(np.nan_to_num(spiral.sensors["attitude"].values[:, 2])) - np.pi) < 0.05
    assert error[crossing].max() < 1.5


def test_heading_noise_across_180_degrees_gives_south(standing_still, experiment_with):
    suite = experiment_with("sensors.magnetometer={rate: 10 Hz, noise: 0.5 deg}").sensors
    records = measure(standing_still(60.0, (0.1, -0.05, np.pi)), suite, np.zeros(3), 1)
    compass = replace(records["magnetometer"], values=wrap(records["magnetometer"].values))
    flickers = np.abs(np.diff(compass.values[:, 0])) > np.pi
    assert flickers.sum() > 100
    attitude = attitude_reference(records | {"magnetometer": compass}, suite.ahrs(), records["gyroscope"].time)
    heading = attitude.values[np.isfinite(attitude.values[:, 2]), 2]
    assert np.rad2deg(np.abs(np.angle(-np.exp(1j * heading)))).max() < 2.0


def test_gyro_bias_is_estimated_if_expected(experiment_with):
    biased = ("manoeuvre.duration=120 s", "sensors.gyroscope.bias=0.5 deg/s")
    late = slice(6000, None)
    errors = {}
    for expected in ("0", "0.5 deg/s"):
        dataset = simulate(experiment_with(*biased, f"sensors.attitude.ahrs.gyro_bias={expected}"))
        errors[expected] = rms(error_in_degrees(dataset.sensors["attitude"], dataset.truth)[late])
    assert np.all(errors["0.5 deg/s"] < 0.35)
    assert errors["0"].max() > 3.0 * errors["0.5 deg/s"].max()


def test_lost_samples_keep_attitude_accurate(simulated_with):
    names = ("gyroscope", "accelerometer", "magnetometer", "dvl")
    holes = (f"sensors.{name}.dropout_probability=0.2" for name in names)
    dataset = simulated_with("manoeuvre.duration=60 s", *holes)
    attitude = dataset.sensors["attitude"]
    assert np.isfinite(attitude.values[100:]).all()
    assert np.all(rms(error_in_degrees(attitude, dataset.truth)) < 0.6)


def test_attitude_is_missing_before_first_samples_of_all_sensors(simulated_with):
    dataset = simulated_with("manoeuvre.duration=10 s", "sensors.magnetometer.start=3 s")
    attitude = dataset.sensors["attitude"]
    early = attitude.time < 3.0 - 1e-9
    assert np.isnan(attitude.values[early]).all()
    assert np.isfinite(attitude.values[attitude.time > 3.05]).all()


@pytest.mark.parametrize("silent", ["gyroscope", "accelerometer", "magnetometer", "dvl"])
def test_missing_sensor_raises(silent, simulated_with):
    with pytest.raises(SimulationError, match="AHRS needs"):
        simulated_with("manoeuvre.duration=5 s", f"sensors.{silent}.start=6 s")


def test_standard_deviation_is_that_of_settings(spiral):
    assert np.rad2deg(spiral.sensors["attitude"].standard_deviation) == pytest.approx([1.0, 1.0, 1.0])
