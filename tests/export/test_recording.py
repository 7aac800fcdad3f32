"""Topics of a run against rotations of SciPy and the arrays that they come from."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from auvid_cli.data.innovations import Innovations
from auvid_cli.errors import DataError
from auvid_cli.export.recording import TopicKind, field_names, ros_pose, topics_of
from auvid_cli.vehicle.rigid_body import body_to_earth

# North, east, down to east, north, up; and forward, starboard, down to forward, port, up.
ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU = np.diag([1.0, -1.0, -1.0])
TIME = np.array([0.0, 0.1, 0.25])
angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-7.0, 7.0))


@pytest.fixture
def run(hand_made, short_run):
    """A dataset with its truth, and an estimate of three events."""
    seen = Innovations(
        TIME[1:], np.ones((2, 3)), np.array([[4.0, 4.0, 4.0], [9.0, 9.0, np.nan]]), np.ones(2), np.ones(3)
    )
    estimate = hand_made(TIME, {"X_u|u|": [-1.0, -2.0, -3.0]}, innovations={"dvl": seen})
    estimate.mean[:, 1:] = np.arange(27.0).reshape(3, 9) / 30.0
    return short_run, estimate


def by_name(topics):
    return {topic.name: topic for topic in topics}


@given(attitude=angles)
def test_ros_pose_keeps_the_rotation(attitude):
    angles = np.array([attitude])
    pose = ros_pose(np.array([[1.0, 2.0, 3.0]]), angles)[0]
    assert_allclose(pose[:3], [2.0, 1.0, -3.0])
    to_earth = body_to_earth(np.repeat(angles, 3, axis=0), np.eye(3)).T
    assert_allclose(Rotation.from_quat(pose[3:]).as_matrix(), ENU @ to_earth @ FLU, atol=1e-12)


@given(symbols=st.lists(st.text("uU_|2", min_size=1).map("N_".__add__), unique=True, max_size=6))
def test_field_names_are_unique_and_valid(symbols):
    names = field_names(symbols)
    assert len({*names}) == len(symbols)
    assert all(re.fullmatch("[a-z][a-z0-9]*(_[a-z0-9]+)*", name) for name in names)


def test_field_names_of_the_22_are_readable():
    assert field_names(["X_u|u|", "Y_uudr", "N_|v|r", "N_vr"]) == ("x_uu", "y_uudr", "n_vr", "n_vr_2")


def test_topics_have_estimate_and_truth(run):
    dataset, estimate = run
    topics = by_name(topics_of(dataset, estimate))
    states, innovations = topics["/states"], topics["/innovations/dvl"]
    assert states.fields == ("x_uu", "x_uu_standard_deviation")
    assert_allclose(states.values, np.column_stack((estimate.mean[:, 0], np.full(3, 0.25))))
    assert innovations.fields[:4] == ("u", "v", "w", "u_standard_deviation")
    assert_allclose(innovations.values[1], [1.0, 1.0, 1.0, 3.0, 3.0, np.nan, 1.0])
    assert_allclose(topics["/velocity"].values, estimate.mean[:, 1:7] * [1, -1, -1, 1, -1, -1])
    assert (topics["/pose"].kind, topics["/pose"].frame) == (TopicKind.POSE, "vehicle")
    assert_allclose(topics["/truth/pose"].values[:, 0], dataset.truth.position[:, 1])
    assert topics["/truth/velocity"].frame == "vehicle_true"
    assert not [name for name in by_name(topics_of(replace(dataset, truth=None), estimate)) if "truth" in name]


def test_motion_ends_where_it_is_not_finite(run):
    dataset, estimate = run
    estimate.mean[2] = np.nan
    topics = by_name(topics_of(dataset, estimate))
    assert topics["/pose"].time.tolist() == topics["/velocity"].time.tolist() == [0.0, 0.1]
    assert np.isnan(topics["/states"].values[2, 0])


@pytest.mark.parametrize("shift", [-0.01, 2.0**31])
def test_times_outside_ros_range_are_refused(shift, run):
    dataset, estimate = run
    with pytest.raises(DataError, match="times from 0 to 2147483648 s"):
        topics_of(dataset, replace(estimate, time=estimate.time + shift))
