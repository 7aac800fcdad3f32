"""Whatever little there is, an inspection says something of it instead of failing."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord
from auvid_cli.errors import DataError
from auvid_cli.inspection.inspect import inspect_dataset


def cut(dataset, names, until):
    sensors = {}
    for name in names:
        record = dataset.sensors[name]
        kept = record.time < until
        sensors[name] = replace(record, time=record.time[kept], values=record.values[kept])
    kept = dataset.inputs.time <= until
    return replace(dataset, sensors=sensors, inputs=InputRecord(dataset.inputs.time[kept], dataset.inputs.values[kept]))


@pytest.mark.slow
@pytest.mark.parametrize("until", [0.005, 0.2, 3.0, 40.0])
def test_any_two_short_records_give_finite_checks(until, sound_run):
    dataset = sound_run()
    for names in [*combinations(dataset.sensors, 2), *((name,) for name in dataset.sensors), ()]:
        inspection = inspect_dataset(cut(dataset, names, until))
        assert set(inspection.presence) == set(names)
        assert "nan" not in " ".join(check.statistic for check in inspection.checks)
        subjects = {check.subject for check in inspection.checks}
        assert set(names) <= subjects


def test_a_dataset_without_sensors_fails(sound_run):
    inspection = inspect_dataset(replace(sound_run(), sensors={}))
    assert [check.subject for check in inspection.checks if check.passed is False] == ["dataset"]


def test_empty_sensor_fails_and_others_are_checked(sound_run, changed):
    def silence(time, values):
        values[:] = np.nan

    inspection = inspect_dataset(changed(sound_run(), "dvl", silence))
    (check,) = [check for check in inspection.checks if check.subject == "dvl"]
    assert (check.check, check.passed) == ("missing", False)
    assert any(check.subject == "gyroscope" and check.check == "q against theta" for check in inspection.checks)


def test_resting_vehicle_has_too_little_excitation(sound_run):
    dataset = sound_run()
    rng = np.random.default_rng(3)
    still = {
        name: replace(record, values=record.standard_deviation * rng.standard_normal(record.values.shape))
        for name, record in dataset.sensors.items()
    }
    inputs = replace(dataset.inputs, values=0.0 * dataset.inputs.values)
    checks = inspect_dataset(replace(dataset, sensors=still, inputs=inputs)).checks
    excitation = {check.subject: check for check in checks if check.check == "excitation"}
    assert {subject for subject, check in excitation.items() if check.passed} == set()
    assert "N_uudr" in excitation["rudder"].advice
    for name in ("p against phi", "q against theta", "r against psi", "response of r"):
        (check,) = [check for check in checks if check.check == name]
        assert check.passed is None
        assert check.statistic.startswith("undetermined: too little excitation")


def test_noiseless_record_is_checked(sound_run):
    dataset = sound_run()
    dvl, gyroscope = dataset.sensors["dvl"], dataset.sensors["gyroscope"]
    empty = replace(dvl, time=dvl.time[:0], values=dvl.values[:0])
    perfect = replace(gyroscope, values=0.0 * gyroscope.values, standard_deviation=np.zeros(3))
    sensors = dataset.sensors | {"dvl": empty, "gyroscope": perfect}
    checks = {(c.subject, c.check): c for c in inspect_dataset(replace(dataset, sensors=sensors)).checks}
    assert checks["dvl", "missing"].passed is False
    assert checks["gyroscope", "stuck"].passed is False
    assert checks["gyroscope", "spikes"].passed is True


def test_fin_with_rounding_noise_is_undetermined(sound_run):
    """As two opposite fins that cancel."""
    dataset = sound_run()
    values = dataset.inputs.values.copy()
    values[:, 0] *= -1e-15
    checks = inspect_dataset(replace(dataset, inputs=replace(dataset.inputs, values=values))).checks
    (check,) = [check for check in checks if check.check == "response of r"]
    assert check.passed is None


def test_span_of_weeks_is_an_error(sound_run):
    dataset = sound_run()
    dvl = dataset.sensors["dvl"]
    time = dvl.time.copy()
    time[-1] = 5e7
    astray = replace(dataset, sensors=dataset.sensors | {"dvl": replace(dvl, time=time)})
    with pytest.raises(DataError, match="over two weeks"):
        inspect_dataset(astray)


def test_attitude_without_pitch_is_checked(sound_run, changed):
    def forget(time, values):
        values[:, 1] = np.nan

    inspection = inspect_dataset(changed(sound_run(), "attitude", forget))
    assert {check.subject for check in inspection.checks} >= {"attitude", "gyroscope"}
