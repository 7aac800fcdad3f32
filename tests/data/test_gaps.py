"""A rounded measurement that hardly changes is not one that has failed."""

import numpy as np
import pytest

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import repeats, rounded_repeats, rounding_steps, stuck_times
from auvid_cli.inspection.inspection import data_checks

TIME = 0.1 * np.arange(1200)
# A dive to 30 m, then held within a centimetre for 40 s and more.
DEPTH = 30.0 - 3.0 * np.exp(-TIME / 8.0)


def record(values):
    return SensorRecord(TIME, np.asarray(values, dtype=float)[:, None], np.array([0.01]))


def judged(values, segment):
    (check,) = [check for check in data_checks([segment(record(values))], "", ["depth"]) if check.check == "stuck"]
    return check


@pytest.fixture
def segment():
    class Data:
        def __init__(self, own):
            self.sensors = {"depth": own}

    return Data


def test_quantised_depth_is_not_stuck(segment):
    rounded = record(np.round(DEPTH, 2))
    lasted = np.diff(repeats(rounded))
    assert lasted.max() > 2.0
    assert rounding_steps(rounded) == pytest.approx([0.01])
    assert not stuck_times(rounded)[:-1].size
    check = judged(np.round(DEPTH + 0.02 * np.sin(0.3 * TIME), 2), segment)
    assert check.passed is None
    assert check.statistic.startswith("quantised: down by 0.01 m; ")
    assert "at least 0.0029 m for down" in check.advice


def test_failed_sensor_is_stuck(segment):
    values = np.round(np.sin(0.3 * TIME), 2)
    values[300:340] = values[300]
    (stuck,) = stuck_times(record(values))
    assert stuck == pytest.approx([TIME[300], TIME[339]], abs=0.11)
    check = judged(values, segment)
    assert check.passed is False
    assert "from t = 30 s" in check.advice


def test_dead_sensor_is_stuck_to_the_end():
    values = np.round(np.sin(0.3 * TIME), 2)
    values[800:] = values[799]
    assert stuck_times(record(values))[-1][1] == TIME[-1]
    assert not rounded_repeats(record(values), repeats(record(values)))[-1]


def test_repeats_without_quantisation_are_stuck(rng):
    values = rng.standard_normal(TIME.size)
    values[500:540] = values[500]
    assert len(stuck_times(record(values))) == 1
    assert not rounded_repeats(record(values), repeats(record(values))).any()


def test_noise_over_two_steps_is_not_a_failure():
    """Noise of half a step at 4 Hz about a held depth: some runs of two seconds begin two steps away."""
    time = 0.25 * np.arange(40_000)
    noise = 0.005 * np.random.default_rng(1).standard_normal(time.size)
    values = np.round(12.0 + 0.03 * np.sin(0.02 * time) + noise, 2)
    own = SensorRecord(time, values[:, None], np.array([0.005]))
    assert (np.diff(repeats(own)) > 2.0).sum() > 20
    assert not stuck_times(own).size
