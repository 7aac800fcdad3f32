"""Where predictions start: the motion, from the measurements so far."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.identification.prepared_data import prepare
from auvid_cli.validation.initial_states import filtered_initial_states, own_of_each_run, with_model
from auvid_cli.vehicle.rigid_body import Ballast

from .conftest import DEPTH

WHITE = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}"
ZIGZAG = "manoeuvre={type: zigzag, duration: 40 s, speed: 3.9 m/s, rudder: 20 deg, heading: 20 deg, approach: 5 s}"


def with_readings(dataset, name, change):
    record = dataset.sensors[name]
    time, values = change(record.time, record.values)
    return replace(dataset, sensors=dataset.sensors | {name: replace(record, time=time, values=values)})


def test_starts_are_near_truth_within_deviation(simulated_with, with_coefficients):
    # The truth between inputs is interpolated.
    rates = "manoeuvre.input_rate=100 Hz", "sensors.gyroscope.rate=100 Hz"
    zigzag = simulated_with(ZIGZAG, "manoeuvre.duration=80 s", WHITE, DEPTH, *rates, "seed=31")
    wanted = np.linspace(5.0, 75.0, 200)
    states = filtered_initial_states(prepare(with_model(zigzag, with_coefficients(zigzag.truth.coefficients))), wanted)
    assert_allclose(states.time, wanted, atol=0.011)
    truth = np.column_stack([zigzag.truth.motion, zigzag.truth.position[:, 2]])
    true = np.stack([np.interp(states.time, zigzag.truth.time, column) for column in truth.T], axis=1)
    sigmas = (states.motion - true) / states.deviation
    assert np.abs(sigmas).max() < 5.0
    assert np.all(states.deviation < 0.01)
    assert states.status == "completed"
    assert states.noise_factor == 1.0
    assert_allclose(list(states.nis.values()), 1.0, atol=0.1)


def test_unmeasured_depth_is_zero(zigzag, with_coefficients):
    blind = replace(zigzag, sensors={name: r for name, r in zigzag.sensors.items() if name != "depth"})
    model = with_coefficients(zigzag.truth.coefficients)
    states = filtered_initial_states(prepare(with_model(blind, model)), np.array([10.0, 20.0]))
    assert not states.motion[:, 9].any()
    assert not states.deviation[:, 9].any()
    assert states.process_noise[9] == 0.0 < states.process_noise[:9].min()


def test_starts_ignore_later_measurements(zigzag, with_coefficients):
    # Smaller than the noise, so that the process noise stays.
    def spoilt(time, values):
        return time, np.where(time[:, None] > 40.0, values + 5e-4, values)

    wanted = np.array([10.0, 39.0, 41.0])
    model = with_coefficients(zigzag.truth.coefficients)
    sound, other = (
        filtered_initial_states(prepare(with_model(dataset, model)), wanted)
        for dataset in (zigzag, with_readings(zigzag, "dvl", spoilt))
    )
    np.testing.assert_array_equal(other.motion[:2], sound.motion[:2])
    assert np.abs(other.motion[2] - sound.motion[2]).max() > 1e-5


def test_wrong_model_gets_more_process_noise(zigzag, with_coefficients):
    true = zigzag.truth.coefficients
    wrong = with_model(zigzag, with_coefficients(true, N_uudr=-true["N_uudr"]))
    states = filtered_initial_states(prepare(wrong), np.linspace(10.0, 75.0, 100))
    assert states.noise_factor > 1.0
    assert max(states.nis.values()) > 100.0
    r = np.interp(states.time, zigzag.truth.time, zigzag.truth.motion[:, 5])
    assert np.sqrt(np.square(states.motion[:, 5] - r).mean()) < 0.02


def test_starts_at_one_event_are_merged(zigzag, with_coefficients):
    sparse = replace(zigzag, sensors={"dvl": zigzag.sensors["dvl"]})
    states = filtered_initial_states(
        prepare(with_model(sparse, with_coefficients(zigzag.truth.coefficients))), np.linspace(5.0, 7.0, 1000)
    )
    assert 10 < states.time.size < 20
    assert (np.diff(states.time) > 0.0).all()


def test_estimated_ballast_is_part_of_the_model(zigzag, with_coefficients, experiment_with):
    true = zigzag.experiment.vehicle.known_parameters()
    stated = Ballast(-5.0, 1.5).added_to(true)
    settings = (f"vehicle.parameters.{symbol}={stated[symbol]!r}" for symbol in ("B", "xB"))
    asked = experiment_with(*settings, "identification.estimate.biases=[ballast, gyro]")
    blind = replace(with_coefficients(zigzag.truth.coefficients), experiment=asked)
    mean = np.hstack([blind.mean, np.tile([5.0, -1.5], (len(blind.mean), 1))])
    seeing = replace(blind, state=(*blind.state, *Ballast._fields), mean=mean)
    for estimate, expected in ((blind, stated), (seeing, true)):
        model = with_model(zigzag, estimate).experiment
        assert model.vehicle.known_parameters() == pytest.approx(expected)
        assert model.identification.estimate.biases == ("gyro",)


def test_walking_trim_is_estimated_in_each_run(simulated_with, with_coefficients, experiment_with):
    """The trim was -2 deg in the estimate's run and is 1.5 deg in this one; the ballast is 4 N more."""
    blocks = "{biases: [fin_trim, ballast], fin_trim: {walk: 1e-5}, ballast: {buoyancy_walk: 1e-3}}"
    trimmed = simulated_with(ZIGZAG, WHITE, "manoeuvre.fin_trim={rudder: 1.5 deg}")
    estimate = with_coefficients(trimmed.truth.coefficients)
    mean = np.hstack([estimate.mean, np.tile([np.deg2rad(-2.0), 0.0, 5.0, -1.0], (len(estimate.mean), 1))])
    state = (*estimate.state, "rudder_trim", "elevator_trim", *Ballast._fields)
    constant, walking = (
        replace(estimate, state=state, mean=mean, experiment=experiment_with(f"identification.estimate={asked}"))
        for asked in ("{biases: [fin_trim, ballast]}", blocks)
    )
    assert_allclose(with_model(trimmed, constant).inputs.values[:, 0], trimmed.inputs.values[:, 0] - np.deg2rad(2.0))
    for own in (with_model(trimmed, walking), with_model(trimmed, constant, anew=True)):
        assert_allclose(own.inputs.values, trimmed.inputs.values)
        assert own.experiment.vehicle.known_parameters() == trimmed.experiment.vehicle.known_parameters()
        states = filtered_initial_states(prepare(own), np.array([5.0, 35.0]))
        late = states.vehicle[-1] - [1.0, np.deg2rad(1.5), 0.0, 0.0, 0.0]
        assert np.abs(late / np.maximum(states.vehicle_deviation[-1], 1e-9)).max() < 4.0
        assert states.vehicle_deviation[-1, 1] < np.deg2rad(0.1)
        assert states.final_vehicle[1] == pytest.approx(np.deg2rad(1.5), abs=np.deg2rad(0.3))
    blind = filtered_initial_states(prepare(with_model(trimmed, constant)), np.array([5.0, 35.0]))
    assert_allclose(blind.vehicle, np.tile([1.0, 0.0, 0.0, 0.0, 0.0], (2, 1)))


