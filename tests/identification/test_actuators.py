"""Fins that lag behind their commands, against the differential equation; lines between samples; late inputs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli.config.experiment import Identification
from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import InputRecord
from auvid_cli.errors import ConfigError
from auvid_cli.identification.actuators import as_acting, lagged
from auvid_cli.identification.identify import identify

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


def test_straight_lines_have_the_mean_of_each_step(commands):
    record = as_acting(commands, Identification.model_validate({"inputs": {"between": "linear"}}))
    assert np.diff(record.time).max() <= 0.02 + 1e-12
    assert set(TIMES) <= set(record.time)
    middle = 0.5 * (record.time[1:] + record.time[:-1])
    for column, stated in zip(record.values[:-1].T, commands.values.T, strict=True):
        assert_allclose(column, np.interp(middle, TIMES, stated), atol=1e-12)
    assert np.array_equal(record.values[-1], commands.values[-1])


@pytest.mark.parametrize("delay", [0.05, -0.05])
def test_late_inputs_act_later_from_the_first_on(commands, delay):
    record = as_acting(commands, Identification.model_validate({"delays": {"inputs": delay}}))
    assert_allclose(record.time[-5:], TIMES + delay)
    assert np.array_equal(record.values[-5:], commands.values)
    assert record.time[0] == min(0.0, delay)
    assert np.array_equal(record.values[0], commands.values[0])


def test_a_delay_of_what_is_no_sensor_is_refused(experiment_with):
    with pytest.raises(ConfigError, match="'gyro' is no sensor; expected one of gyroscope"):
        experiment_with("identification.delays={gyro: 2 ms}")


def test_delays_that_are_stated_are_taken_back(simulated_with, with_settings):
    """Of the gyroscope and the inputs; the smoother's tests of faults find nothing more."""
    white = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}"
    run = simulated_with("manoeuvre.duration=60 s", white)
    gyroscope, time = run.sensors["gyroscope"], run.inputs.time
    early = np.transpose([np.interp(time + 0.02, time, column) for column in run.inputs.values.T])
    late = replace(
        run,
        sensors=run.sensors | {"gyroscope": replace(gyroscope, time=gyroscope.time + 0.004)},
        inputs=replace(run.inputs, values=np.ascontiguousarray(early)),
    )
    unsaid = identify(late, FilterName.SMOOTHER)
    said = identify(with_settings(late, "identification.delays={gyroscope: 4 ms, inputs: 20 ms}"), FilterName.SMOOTHER)
    names = "delay of the gyroscope", "delay of the inputs"
    before, after = ({test.fault: test for test in e.faults if test.fault in names} for e in (unsaid, said))
    assert max(abs(test.z) for test in before.values()) > 10.0
    assert max(abs(test.z) for test in after.values()) < 4.0
