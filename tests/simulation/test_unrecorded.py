"""Disturbances, fin trims and recorded inputs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.errors import ConfigError
from auvid_cli.simulation.simulate import draw_disturbance, draw_fin_trim

SHORT = "manoeuvre.duration=10 s"
FORCE = "manoeuvre.disturbance.force={standard_deviation: [3 N, 2 N, 0 N], time_constant: [1 s, 2 s, 3 s]}"
MOMENT = "manoeuvre.disturbance.moment={standard_deviation: 0.5 N*m, time_constant: 2 s}"
FREE = "autopilot: {vertical: none, horizontal: none}"


@pytest.fixture(scope="module")
def disturbed(simulated_with):
    return simulated_with(SHORT, FORCE)


def test_disturbance_has_size_and_time_constant_of_each_axis(experiment_with):
    settings, ends, n = experiment_with(FORCE, MOMENT).manoeuvre.disturbance, np.array([0.0, 1.5]), 800
    drawn = np.array([draw_disturbance(settings, ends, seed) for seed in range(n)])
    assert not drawn[:, :, 2].any()
    normal = np.delete(drawn, 2, axis=2) / [3.0, 2.0, 0.5, 0.5, 0.5]
    first, later = normal.swapaxes(0, 1)
    left = np.exp(-1.5 / np.array([1.0, 2.0, 2.0, 2.0, 2.0]))
    assert_allclose(np.mean(normal**2, axis=0), 1.0, atol=5.0 * np.sqrt(2.0 / n))
    assert_allclose(np.mean(first * later, axis=0), left, atol=5.0 * np.sqrt(2.0 / n))
    alike = np.corrcoef(first.T) - np.eye(5)
    assert np.abs(alike).max() < 5.0 / np.sqrt(n)


def test_truth_has_the_disturbance(disturbed):
    settings, time = disturbed.experiment.manoeuvre.disturbance, disturbed.truth.time
    assert np.array_equal(disturbed.truth.disturbance, draw_disturbance(settings, time, disturbed.experiment.seed))


def test_change_of_disturbance_keeps_other_noise(disturbed, simulated_with):
    more = simulated_with(SHORT, FORCE, MOMENT)
    assert np.array_equal(more.truth.disturbance[:, :3], disturbed.truth.disturbance[:, :3])
    assert not np.array_equal(more.truth.motion, disturbed.truth.motion)
    at = np.searchsorted(more.truth.time, more.sensors["gyroscope"].time + 1e-9) - 1
    noise = [run.sensors["gyroscope"].values - run.truth.motion[at, 3:6] for run in (more, disturbed)]
    assert_allclose(*noise, atol=1e-9)


def test_no_disturbance_is_not_stored(short_run):
    assert short_run.truth.disturbance is None


def test_table_of_truth_has_the_disturbance(disturbed):
    table = disturbed.to_pandas()["truth"]
    assert np.array_equal(table["disturbance_Y"], disturbed.truth.disturbance[:, 1])
    assert table.attrs["units"]["disturbance_K"] == "N*m"


def test_fin_trim_acts_but_is_not_recorded(simulated_with):
    circle = f"manoeuvre={{type: turning_circle, duration: 5 s, speed: 2 m/s, approach: 0 s, {FREE}, rudder: "
    steered = simulated_with(f"{circle}2 deg}}")
    trimmed = simulated_with(f"{circle}0 deg, fin_trim: {{rudder: 2 deg}}}}")
    assert np.array_equal(steered.truth.motion, trimmed.truth.motion)
    assert np.abs(steered.truth.motion[-1, 5]) > 0.01
    assert_allclose(steered.inputs.values[:, 0], np.deg2rad(2.0))
    assert_allclose(trimmed.inputs.values[:, 0], 0.0, atol=1e-15)


def test_fin_trim_spread_is_drawn_per_fin_and_seed(experiment_with):
    settings = experiment_with("manoeuvre.fin_trim={elevator: 3 deg, spread: 1 deg}").manoeuvre.fin_trim
    drawn = np.rad2deg([draw_fin_trim(settings, seed) for seed in range(300)])
    assert len(np.unique(drawn[:, :2])) == 600
    assert_allclose(drawn.mean(axis=0), [0.0, 3.0, 0.0, 0.0], atol=5.0 / np.sqrt(300))
    assert_allclose(drawn.std(axis=0), [1.0, 1.0, 0.0, 0.0], atol=5.0 / np.sqrt(600))


def test_inputs_are_recorded_at_recorded_rate(simulated_with):
    every = simulated_with(SHORT)
    slow = simulated_with(SHORT, "manoeuvre.recorded_rate=10 Hz")
    assert_allclose(slow.inputs.time, np.arange(101) / 10.0)
    assert np.array_equal(slow.inputs.values, every.inputs.values[::10])
    assert np.array_equal(slow.truth.motion, every.truth.motion)


def test_recorded_thrust_and_time_have_their_errors_and_the_motion_does_not(simulated_with):
    exact = simulated_with(SHORT)
    wrong = simulated_with(SHORT, "manoeuvre.thrust_error=0.1", "manoeuvre.input_delay=40 ms")
    assert np.array_equal(wrong.truth.motion, exact.truth.motion)
    assert_allclose(wrong.inputs.time, exact.inputs.time - 0.04, atol=1e-12)
    assert_allclose(wrong.inputs.values[:, 2], 1.1 * exact.inputs.values[:, 2])
    assert np.array_equal(wrong.inputs.values[:, [0, 1, 3]], exact.inputs.values[:, [0, 1, 3]])


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("disturbance.force.standard_deviation=[1, -2, 3]", "must be at least 0, got -2"),
        ("disturbance.force.standard_deviation=3 m", "expected a force such as '466 N'"),
        ("disturbance.moment.time_constant=0 s", "must be greater than 0"),
        ("disturbance.moment.time_constant=[1 s, 2 s]", "a list of 1 or 3, got a list of 2"),
        ("fin_trim.spread=-1 deg", "must be at least 0"),
        ("recorded_rate=200 Hz", r"recorded_rate \(200 Hz\) not above input_rate \(100 Hz\)"),
    ],
)
def test_invalid_setting_raises_with_key(override, message, experiment_with):
    with pytest.raises(ConfigError, match=message) as caught:
        experiment_with(f"manoeuvre.{override}")
    assert "manoeuvre" in str(caught.value)
