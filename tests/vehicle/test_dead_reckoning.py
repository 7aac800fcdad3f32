import numpy as np

from auvid_cli.vehicle.rigid_body import dead_reckoned


def test_dead_reckoning_turns_velocity_into_the_earth_frame():
    motion = np.zeros((11, 9))
    motion[:, 0], motion[:, 8] = 2.0, np.pi / 2.0
    time = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(dead_reckoned(time, motion)[-1], [0.0, 2.0, 0.0], atol=1e-12)
    motion[:, 7], motion[:, 8] = -np.pi / 6.0, 0.0
    np.testing.assert_allclose(dead_reckoned(time, motion)[-1], [np.sqrt(3.0), 0.0, 1.0], atol=1e-12)
    motion[:, 7], motion[:, 0], motion[:, 1], motion[:, 6] = 0.0, 0.0, 1.0, np.pi / 2.0
    np.testing.assert_allclose(dead_reckoned(time, motion)[-1], [0.0, 0.0, 1.0], atol=1e-12)


def test_dead_reckoning_ends_where_motion_does():
    motion = np.zeros((5, 9))
    motion[3, 6] = np.nan
    assert dead_reckoned(np.arange(5.0), motion).shape == (3, 3)
    motion[0, 6] = np.nan
    assert dead_reckoned(np.arange(5.0), motion).shape == (0, 3)
