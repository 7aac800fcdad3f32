"""Actuators between commands and what acts, against their differential equation; lines between samples; late inputs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Identification
from auvid_cli.data.acting_inputs import as_acting, with_actuator_dynamics
from auvid_cli.data.dataset import InputRecord
from auvid_cli.errors import ConfigError
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.parameters import Actuator, Actuators

TIMES = np.array([0.0, 0.13, 0.5, 0.52, 2.0])
COMMANDS = np.array([0.1, -0.2, 0.3, 0.0, 0.2])
LAGGING = Actuator(time_constant=0.3)
LAGGING_FINS = Actuators(LAGGING, LAGGING)


@pytest.fixture
def commands(rng):
    return InputRecord(TIMES, np.column_stack([COMMANDS, -2.0 * COMMANDS, rng.normal(size=5), rng.normal(size=5)]))


@pytest.fixture
def acting_with(commands, experiment_with):
    """Function: the commands as they act with some settings of an identification."""

    def make(**settings):
        identification = Identification.model_validate(settings)
        return as_acting(commands, SimpleNamespace(identification=identification, vehicle=experiment_with().vehicle))

    return make


@pytest.mark.parametrize(
    "actuator",
    [
        LAGGING,
        Actuator(time_constant=0.3, rate_limit=0.4),
        Actuator(rate_limit=0.4),
        Actuator(dead_band=0.03, saturation=0.2, rate_limit=0.7, time_constant=0.05),
    ],
)
def test_each_step_holds_the_mean_position(commands, actuator):
    record = with_actuator_dynamics(commands, Actuators(actuator, actuator), 0.02)
    step = 1e-5
    time = np.arange(250_000) * step
    sizes = np.maximum(np.minimum(abs(COMMANDS), actuator.saturation) - actuator.dead_band, 0.0)
    wanted = (np.sign(COMMANDS) * sizes)[np.searchsorted(TIMES, time + 0.5 * step, side="right") - 1].tolist()
    share, way, place, places = step / max(actuator.time_constant, step), actuator.rate_limit * step, wanted[0], []
    for there in wanted:
        places.append(place)
        place += min(max(share * (there - place), -way), way)
    area = np.concatenate([[0.0], np.cumsum(places) * step])
    edges = record.time[record.time < 2.5]
    means = np.diff(np.interp(edges, np.arange(area.size) * step, area)) / np.diff(edges)
    assert_allclose(record.values[: means.size, 0], means, atol=1e-4)


def test_lagging_fin_has_the_mean_of_the_exact_solution(commands):
    record = with_actuator_dynamics(commands, LAGGING_FINS, 0.02)

    def slope(t, state):
        command = COMMANDS[np.searchsorted(TIMES, t, side="right") - 1]
        return [(command - state[0]) / 0.3, state[0]]

    exact = solve_ivp(slope, (0.0, 2.5), [COMMANDS[0], 0.0], max_step=1e-3, rtol=1e-10, atol=1e-12, dense_output=True)
    edges = record.time[record.time < 2.5]
    means = np.diff(exact.sol(edges)[1]) / np.diff(edges)
    assert_allclose(record.values[: means.size, 0], means, atol=2e-5)
    assert_allclose(record.values[:, 1], -2.0 * record.values[:, 0], rtol=1e-12)


def test_dead_band_and_saturation_limit_commands():
    values = np.zeros((6, 4))
    values[:, 2] = [0.0, 4.9, -5.0, 7.0, -40.0, 90.0]
    record = with_actuator_dynamics(InputRecord(np.arange(6.0), values), Actuators(thrust=Actuator(5.0, 40.0)), 0.02)
    assert np.array_equal(record.time, np.arange(6.0))
    assert_allclose(record.values[:, 2], [0.0, 0.0, 0.0, 2.0, -35.0, 35.0])


def test_stalled_fin_acts_as_smaller_angle():
    values = np.zeros((5, 4))
    values[:, 1] = [0.1, 0.2, -0.3, 0.4, 0.9]
    record = with_actuator_dynamics(
        InputRecord(np.arange(5.0), values), Actuators(elevator=Actuator(stall=0.2, stall_slope=-0.5)), 0.02
    )
    assert_allclose(record.values[:, 1], [0.1, 0.2, -0.15, 0.1, 0.0], atol=1e-15)


def test_roll_moment_is_unchanged_and_steps_are_short(commands):
    record = with_actuator_dynamics(commands, LAGGING_FINS, 0.02)
    held = np.searchsorted(TIMES, record.time, side="right") - 1
    assert np.array_equal(record.values[:, 2:], commands.values[held][:, 2:])
    assert np.diff(record.time).max() <= 0.02 + 1e-12
    assert set(TIMES) <= set(record.time)


def test_ideal_actuators_change_nothing(commands):
    assert with_actuator_dynamics(commands, Actuators(), 0.02) is commands


def test_settled_command_needs_no_steps():
    record = with_actuator_dynamics(
        InputRecord(np.array([0.0, 1e5]), np.ones((2, 4))), Actuators(Actuator(time_constant=0.1)), 0.02
    )
    assert record.time.size < 1000


def test_single_input_acts(commands):
    one = InputRecord(TIMES[:1], commands.values[:1])
    assert np.isfinite(with_actuator_dynamics(one, Actuators(Actuator(dead_band=0.01)), 0.02).values).all()


def test_linear_inputs_have_the_mean_of_each_step(commands, acting_with):
    record = acting_with(inputs={"between": "linear"})
    assert np.diff(record.time).max() <= 0.02 + 1e-12
    assert set(TIMES) <= set(record.time)
    middle = 0.5 * (record.time[1:] + record.time[:-1])
    for column, stated in zip(record.values[:-1].T, commands.values.T, strict=True):
        assert_allclose(column, np.interp(middle, TIMES, stated), atol=1e-12)
    assert np.array_equal(record.values[-1], commands.values[-1])


@pytest.mark.parametrize("delay", [0.05, -0.05])
def test_delay_shifts_inputs(commands, delay, acting_with):
    record = acting_with(delays={"inputs": delay})
    assert_allclose(record.time[-5:], TIMES + delay)
    assert np.array_equal(record.values[-5:], commands.values)
    assert record.time[0] == min(0.0, delay)
    assert np.array_equal(record.values[0], commands.values[0])


def test_delay_of_unknown_sensor_is_refused(experiment_with):
    with pytest.raises(ConfigError, match=r"unknown sensor 'gyro'.*gyroscope"):
        experiment_with("identification.delays={gyro: 2 ms}")


@pytest.mark.slow
def test_stated_delays_are_compensated(simulated_with, with_settings):
    """Delays of the gyroscope and the inputs; the fault tests of the smoother find nothing else."""
    white = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}", "sensors.gyroscope.rate=25 Hz"
    run = simulated_with("manoeuvre.duration=60 s", "manoeuvre.input_rate=100 Hz", *white)
    gyroscope, time = run.sensors["gyroscope"], run.inputs.time
    early = np.transpose([np.interp(time + 0.02, time, column) for column in run.inputs.values.T])
    late = replace(
        run,
        sensors=run.sensors | {"gyroscope": replace(gyroscope, time=gyroscope.time + 0.004)},
        inputs=replace(run.inputs, values=np.ascontiguousarray(early)),
    )
    unstated = identify(late, FilterName.SMOOTHER)
    stated = identify(
        with_settings(late, "identification.delays={gyroscope: 4 ms, inputs: 20 ms}"), FilterName.SMOOTHER
    )
    names = "delay of the gyroscope", "delay of the inputs"
    before, after = ({test.fault: test for test in e.faults if str(test.fault) in names} for e in (unstated, stated))
    assert max(abs(test.z) for test in before.values()) > 10.0
    assert max(abs(test.z) for test in after.values()) < 4.0