def test_mounting_of_the_dvl_is_that_of_the_estimate(zigzag, with_coefficients, experiment_with):
    """A DVL turned to starboard by 3 deg sees forward motion as motion to port."""
    estimate = with_coefficients(zigzag.truth.coefficients)
    mean = np.hstack([estimate.mean, np.tile([0.02, np.deg2rad(3.0)], (len(estimate.mean), 1))])
    state = (*estimate.state, "dvl_scale", "dvl_yaw")
    constant, walking = (
        with_model(zigzag, replace(estimate, state=state, mean=mean, experiment=experiment_with(asked)))
        for asked in (
            "identification.estimate.biases=[dvl]",
            "identification.estimate={biases: [dvl], dvl: {yaw_walk: 1e-4}}",
        )
    )
    assert constant.experiment.identification.estimate.biases == ()
    read, true = zigzag.sensors["dvl"].values, constant.sensors["dvl"].values
    speed, angle = (np.hypot(values[:, 0], values[:, 1]) for values in (read, true)), np.arctan2(read[:, 1], read[:, 0])
    assert_allclose(next(speed), 1.02 * next(speed))
    assert_allclose(np.arctan2(true[:, 1], true[:, 0]) - angle, np.deg2rad(3.0), atol=1e-12)
    assert_allclose(read[:, 2], 1.02 * true[:, 2])
    assert walking.experiment.identification.estimate.biases == ("dvl",)
    assert_allclose(walking.sensors["dvl"].values, read)


def test_walking_blocks_differ_in_each_run(experiment_with):
    asked = "{biases: [fin_trim, ballast, gyro, delay], ballast: {buoyancy_walk: 1e-3}}"
    settings = experiment_with(f"identification.estimate={asked}").identification
    assert own_of_each_run(settings) == ("ballast",)
    assert own_of_each_run(settings, anew=True) == ("fin_trim", "ballast")
