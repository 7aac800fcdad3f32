from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.identification.timeline import Timelines
from auvid_cli.validation.signals import SAME, MeasuredSignal, measured_signals


def test_signals_hold_what_is_finite_of_each_component_in_the_order_of_the_motion():
    time = np.arange(4.0)
    attitude = np.array([[0.0, 0.1, 3.0], [0.0, np.nan, 3.1], [0.0, 0.1, -3.1], [0.0, 0.1, -3.0]])
    records = {
        "attitude": SensorRecord(time, attitude, np.array([0.01, 0.02, 0.03])),
        "dvl": SensorRecord(time[:2], np.array([[3.0, np.nan, 0.0], [3.5, np.nan, 0.0]]), np.full(3, 1e-3)),
    }
    signals = measured_signals(records)
    assert list(signals) == ["u", "w", "phi", "theta", "psi"]
    assert signals["theta"].time.tolist() == [0.0, 2.0, 3.0]
    assert signals["theta"].deviation == 0.02
    assert_allclose(signals["psi"].values, [3.0, 3.1, 2 * np.pi - 3.1, 2 * np.pi - 3.0])


def test_turns_bring_a_heading_to_those_of_the_measurements():
    heading = MeasuredSignal(np.array([0.0, 10.0]), np.array([0.1, 13.0]), 0.01)
    assert heading.turns(0.0, 0.2) == 0.0
    assert heading.turns(0.0, 2 * np.pi) == pytest.approx(-2 * np.pi)
    assert heading.turns(10.0, 13.0 - 4 * np.pi) == pytest.approx(4 * np.pi)
    assert heading.turns(-1.0, 0.0) == 0.0


def test_every_measurement_is_found_among_the_events_at_whatever_time_it_was_taken(short_run, rng):
    """Times between two nanoseconds, ten hours after the clock began."""
    gyroscope = short_run.sensors["gyroscope"]
    late = 36_000.0
    time = late + np.sort(rng.choice(np.arange(100, 10_000), 2000, replace=False)) * 1e-3 + 0.5e-9
    record = replace(gyroscope, time=time, values=gyroscope.values[:2000])
    inputs = replace(short_run.inputs, time=short_run.inputs.time + late)
    events = np.concatenate([part.time for part in Timelines(inputs, {"gyroscope": record}, late, 0.02)])
    nearest = events[np.searchsorted(events, time - SAME)]
    assert_allclose(nearest, time, rtol=0.0, atol=1e-9)
