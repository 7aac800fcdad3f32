"""Predicted measurements of DVL, accelerometer and magnetometer, and their derivatives, against other libraries."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from auvid_cli.config.extra_states import AugmentedStates
from auvid_cli.config.identification import Identification
from auvid_cli.evaluation.free_run import VELOCITY_ERRORS, measured_velocity, velocity_through_water
from auvid_cli.identification.compiled_layout import KnownSensor, KnownSensors
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.sensors import linearise, observe, refuse_unknown
from auvid_cli.identification.states import state_layout
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.equations import factors, motion_derivative, vehicle_constants
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, ActuatorErrors
from auvid_cli.vehicle.rigid_body import GRAVITY, mass_matrix

DVL, ACCELEROMETER, POSITION = 0, 1, (0.4, -0.2, 0.1)
MAGNETOMETER, FIELD = 2, (0.6, -0.3, 1.1)
MOTION = np.array([2.0, 0.1, -0.1, 0.02, 0.03, -0.05, 0.1, -0.2, 0.3])


INPUTS = np.array([0.1, -0.15, 40.0, 0.5])


def process_and_layout(asked, has_depth, experiment, **given):
    """With two coefficients, unless others are given."""
    settings = Identification(**{"coefficients": ("X_u|u|", "N_uvl"), "estimate": asked} | given)
    layout = state_layout(settings, experiment.vehicle, ("depth",) if has_depth else ())
    held = experiment.vehicle.coefficients.by_symbol()
    position = KnownSensors(KnownSensor(ACCELEROMETER, POSITION), KnownSensor(MAGNETOMETER, FIELD))
    process = vehicle_process(vehicle_constants(experiment.vehicle.known_parameters()), held, layout, position)
    return process._replace(observe=observe, linearise=linearise), layout


def linearised(process, state, sensor):
    predicted, matrix = np.full(3, np.nan), np.full((3, state.size), np.nan)
    model = process.constants, process.selection
    process.linearise(state, sensor, INPUTS, *model, predicted, matrix, np.zeros(process.scratch_size))
    return predicted, matrix


def assert_seen_alike(process, state, n_parameters, expected, sensor=DVL):
    """By both kinds of filter, and the derivative is that of what is predicted."""
    predicted, matrix = linearised(process, state, sensor)
    assert_allclose(predicted, expected, rtol=1e-12)
    for j in range(state.size):
        step = np.zeros(state.size)
        step[j] = 1e-6
        difference = (
            linearised(process, state + step, sensor)[0] - linearised(process, state - step, sensor)[0]
        ) / 2e-6
        assert_allclose(matrix[:, j], difference, rtol=1e-7, atol=1e-7)

    block = np.repeat(state[:, None], LANES, axis=1)
    moving, parameters = block[n_parameters:].ravel(), block[:n_parameters].ravel()
    by_points = np.zeros(3 * LANES)
    model = process.constants, process.selection
    process.observe(moving, parameters, sensor, INPUTS, *model, 5, by_points, np.zeros(process.scratch_size))
    assert_allclose(by_points.reshape(3, LANES)[:, :5], np.repeat(expected[:, None], 5, axis=1), rtol=1e-9)


@pytest.mark.parametrize(
    "walks", [{}, {"scale_walk": 1e-3}, {"yaw_walk": 1e-3}, {"scale_walk": 1e-3, "yaw_walk": 1e-3}]
)
def test_a_dvl_with_scale_error_and_mounting_yaw(walks, experiment_with):
    process, layout = process_and_layout(AugmentedStates(biases=("gyro", "dvl"), dvl=walks), False, experiment_with())
    symbols, n_parameters = layout.symbols, layout.n_parameters
    assert symbols[n_parameters] == "u"
    assert process.noise_density.size == len(symbols) - n_parameters
    values = dict(zip(MOTION_SYMBOLS, MOTION, strict=True)) | {"dvl_scale": 0.03, "dvl_yaw": -0.2}
    state = np.array([values.get(symbol, 0.7) for symbol in symbols])
    expected = 1.03 * np.array([np.cos(0.2) * 2.0 - np.sin(0.2) * 0.1, np.sin(0.2) * 2.0 + np.cos(0.2) * 0.1, -0.1])
    assert_seen_alike(process, state, n_parameters, expected)


@pytest.mark.parametrize("blocks", [("current",), ("dvl", "current")])
@pytest.mark.parametrize("walk", [0.0, 1e-3])
@pytest.mark.parametrize("has_depth", [False, True])
def test_a_dvl_over_ground_sees_the_current(blocks, walk, has_depth, experiment_with):
    """As scipy turns it."""
    asked = AugmentedStates(biases=blocks, current={"walk": walk})
    process, layout = process_and_layout(asked, has_depth, experiment_with())
    symbols, n_parameters = layout.symbols, layout.n_parameters
    assert ("down" in symbols) == has_depth
    current = {"current_north": 0.3, "current_east": -0.4}
    values = dict(zip(MOTION_SYMBOLS, MOTION, strict=True)) | current
    state = np.array([values.get(symbol, 0.0) for symbol in symbols])
    turn = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1])
    expected = MOTION[:3] + turn.apply([0.3, -0.4, 0.0], inverse=True)
    assert_seen_alike(process, state, n_parameters, expected)


@pytest.mark.parametrize("walk", [0.0, 1e-3])
def test_dvl_off_the_origin_measures_its_lever_arm(walk, experiment_with):
    arm = {"dvl_x": 0.4, "dvl_y": -0.2, "dvl_z": 0.1}
    asked = AugmentedStates(
        biases=("dvl", "dvl_arm", "current"), dvl_arm={"axes": ("x", "y", "z")}, current={"walk": walk}
    )
    process, layout = process_and_layout(asked, False, experiment_with())
    symbols = layout.symbols
    values = dict(zip(MOTION_SYMBOLS, MOTION, strict=True)) | arm | {"dvl_scale": 0.05, "dvl_yaw": 0.1}
    state = np.array([values.get(symbol, 0.0) for symbol in symbols])
    carried = MOTION[:3] + np.cross(MOTION[3:6], [*arm.values()])
    expected = 1.05 * Rotation.from_euler("z", 0.1).apply(carried, inverse=True)
    assert_seen_alike(process, state, layout.n_parameters, expected)
    errors = np.array([values.get(symbol, 0.0) for symbol in VELOCITY_ERRORS])
    assert_allclose(measured_velocity(MOTION, errors), expected, rtol=1e-12)
    assert_allclose(velocity_through_water(np.concatenate([expected, MOTION[3:]]), errors), MOTION[:3], rtol=1e-12)


def felt_by_a_passenger(experiment, coefficients, thrust, force=0.0):
    """The second derivative of its place in the earth, by differences along the motion of the model, less gravity."""
    constants = vehicle_constants(experiment.vehicle.known_parameters())
    row, slope = np.repeat(factors(coefficients, ActuatorErrors(thrust)), LANES), np.zeros(9 * LANES)
    motion_derivative(np.repeat(MOTION, LANES), row, INPUTS, constants, 1, slope)
    rate = slope.reshape(9, LANES)[:, 0]
    rate[:6] += np.linalg.inv(mass_matrix(experiment.vehicle.known_parameters())) @ np.full(6, force)

    def velocity(motion):
        turn = Rotation.from_euler("ZYX", motion[:5:-1])
        return turn.apply(motion[:3] + np.cross(motion[3:6], POSITION))

    in_earth = (velocity(MOTION + 1e-6 * rate) - velocity(MOTION - 1e-6 * rate)) / 2e-6
    return Rotation.from_euler("ZYX", MOTION[:5:-1]).apply(in_earth - [0.0, 0.0, GRAVITY], inverse=True)


@pytest.mark.parametrize("coefficients", ["all", ("X_u|u|", "M_uude")])
@pytest.mark.parametrize("walk", [0.0, 1e-3])
@pytest.mark.parametrize("has_depth", [False, True])
def test_accelerometer_measures_specific_force_at_its_position(coefficients, walk, has_depth, experiment_with):
    experiment = experiment_with()
    asked = AugmentedStates(
        biases=("thrust", "accelerometer", "accelerometer_scale", "gyro"),
        accelerometer={"walk": walk},
        accelerometer_scale={"walk": walk},
        thrust={"walk": walk},
    )
    process, layout = process_and_layout(
        asked, has_depth, experiment, coefficients=coefficients, attitude_from="inertial"
    )
    true = experiment.vehicle.coefficients.by_symbol()
    errors = {"thrust_scale": 0.2, "bias_fx": 0.03, "bias_fy": -0.02, "bias_fz": 0.01}
    errors |= {"scale_fx": 0.02, "scale_fy": -0.01, "scale_fz": 0.03}
    values = dict(zip(MOTION_SYMBOLS, MOTION, strict=True)) | errors
    values |= {symbol: 1.3 * true[symbol] for symbol in layout.symbols if symbol in SYMBOLS}
    state = np.array([values.get(symbol, 0.7) for symbol in layout.symbols]) / layout.scale
    felt = felt_by_a_passenger(experiment, {symbol: values.get(symbol, true[symbol]) for symbol in SYMBOLS}, 1.2)
    predicted, _ = linearised(process, state, ACCELEROMETER)
    scaled = np.array([1.02, 0.99, 1.03]) * felt
    assert_allclose(predicted, scaled + np.array([0.03, -0.02, 0.01]), rtol=1e-7, atol=1e-7)
    assert_seen_alike(process, state, layout.n_parameters, predicted, ACCELEROMETER)


def test_accelerometer_measures_disturbances(experiment_with):
    experiment, size = experiment_with(), {"standard_deviation": 1.0}
    asked = AugmentedStates(biases=("accelerometer_scale", "disturbance"), disturbance={"force": size, "moment": size})
    process, layout = process_and_layout(asked, False, experiment, attitude_from="inertial")
    true = experiment.vehicle.coefficients.by_symbol()
    values = true | dict(zip(MOTION_SYMBOLS, MOTION, strict=True)) | {"scale_fx": 0.0, "scale_fy": 0.0, "scale_fz": 0.1}
    state = np.array([values.get(symbol, 0.7) for symbol in layout.symbols]) / layout.scale
    felt = felt_by_a_passenger(experiment, true, 1.0, force=0.7) * [1.0, 1.0, 1.1]
    predicted, _ = linearised(process, state, ACCELEROMETER)
    assert_allclose(predicted, felt, rtol=1e-7, atol=1e-7)
    assert_seen_alike(process, state, layout.n_parameters, predicted, ACCELEROMETER)


@pytest.mark.parametrize("walk", [0.0, 1e-3])
@pytest.mark.parametrize("has_depth", [False, True])
def test_magnetometer_measures_field_and_bias(walk, has_depth, experiment_with):
    asked = AugmentedStates(biases=("magnetic_field", "thrust"), magnetic_field={"walk": walk})
    process, layout = process_and_layout(asked, has_depth, experiment_with(), attitude_from="inertial")
    values = dict(zip(MOTION_SYMBOLS, MOTION, strict=True)) | {"bias_mx": 0.2, "bias_my": -0.1, "bias_mz": 0.05}
    state = np.array([values.get(symbol, 0.7) for symbol in layout.symbols]) / layout.scale
    seen = Rotation.from_euler("ZYX", MOTION[:5:-1]).apply(FIELD, inverse=True) + np.array([0.2, -0.1, 0.05])
    assert_seen_alike(process, state, layout.n_parameters, seen, MAGNETOMETER)


def test_nonlinear_sensor_without_compiled_prediction_is_refused():
    refuse_unknown(["dvl", "accelerometer", "magnetic_field"])
    with pytest.raises(TypeError, match="gyroscope"):
        refuse_unknown(["dvl", "gyroscope"])
