"""A motion and what sensors with errors say of it, against rotations of another library."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from auvid_cli.evaluation.free_run import MeasurementErrors, estimated_errors, measured_motion, motion_behind

SCALE, YAW, NORTH, EAST = 0.03, 0.08, 0.3, -0.2
ARM = np.array([0.4, -0.2, 0.1])
ERRORS = MeasurementErrors(0.01 * np.arange(10.0), np.array([SCALE, YAW, NORTH, EAST, *ARM]))


@pytest.fixture
def motion(rng):
    """Rows of any velocity and attitude."""
    return rng.uniform([-4.0] * 6 + [-3.0, -1.5, -9.0], [4.0] * 6 + [3.0, 1.5, 9.0], size=(50, 9))


def test_a_dvl_sees_the_ground_turned_by_its_mounting_and_scaled(motion):
    attitude = Rotation.from_euler("ZYX", motion[:, 8:5:-1])
    over_ground = motion[:, :3] + attitude.apply([NORTH, EAST, 0.0], inverse=True) + np.cross(motion[:, 3:6], ARM)
    seen = (1.0 + SCALE) * Rotation.from_euler("z", YAW).apply(over_ground, inverse=True)
    read = measured_motion(motion, ERRORS)
    assert_allclose(read[:, :3], seen + ERRORS.offset[:3], rtol=1e-13, atol=1e-13)
    assert_array_equal(read[:, 3:], motion[:, 3:] + ERRORS.offset[3:9])


def test_a_measurement_leads_back_to_its_motion(motion):
    assert_allclose(motion_behind(measured_motion(motion, ERRORS), ERRORS), motion, rtol=1e-12, atol=1e-12)


def test_a_depth_behind_the_motion_is_read_beside_it(motion):
    with_depth = np.column_stack([motion, np.arange(50.0)])
    read = measured_motion(with_depth, ERRORS)
    assert_array_equal(read, np.column_stack([measured_motion(motion, ERRORS), np.arange(50.0) + ERRORS.offset[9]]))
    assert_allclose(motion_behind(read, ERRORS), with_depth, rtol=1e-12, atol=1e-12)


def test_rows_may_stand_side_by_side(motion):
    assert_array_equal(
        measured_motion(motion.reshape(5, 10, 9), ERRORS).reshape(50, 9), measured_motion(motion, ERRORS)
    )
    assert_allclose(measured_motion(motion[7], ERRORS), measured_motion(motion, ERRORS)[7], rtol=1e-14)


def test_without_errors_a_motion_is_read_as_it_is(motion):
    nothing = estimated_errors(("u", "v"), np.array([1.0, 2.0]))
    assert_array_equal(measured_motion(motion, nothing), motion)


def test_a_model_that_blew_up_is_no_measurement(motion):
    motion[3] = np.inf
    read = measured_motion(motion, ERRORS)
    assert not np.isfinite(read[3]).any()
    assert np.isfinite(np.delete(read, 3, axis=0)).all()


def test_errors_are_found_by_name_wherever_they_stand():
    state = ("X_u|u|", "current_east", "u", "psi", "dvl_yaw", "bias_psi", "current_north", "bias_p", "dvl_z")
    errors = estimated_errors(state, np.arange(1.0, 10.0))
    assert_array_equal(errors.dvl, [0.0, 5.0, 7.0, 2.0, 0.0, 0.0, 9.0])
    assert_array_equal(errors.offset, [0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 6.0, 0.0])
