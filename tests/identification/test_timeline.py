"""Merging sensors and inputs to events and substeps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.errors import DataError
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.states import StateBlock, StateLayout
from auvid_cli.identification.timeline import Timelines, initial_motion, measurement_model, measuring_sensors
from auvid_cli.vehicle.parameters import MOTION, MOTION_SYMBOLS, Quantity

# Clocks in whole microseconds, some instants in common.
clock = st.lists(st.integers(0, 3_000_000), min_size=2, max_size=30, unique=True).map(
    lambda ticks: np.array(sorted(ticks)) * 1e-6
)


def a_dataset(experiment, inputs_at, **sensors):
    """Inputs that are their own row number, up to the last measurement; sensor values that are their own row number."""
    inputs_at = np.union1d(inputs_at, max(time[-1] for time in sensors.values()))
    values = np.arange(4 * len(inputs_at), dtype=float).reshape(-1, 4)
    records = {
        name: SensorRecord(np.asarray(time), np.arange(3.0 * len(time)).reshape(-1, 3), np.array([0.1, 0.2, 0.3]))
        for name, time in sensors.items()
    }
    return Dataset(InputRecord(np.asarray(inputs_at), values), records, experiment)


def joined(chunks):
    """Consecutive timelines as one."""
    chunks = list(chunks)

    def offsets(name):
        counts = [np.diff(getattr(chunk, name)) for chunk in chunks]
        return np.concatenate([[0], np.cumsum(np.concatenate(counts))])

    def rows(name):
        return np.concatenate([getattr(chunk, name) for chunk in chunks])

    return Timeline(
        rows("time"), offsets("substep_offset"), rows("substep_duration"), rows("substep_input"), chunks[0].inputs,
        rows("event_input"),
        offsets("measurement_offset"), rows("measurement_sensor"), rows("measurement"),
    )  # fmt: skip


@pytest.mark.slow
@given(inputs_at=clock, dvl=clock, gyroscope=clock, step=st.floats(0.01, 1.0))
def test_pieces_fill_the_gaps_between_events_with_the_input_that_holds(
    inputs_at, dvl, gyroscope, step, experiment_with
):
    inputs_at = np.concatenate([[0.0], inputs_at[inputs_at > 0.0]])
    dataset = a_dataset(experiment_with(), inputs_at, dvl=dvl, gyroscope=gyroscope)
    measuring = measuring_sensors(dataset)
    start, _ = initial_motion(dataset, measuring)
    timeline = joined(Timelines(dataset.inputs, measuring, start, step, chunk=5))

    read_at = np.concatenate([dvl, gyroscope])
    expected = np.unique(read_at[read_at >= start])
    assert_allclose(timeline.time, expected, rtol=0, atol=1e-12)
    assert timeline.substep_offset[1] == 0, "nothing leads to the first event"
    assert np.all(timeline.substep_duration > 0.0)
    assert np.all(timeline.substep_duration <= step * (1 + 1e-5))
    for event in range(1, timeline.time.size):
        substeps = slice(timeline.substep_offset[event], timeline.substep_offset[event + 1])
        durations = timeline.substep_duration[substeps]
        gap = timeline.time[event] - timeline.time[event - 1]
        assert durations.sum() == pytest.approx(gap, abs=1e-12)
        middles = timeline.time[event - 1] + np.cumsum(durations) - 0.5 * durations
        for middle, row in zip(middles, timeline.substep_input[substeps], strict=True):
            assert row == np.flatnonzero(dataset.inputs.time <= middle)[-1]
    assert timeline.substep_offset[-1] == timeline.substep_duration.size == timeline.substep_input.size


def test_chunks_backwards_are_the_same(experiment_with):
    rng = np.random.default_rng(0)
    clocks = {name: np.sort(rng.choice(9000, 60, replace=False)) * 1e-3 for name in ("dvl", "gyroscope")}
    # Nothing between 3 and 6 s, so that the chunk after the gap follows an event far before.
    clocks = {name: time[(time < 3.0) | (time > 6.0)] for name, time in clocks.items()}
    dataset = a_dataset(experiment_with(), np.arange(0.0, 9.0, 0.37), **clocks)
    timelines = Timelines(dataset.inputs, measuring_sensors(dataset), 0.1, 0.02, chunk=7)
    forwards, backwards = [*timelines], [*reversed(timelines)]
    assert len(forwards) > 10
    for one, other in zip(forwards, reversed(backwards), strict=True):
        for rows, same in zip(one, other, strict=True):
            assert_array_equal(rows, same)


@given(dvl=clock, gyroscope=clock, attitude=clock)
def test_every_measurement_from_the_start_on_appears_once_at_its_time(dvl, gyroscope, attitude, experiment_with):
    clocks = {"dvl": dvl, "gyroscope": gyroscope, "attitude": attitude}
    dataset = a_dataset(experiment_with(), [0.0, 1.0], **clocks)
    measuring = measuring_sensors(dataset)
    start, _ = initial_motion(dataset, measuring)
    assert start == max(times[0] for times in clocks.values())
    timeline = joined(Timelines(dataset.inputs, measuring, start, 0.02, chunk=4))
    event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
    assert event.size == len(timeline.measurement)
    for sensor, (name, times) in enumerate(clocks.items()):
        rows = timeline.measurement_sensor == sensor
        used = times >= start
        assert_allclose(timeline.time[event[rows]], times[used], rtol=0, atol=1e-12)
        assert np.array_equal(timeline.measurement[rows], dataset.sensors[name].values[used])


def test_missing_components_stay_and_missing_samples_go(experiment_with):
    dataset = a_dataset(experiment_with(), [0.0], dvl=[0.0, 1.0, 2.0])
    values = dataset.sensors["dvl"].values
    values[1], values[2, 0] = np.nan, np.nan
    (timeline,) = Timelines(dataset.inputs, measuring_sensors(dataset), 0.0, 0.1)
    assert_allclose(timeline.time, [0.0, 2.0])
    assert np.array_equal(timeline.measurement, [[0.0, 1.0, 2.0], [np.nan, 7.0, 8.0]], equal_nan=True)


def test_clocks_that_differ_by_rounding_share_an_event(experiment_with):
    tenths = np.arange(50) * 0.1
    summed = np.cumsum(np.full(50, 0.1)) - 0.1
    assert np.any(tenths != summed)
    dataset = a_dataset(experiment_with(), [0.0], dvl=tenths, gyroscope=summed)
    chunks = list(Timelines(dataset.inputs, measuring_sensors(dataset), 0.0, 1.0, chunk=2))
    assert sum(chunk.time.size for chunk in chunks) == 50
    assert len(chunks) == 25


@pytest.mark.parametrize(("last_input", "covers"), [(4.0, True), (5.0, True), (2.9, False)])
def test_inputs_that_end_long_before_the_measurements_are_refused(last_input, covers, experiment_with):
    """They hold until the next one: here for as long as the longest pause among them, 2 s."""
    dataset = a_dataset(experiment_with(), [0.0, 2.0, 2.5], dvl=[0.0, 5.0])
    inputs = InputRecord(np.array([0.0, 2.0, last_input]), dataset.inputs.values[:3])
    dataset = Dataset(inputs, dataset.sensors, dataset.experiment)
    if covers:
        Timelines(dataset.inputs, measuring_sensors(dataset), 0.0, 1.0)
    else:
        with pytest.raises(DataError, match=r"inputs end at t = 2\.9 s.*5 s"):
            Timelines(dataset.inputs, measuring_sensors(dataset), 0.0, 1.0)


def test_filter_starts_when_every_sensor_has_measured(experiment_with):
    dataset = a_dataset(experiment_with(), [0.0], dvl=[0.0, 0.4, 0.8], gyroscope=[0.5, 0.7])
    dataset.sensors["dvl"].values[:, 2] = np.nan
    dataset.sensors["dvl"].values[0] = [1.0, 2.0, 3.0]
    start, motion = initial_motion(dataset, measuring_sensors(dataset))
    assert start == 0.5
    assert_allclose(motion, [3.0, 4.0, 3.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0])


def test_no_filter_starts_before_the_first_input(experiment_with):
    dataset = a_dataset(experiment_with(), [2.0, 3.0], dvl=[0.0, 1.0, 2.5, 4.0])
    start, _ = initial_motion(dataset, measuring_sensors(dataset))
    assert start == 2.0


def test_measurement_rows_select_measured_states(experiment_with, rng):
    dataset = a_dataset(experiment_with(), [0.0], attitude=[0.0, 1.0], dvl=[0.0, 1.0])
    measuring = measuring_sensors(dataset)
    coefficients = tuple(Quantity(f"c{i}", "1", "", "") for i in range(5))
    blocks = StateBlock("coefficients", coefficients, (1.0,) * 5), StateBlock("motion", MOTION, (1.0,) * 9, (1.0,) * 9)
    sensors = measurement_model(measuring, StateLayout(reversed(blocks)), np.inf, np.inf)
    values = rng.standard_normal(14)
    motion = dict(zip(MOTION_SYMBOLS, values[5:], strict=True))
    for sensor, (name, symbols) in enumerate({"attitude": ("phi", "theta", "psi"), "dvl": ("u", "v", "w")}.items()):
        assert list(measuring)[sensor] == name
        assert_allclose(sensors.matrix[sensor] @ values, [motion[symbol] for symbol in symbols])
        assert_allclose(sensors.variance[sensor], [0.01, 0.04, 0.09])
        assert sensors.angular[sensor].all() == (name == "attitude")


def test_raw_sensors_of_the_ahrs_are_no_measurements_of_motion(short_run):
    assert set(measuring_sensors(short_run)) == {"gyroscope", "dvl", "attitude"}


def test_a_dataset_without_a_sensor_of_motion_is_refused(experiment_with):
    dataset = a_dataset(experiment_with(), [0.0], dvl=[0.0, 1.0])
    dataset.sensors["dvl"].values[:] = np.nan
    with pytest.raises(DataError, match="no valid sample"):
        measuring_sensors(dataset)


@pytest.mark.parametrize("deviation", [0.0, -1.0, np.nan])
def test_a_sensor_that_states_no_noise_is_refused(deviation, experiment_with):
    dataset = a_dataset(experiment_with(), [0.0], dvl=[0.0, 1.0])
    dataset.sensors["dvl"].standard_deviation[1] = deviation
    with pytest.raises(DataError, match="dvl"):
        measuring_sensors(dataset)


def test_substeps_are_limited(experiment_with):
    """The busiest sensor over all falls silent; others go on without it."""
    early, late = np.arange(300) * 0.01, 3.0 + np.arange(200) * 0.01
    dataset = a_dataset(experiment_with(), [0.0], gyroscope=early, dvl=late, attitude=late)
    measuring = measuring_sensors(dataset)
    chunks = list(Timelines(dataset.inputs, measuring, 0.0, 0.02, chunk=20))
    assert max(np.bincount(chunk.measurement_sensor).max() for chunk in chunks) <= 21
    assert sum(len(chunk.measurement) for chunk in chunks) == 700


@pytest.mark.parametrize("since", [0.0, 1e7, 9e7])
def test_no_measurement_is_lost_on_a_clock_that_counts_from_long_ago(since, experiment_with):
    dataset = a_dataset(
        experiment_with(), [since], dvl=since + np.arange(50) * 0.1, gyroscope=since + np.arange(500) * 0.01
    )
    chunks = list(Timelines(dataset.inputs, measuring_sensors(dataset), since, 0.02, chunk=30))
    assert sum(len(chunk.measurement) for chunk in chunks) == 550
    (alone,) = Timelines(dataset.inputs, measuring_sensors(dataset), since + 4.99, 0.02)
    assert alone.time.size == 1


def test_gap_of_hours_is_refused(experiment_with):
    """As from a clock that was set while the log ran."""
    times = np.array([0.0, 0.1, 9e7, 9e7 + 0.1])
    dataset = a_dataset(experiment_with(), times, dvl=times)
    with pytest.raises(DataError, match=r"t = 0\.1 s to 9e\+07 s.*longest_gap"):
        list(Timelines(dataset.inputs, measuring_sensors(dataset), 0.0, 0.02))


@given(dvl=clock, gyroscope=clock, data=st.data())
def test_between_equals_cut_records(dvl, gyroscope, data, experiment_with):
    dataset = a_dataset(experiment_with(), [0.0, 0.3, 1.0], dvl=dvl, gyroscope=gyroscope)
    begin, end = (np.sort([data.draw(st.sampled_from(sorted(dvl))) for _ in range(2)])).tolist()
    measuring = measuring_sensors(dataset)
    cut = {name: record.between(begin, end) for name, record in measuring.items()}
    fresh = joined(Timelines(dataset.inputs, cut, begin, 0.02))
    timeline = joined(Timelines(dataset.inputs, measuring, min(dvl[0], gyroscope[0]), 0.02).between(begin, end))
    for one, other in zip(timeline, fresh, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
