"""What a DVL sees, by sigma points and linearised, against rotations of another library and differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from auvid_cli.config.augmented_states import AugmentedStates, Current, DvlError
from auvid_cli.config.experiment import Identification
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.state_layout import state_layout
from auvid_cli.lanes import LANES
from auvid_cli.vehicle.dynamics import vehicle_constants
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

MOTION = np.array([2.0, 0.1, -0.1, 0.02, 0.03, -0.05, 0.1, -0.2, 0.3])


def process_and_layout(asked, has_depth, experiment):
    """With two coefficients."""
    settings = Identification(coefficients=("X_u|u|", "N_uvl"), estimate=asked)
    layout = state_layout(settings, experiment.vehicle.size, has_depth)
    return vehicle_process(vehicle_constants(experiment.vehicle.known_parameters()), {}, layout), layout


def assert_seen_alike(process, state, n_parameters, expected):
    """By both kinds of filter, and the derivative is that of what is seen."""
    seen, matrix = process.linearise(state, 0)
    assert_allclose(seen, expected, rtol=1e-12)
    for j in range(state.size):
        step = np.zeros(state.size)
        step[j] = 1e-6
        difference = (process.linearise(state + step, 0)[0] - process.linearise(state - step, 0)[0]) / 2e-6
        assert_allclose(matrix[:, j], difference, atol=1e-8)

    block = np.repeat(state[:, None], LANES, axis=1)
    moving, parameters = block[n_parameters:].ravel(), block[:n_parameters].ravel()
    by_points = np.zeros(3 * LANES)
    process.observe(moving, parameters, 0, process.constants, process.selection, 5, by_points)
    assert_allclose(by_points.reshape(3, LANES)[:, :5], np.repeat(expected[:, None], 5, axis=1), rtol=1e-9)


@pytest.mark.parametrize(
    "walks", [{}, {"scale_walk": 1e-3}, {"yaw_walk": 1e-3}, {"scale_walk": 1e-3, "yaw_walk": 1e-3}]
)
def test_a_dvl_with_scale_error_and_mounting_yaw(walks, experiment_with):
    process, layout = process_and_layout(
        AugmentedStates(biases=("gyro", "dvl"), dvl=DvlError(**walks)), False, experiment_with()
    )
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
    asked = AugmentedStates(biases=blocks, current=Current(walk=walk))
    process, layout = process_and_layout(asked, has_depth, experiment_with())
    symbols, n_parameters = layout.symbols, layout.n_parameters
    assert ("down" in symbols) == has_depth
    current = {"current_north": 0.3, "current_east": -0.4}
    values = dict(zip(MOTION_SYMBOLS, MOTION, strict=True)) | current
    state = np.array([values.get(symbol, 0.0) for symbol in symbols])
    turn = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1])
    expected = MOTION[:3] + turn.apply([0.3, -0.4, 0.0], inverse=True)
    assert_seen_alike(process, state, n_parameters, expected)
