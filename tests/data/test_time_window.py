"""A part of a dataset, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord, SensorRecord, cut
from auvid_cli.errors import DataError


@pytest.fixture
def dataset(short_run):
    """Inputs at 0, 10, 20 and 30 s; a sensor every second until 40 s."""
    time = np.arange(41.0)
    sensors = {"depth": SensorRecord(time, time[:, None], np.ones(1))}
    inputs = InputRecord(10.0 * np.arange(4), np.arange(16.0).reshape(4, 4))
    return replace(short_run, inputs=inputs, sensors=sensors)


def test_cut_includes_both_ends_and_the_holding_input(dataset):
    part = cut(dataset, 12.5, 20.0)
    assert part.sensors["depth"].time.tolist() == [13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0, 20.0]
    assert part.sensors["depth"].values[:, 0].tolist() == part.sensors["depth"].time.tolist()
    assert part.inputs.time.tolist() == [12.5, 20.0]
    assert part.inputs.values.tolist() == [[4.0, 5.0, 6.0, 7.0], [8.0, 9.0, 10.0, 11.0]]


def test_cut_repeats_the_last_input_at_its_end(dataset):
    """Except the last one, which holds for an unknown time."""
    part = cut(dataset, 12.0, 17.0)
    assert part.inputs.time.tolist() == [12.0, 17.0]
    assert np.array_equal(part.inputs.values[1], dataset.inputs.values[1])
    assert cut(dataset, 32.0, 40.0).inputs.time.tolist() == [32.0]


def test_cut_to_all_times_changes_nothing(dataset):
    part = cut(dataset, -np.inf, np.inf)
    assert part.inputs.time.tolist() == dataset.inputs.time.tolist()
    assert part.sensors["depth"].time.tolist() == dataset.sensors["depth"].time.tolist()


def test_cut_without_measurements_or_inputs_is_refused(dataset):
    with pytest.raises(DataError, match=r"no sensor .* t = 50 s to 60 s"):
        cut(dataset, 50.0, 60.0)
    late = replace(dataset, inputs=replace(dataset.inputs, time=dataset.inputs.time + 30.0))
    with pytest.raises(DataError, match="the inputs begin at t = 30 s"):
        cut(late, 5.0, 20.0)
