"""The written accelerations against the core, by the derivative of the velocity of the centre of gravity.

The package of that name in the registry has no simulator in it, so that what HoloOcean gives and takes is by its
documentation: a global frame north, west, up, and quaternions x, y, z, w.
"""

import runpy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from auvid_cli.config.enums import FormatName
from auvid_cli.export.formats import FORMATS, holoocean_text
from auvid_cli.vehicle.rigid_body import rotation_matrix

HALF_TURN = np.diag([1.0, -1.0, -1.0])


def read(model, folder):
    path = folder / "model.py"
    path.write_text(holoocean_text(model, FORMATS[FormatName.HOLOOCEAN].unsupported(model), "model"), encoding="utf-8")
    return runpy.run_path(str(path))


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def sensor_of(motion, centre):
    """Output of the DynamicsSensor for a motion; unused accelerations and position are NaN."""
    to_earth = HALF_TURN @ body_to_ned(motion[6:9])
    velocity = to_earth @ (motion[:3] + np.cross(motion[3:6], centre))
    turning = to_earth @ motion[3:6]
    quaternion = Rotation.from_matrix(to_earth @ HALF_TURN).as_quat()
    nothing = np.full(3, np.nan)
    return np.concatenate([nothing, velocity, nothing, nothing, turning, quaternion])


def body_to_ned(angles):
    return Rotation.from_euler("ZYX", angles[::-1]).as_matrix()


def expected(slope, motion, centre):
    """Derivative of what turns to the global frame: R (v + omega x c) and R omega, where R' = R [omega]."""
    rotation, rates = HALF_TURN @ body_to_ned(motion[6:9]), motion[3:6]
    at_centre = motion[:3] + np.cross(rates, centre)
    linear = rotation @ (skew(rates) @ at_centre + slope[:3] + np.cross(slope[3:6], centre))
    return np.concatenate([linear, rotation @ slope[3:6]])


def assert_same(module, model, motion, inputs, derivative_of):
    parameters = model.experiment.vehicle.known_parameters()
    centre = np.array([parameters[symbol] for symbol in ("xG", "yG", "zG")])
    wanted = expected(derivative_of(model, motion, inputs), motion, centre)
    found = module["accelerations"](sensor_of(motion, centre), inputs)
    assert_allclose(found, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


@pytest.fixture(scope="module")
def module(skewed, tmp_path_factory):
    return read(skewed, tmp_path_factory.mktemp("holoocean"))


@given(seed=st.integers(0, 2**32 - 1))
def test_holoocean_acceleration_equals_the_core(seed, module, skewed, derivative_of, draw):
    assert_same(module, skewed, *draw(seed), derivative_of)


def test_holoocean_modules_of_shipped_vehicles_equal_the_core(vehicle_file, model_with, derivative_of, draw, tmp_path):
    model = model_with(vehicle_file=vehicle_file)
    assert_same(read(model, tmp_path), model, *draw(7), derivative_of)


def test_millisecond_steps_follow_the_core(module, skewed, derivative_of):
    """Without a formula for the acceleration: positions and quaternions stepped on as HoloOcean does."""
    parameters = skewed.experiment.vehicle.known_parameters()
    centre = np.array([parameters[symbol] for symbol in ("xG", "yG", "zG")])
    motion, inputs, step = (
        np.array([2.0, 0.1, -0.1, 0.1, 0.2, -0.3, 0.1, -0.2, 0.7]),
        np.array([0.1, -0.1, 40, 0.5]),
        1e-3,
    )
    state = sensor_of(motion, centre)
    for _ in range(200):
        acceleration = module["accelerations"](state, inputs)
        state[3:6] += step * acceleration[:3]
        state[12:15] += step * acceleration[3:]
        turn = Rotation.from_rotvec(step * state[12:15])
        state[15:19] = (turn * Rotation.from_quat(state[15:19])).as_quat()
        slopes = [derivative_of(skewed, motion, inputs)]
        slopes.append(derivative_of(skewed, motion + step * slopes[0], inputs))
        motion = motion + step * sum(slopes) / 2.0
    assert_allclose(state[3:6], sensor_of(motion, centre)[3:6], atol=2e-3)
    assert_allclose(state[12:15], sensor_of(motion, centre)[12:15], atol=2e-3)


def test_rotations_equal_the_core():
    angles = np.array([0.3, -0.5, 2.0])
    assert_allclose(body_to_ned(angles), rotation_matrix(angles), atol=1e-15)
