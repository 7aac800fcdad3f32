"""Data that an estimate was made from are found, in another file, in part, and shifted in time."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.experiment import ImportedRun, RecordedFile, Recording
from auvid_cli.errors import DataError
from auvid_cli.validation.data_leakage import check_unseen, have_run_in_common, other_vehicle


@pytest.fixture
def estimate(hand_made):
    return replace(hand_made([0.0, 1.0], {}), dataset_sha256="abc")


def within(dataset, since, until):
    """As a log that was cut, with another origin of time."""
    sensors = {}
    for name, record in dataset.sensors.items():
        kept = (record.time >= since) & (record.time < until)
        sensors[name] = replace(record, time=record.time[kept] - since, values=record.values[kept])
    return replace(dataset, sensors=sensors, sha256="other")


def test_own_dataset_is_refused(short_run, estimate):
    with pytest.raises(DataError, match="this time of the same data"):
        check_unseen(replace(short_run, sha256="abc"), estimate)


def test_unused_time_of_own_dataset_is_accepted(short_run, hand_made):
    estimate = replace(hand_made([0.0, 30.0], {}), dataset_sha256="abc")
    later = replace(within(short_run, 0.0, 60.0), sha256="abc")
    cut = {
        name: replace(r, time=r.time[r.time > 31.0], values=r.values[r.time > 31.0])
        for name, r in later.sensors.items()
    }
    check_unseen(replace(later, sensors=cut), estimate)
    with pytest.raises(DataError, match="this time of the same data"):
        check_unseen(later, estimate)


def test_same_log_with_another_map_is_refused(short_run, hand_made):
    """Its numbers may all differ by an offset; its clock says that they are the same."""

    def imported(origin):
        experiment = short_run.experiment
        recording = Recording(files=(RecordedFile(name="dive.csv", sha256="cde"),), map="a map", origin=origin)
        return ImportedRun(name="dive", vehicle=experiment.vehicle, recording=recording)

    estimate = replace(hand_made([0.0, 30.0], {}), experiment=imported(100.0), dataset_sha256="abc")
    with pytest.raises(DataError, match="this time of the same data"):
        check_unseen(replace(short_run, experiment=imported(110.0), sha256="other"), estimate)
    check_unseen(replace(short_run, experiment=imported(131.0), sha256="other"), estimate)


def test_copies_with_missing_and_held_values_are_found(rng):
    noise = rng.standard_normal((100, 3))
    without = noise.copy()
    without[:, 0] = np.nan
    assert have_run_in_common(without[20:60], noise)
    assert have_run_in_common(np.repeat(noise[20:60], 5, axis=0), noise)
    assert not have_run_in_common(without, rng.standard_normal((100, 3)))


@pytest.mark.slow
def test_copy_is_found_late_in_a_long_record(rng):
    """Equal measurements are counted at the beginning alone."""
    long = np.round(rng.standard_normal((120_000, 1)), 2)
    assert have_run_in_common(long[110_000:111_000], long)
    assert not have_run_in_common(np.round(rng.standard_normal((1000, 1)), 2), long)


@pytest.mark.slow
def test_held_coarse_depth_is_no_copy(rng):
    def held():
        drift = np.convolve(rng.standard_normal(2000), np.ones(40) / 40, "same")
        return np.round(12.0 + 0.02 * drift + 0.005 * rng.standard_normal(2000), 2)[:, None]

    one, other = held(), held()
    assert not have_run_in_common(one, other)
    assert have_run_in_common(one[500:1500], one)
    assert not have_run_in_common(np.round(one), np.round(one) % 2)


@pytest.mark.parametrize(("since", "until"), [(0.0, 60.0), (20.0, 40.0)])
def test_copied_measurements_are_refused(short_run, estimate, since, until):
    with pytest.raises(DataError, match="some of these measurements"):
        check_unseen(within(short_run, since, until), estimate, short_run)


def test_same_manoeuvre_with_other_noise_is_accepted(short_run, estimate, simulated_with):
    again = simulated_with("manoeuvre.duration=60 s", "seed=2")
    np.testing.assert_array_equal(again.inputs.values[:100], short_run.inputs.values[:100])
    check_unseen(replace(again, sha256="other"), estimate, short_run)


def test_constant_sensor_is_no_copy(rng):
    still = np.ones((100, 3))
    assert not have_run_in_common(still, still)
    assert not have_run_in_common(np.full((100, 3), np.nan), still)
    noise = rng.standard_normal((100, 3))
    assert not have_run_in_common(noise[:7], noise)
    assert have_run_in_common(noise[11:30], noise)


def test_other_mass_is_another_vehicle(short_run, estimate, with_settings):
    assert other_vehicle(short_run, estimate) == []
    assert other_vehicle(with_settings(short_run, "vehicle.coefficients.N_uvl=-1"), estimate) == []
    changed = with_settings(short_run, "vehicle.parameters.m=50", "vehicle.size.length=3 m")
    assert other_vehicle(changed, estimate) == ["m", "length"]
