"""The common time base against averages computed by hand."""

import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.inspection.kinematic_relations import change, derivative, signals_of, smoothed


def signals(time, values, inputs=None, end=10.0):
    record = SensorRecord(time, np.repeat(values[:, None], 3, axis=1), np.ones(3))
    inputs = inputs or InputRecord(np.array([0.0]), np.ones((1, 4)))
    return signals_of(inputs, {"dvl": record}, (0.0, end))


def test_grid_averages_fast_and_interpolates_slow_measurements():
    # The mean of a straight line over a cell is its value in the middle, up to half a sample.
    fast = np.arange(0.0005, 10.0, 0.001)
    gridded = signals(fast, 2.0 * fast)
    np.testing.assert_allclose(gridded.values["u"], 2.0 * gridded.grid.centres(), atol=1e-9)
    slow = np.arange(0.0, 10.5, 0.5)
    gridded = signals(slow, 2.0 * slow)
    np.testing.assert_allclose(gridded.values["u"], 2.0 * gridded.grid.centres(), atol=1e-9)
    assert gridded.interval["u"] == pytest.approx(0.5)


def test_grid_does_not_bridge_gaps():
    time = np.concatenate([np.arange(0.0, 3.0, 0.5), np.arange(7.0, 10.5, 0.5)])
    gridded = signals(time, time).values["u"]
    centres = 0.05 + 0.1 * np.arange(100)
    np.testing.assert_array_equal(np.isnan(gridded), (centres > 2.5) & (centres < 7.0))


def test_grid_holds_inputs():
    inputs = InputRecord(np.array([0.0, 5.03]), np.array([[1.0] * 4, [3.0] * 4]))
    gridded = signals(np.arange(0.0, 10.0, 0.1), np.zeros(100), inputs).values["rudder"]
    assert gridded[:50] == pytest.approx(1.0)
    assert gridded[50] == pytest.approx(0.3 * 1.0 + 0.7 * 3.0)
    assert gridded[51:] == pytest.approx(3.0)


def test_smoothing_and_differences_keep_missing_values():
    values = np.array([1.0, 2.0, 4.0, np.nan, 16.0, 32.0])
    np.testing.assert_array_equal(smoothed(values, 2), [1.5, 3.0, np.nan, np.nan, 24.0, np.nan])
    np.testing.assert_array_equal(derivative(values, 0.5), [np.nan, 3.0, np.nan, 12.0, np.nan, np.nan])
    np.testing.assert_array_equal(change(values, 2), [3.0, np.nan, 12.0, np.nan, np.nan, np.nan])
