from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.identification.timeline import Timelines
from auvid_cli.validation.motion_prediction import SAME, MeasuredSignal, SignalSize, measured_signals, signal_sizes


def test_signals_are_finite_in_order_of_motion():
    time = np.arange(4.0)
    attitude = np.array([[0.0, 0.1, 3.0], [0.0, np.nan, 3.1], [0.0, 0.1, -3.1], [0.0, 0.1, -3.0]])
    records = {
        "attitude": SensorRecord(time, attitude, np.array([0.01, 0.02, 0.03])),
        "depth": SensorRecord(time, 5.0 + time[:, None], np.array([0.05])),
        "dvl": SensorRecord(time[:2], np.array([[3.0, np.nan, 0.0], [3.5, np.nan, 0.0]]), np.full(3, 1e-3)),
    }
    signals = measured_signals(records)
    assert list(signals) == ["u", "w", "phi", "theta", "psi", "down"]
    assert signals["theta"].time.tolist() == [0.0, 2.0, 3.0]
    assert signals["theta"].deviation == 0.02
    assert_allclose(signals["psi"].values, [3.0, 3.1, 2 * np.pi - 3.1, 2 * np.pi - 3.0])


def test_complete_records_are_not_copied():
    record = SensorRecord(np.arange(4.0), np.ones((4, 3)), np.full(3, 1e-3))
    of_record = measured_signals({"dvl": record})["v"]
    assert np.shares_memory(of_record.time, record.time)
    assert np.shares_memory(of_record.values, record.values)


def test_whole_turns_match_measurements():
    heading = MeasuredSignal(np.array([0.0, 10.0]), np.array([0.1, 13.0]), 0.01)
    assert heading.turns(0.0, 0.2) == 0.0
    assert heading.turns(0.0, 2 * np.pi) == pytest.approx(-2 * np.pi)
    assert heading.turns(10.0, 13.0 - 4 * np.pi) == pytest.approx(4 * np.pi)
    assert heading.turns(-1.0, 0.0) == 0.0


def test_every_measurement_has_an_event(short_run, rng):
    """Times between two nanoseconds, ten hours after the clock began."""
    gyroscope = short_run.sensors["gyroscope"]
    late = 36_000.0
    time = late + np.sort(rng.choice(np.arange(100, 10_000), 1500, replace=False)) * 1e-3 + 0.5e-9
    record = replace(gyroscope, time=time, values=gyroscope.values[:1500])
    inputs = replace(short_run.inputs, time=short_run.inputs.time + late)
    events = np.concatenate([part.time for part in Timelines(inputs, {"gyroscope": record}, late, 0.02)])
    nearest = events[np.searchsorted(events, time - SAME)]
    assert_allclose(nearest, time, rtol=0.0, atol=1e-9)


def test_yaw_rate_without_gyroscope_is_from_attitude():
    """A steady helix: ``r = psi_dot cos phi cos theta``, whatever the turns of the heading."""
    time = np.arange(0.0, 60.0, 0.1)
    attitude = np.column_stack([np.full(time.size, 0.2), np.full(time.size, -0.3), (0.4 * time) % (2.0 * np.pi)])
    silent = (time > 20.0) & (time < 30.0)
    record = SensorRecord(time[~silent], attitude[~silent], np.array([0.01, 0.01, 0.02]))
    rate = measured_signals({"attitude": record})["r"]
    assert_allclose(rate.values, 0.4 * np.cos(0.2) * np.cos(0.3))
    # Half a second before and after it is measured.
    assert rate.time[[0, -1]].tolist() == pytest.approx([0.6, 59.3])
    assert not ((rate.time > 19.5) & (rate.time < 30.5)).any()
    assert set(rate.time) <= set(record.time)


def test_yaw_rate_from_attitude_equals_gyroscope(simulated_with):
    zigzag = "manoeuvre={type: zigzag, duration: 40 s, speed: 3.9 m/s, rudder: 20 deg, heading: 20 deg, approach: 8 s}"
    run = simulated_with(zigzag, "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.01 deg}")
    rate = measured_signals({"attitude": run.sensors["attitude"]})["r"]
    true = np.interp(rate.time, run.truth.time, run.truth.motion[:, 5])
    assert np.std(rate.values - true) < 0.05 * np.std(true)
    # Seldom headings tell no rate, and a gyroscope comes first.
    seldom = SensorRecord(rate.time[::20], np.zeros((rate.time[::20].size, 3)), np.full(3, 0.01))
    assert "r" not in measured_signals({"attitude": seldom})
    # White angles give the stated noise.
    angles = np.random.default_rng(1).normal(0.0, 0.01, (5000, 3))
    noise = measured_signals({"attitude": SensorRecord(0.1 * np.arange(5000.0), angles, np.full(3, 0.01))})["r"]
    assert np.std(noise.values) == pytest.approx(noise.deviation, rel=0.05)
    both = measured_signals({name: run.sensors[name] for name in ("attitude", "gyroscope")})
    assert both["r"].time.size == run.sensors["gyroscope"].time.size


def test_signal_sizes_use_own_mean_of_each_segment():
    some, others = (MeasuredSignal(np.arange(4.0), level + np.array([1.0, -1.0] * 2), 0.1) for level in (0.0, 50.0))
    assert signal_sizes([{"v": some}, {"v": others, "u": some}]) == {
        "u": SignalSize(pytest.approx(0.1), 1.0),
        "v": SignalSize(pytest.approx(0.1), 1.0),
    }
