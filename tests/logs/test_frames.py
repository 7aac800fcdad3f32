import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from auvid_cli.logs.frames import (
    ENU_TO_NED,
    FLU_TO_FRD,
    euler_of_quaternion,
    product,
    quaternion_of_euler,
    rotate,
    rotation,
)

ANGLES = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.55, 1.55), st.floats(-3.1, 3.1))


def scipy_rotation(angles):
    roll, pitch, yaw = np.transpose(angles)
    return Rotation.from_euler("ZYX", np.column_stack((yaw, pitch, roll)))


@given(ANGLES)
def test_quaternions_are_those_of_scipy(angles):
    ours = quaternion_of_euler(np.array([angles]))[0]
    theirs = scipy_rotation([angles]).as_quat(scalar_first=True)[0]
    assert abs(ours @ theirs) == pytest.approx(1.0, abs=1e-14)
    assert euler_of_quaternion(3.0 * ours[None])[0] == pytest.approx(angles, abs=1e-12)


@given(ANGLES, ANGLES)
def test_product_composes_rotations(first, second):
    a, b = quaternion_of_euler(np.array([first, second]))
    both = scipy_rotation([first]) * scipy_rotation([second])
    assert rotation(product(a, b)) == pytest.approx(both.as_matrix()[0], abs=1e-14)


def test_axes_by_hand():
    assert rotate(rotation(FLU_TO_FRD), np.array([[1.0, 2.0, 3.0]])).tolist() == [[1.0, -2.0, -3.0]]
    assert rotate(rotation(ENU_TO_NED), np.array([[1.0, 2.0, 3.0]])) == pytest.approx(np.array([[2.0, 1.0, -3.0]]))


def test_missing_component_affects_dependent_components_only():
    values = np.array([[np.nan, 2.0, 3.0]])
    turned = rotate(rotation(FLU_TO_FRD), values)
    assert np.isnan(turned[0, 0])
    assert turned[0, 1:].tolist() == [-2.0, -3.0]


def test_zero_quaternion_gives_nan():
    assert np.isnan(euler_of_quaternion(np.zeros((1, 4)))).all()
