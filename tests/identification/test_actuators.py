"""Fins that lag behind their commands, against the differential equation."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli.data.dataset import InputRecord
from auvid_cli.identification.actuators import lagged

TIMES = np.array([0.0, 0.13, 0.5, 0.52, 2.0])
COMMANDS = np.array([0.1, -0.2, 0.3, 0.0, 0.2])


@pytest.fixture
def commands(rng):
    return InputRecord(TIMES, np.column_stack([COMMANDS, -2.0 * COMMANDS, rng.normal(size=5), rng.normal(size=5)]))


def test_each_piece_holds_the_mean_of_the_fin(commands):
    record = lagged(commands, 0.3, 0.02)

    def slope(t, state):
        command = COMMANDS[np.searchsorted(TIMES, t, side="right") - 1]
        return [(command - state[0]) / 0.3, state[0]]

    exact = solve_ivp(slope, (0.0, 2.5), [COMMANDS[0], 0.0], max_step=1e-3, rtol=1e-10, atol=1e-12, dense_output=True)
    inside = record.time[1:] < 2.5
    edges = record.time[: inside.sum() + 1]
    means = np.diff(exact.sol(edges)[1]) / np.diff(edges)
    assert_allclose(record.values[: means.size, 0], means, atol=2e-5)
    assert_allclose(record.values[:, 1], -2.0 * record.values[:, 0], rtol=1e-12)


def test_what_is_no_fin_is_left_alone_and_pieces_are_short(commands):
    record = lagged(commands, 0.3, 0.02)
    held = np.searchsorted(TIMES, record.time, side="right") - 1
    assert np.array_equal(record.values[:, 2:], commands.values[held][:, 2:])
    assert np.diff(record.time).max() <= 0.02 + 1e-12
    assert set(TIMES) <= set(record.time)


def test_without_a_lag_nothing_changes(commands):
    assert lagged(commands, 0.0, 0.02) is commands


def test_a_command_long_ago_needs_no_pieces():
    record = lagged(InputRecord(np.array([0.0, 1e5]), np.ones((2, 4))), 0.1, 0.02)
    assert record.time.size < 1000
