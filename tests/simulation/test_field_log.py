"""A simulated survey in the form of logs from the field."""

import csv

import numpy as np
import pytest
import yaml

from auvid_cli.api.data import import_logs
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.simulation.field_log import field_log
from auvid_cli.simulation.simulate import simulate

DURATION = ("manoeuvre.duration=60 s",)


@pytest.fixture(scope="module")
def survey():
    return simulate(load_experiment(find_experiment("field"), DURATION))


def test_each_device_has_file_with_units(survey):
    texts = field_log(survey)
    assert [*texts] == ["fins.csv", "compass.csv", "dvl.csv", "depth.csv", "vehicle.yaml", "map.yaml"]
    rows = [*csv.reader(texts["fins.csv"].splitlines())]
    assert rows[:2] == [["time", "top", "bottom", "port", "starboard", "autonomous"], ["s", *["deg"] * 4, "bool"]]
    rudder, _ = np.rad2deg(survey.inputs.values[:, :2].T)
    assert np.array([row[1] for row in rows[2:]], float) == pytest.approx(-rudder, abs=0.006)


def test_dvl_log_is_in_knots_with_losses_of_lock(survey):
    rows = [*csv.reader(field_log(survey)["dvl.csv"].splitlines())][2:]
    time, *velocity = np.array([[cell or "nan" for cell in row[:4]] for row in rows], float).T
    locked = np.array([row[4] == "True" for row in rows])
    record = survey.sensors["dvl"]
    assert np.column_stack(velocity)[locked] * 0.514444 == pytest.approx(
        (record.values * [1, -1, -1])[locked], abs=1e-3, nan_ok=True
    )
    assert np.ptp(time[~locked]) == pytest.approx(4.0, abs=0.5)


def test_vehicle_file_has_errors_that_depend_on_seed(survey):
    true = survey.experiment.vehicle.all_coefficients()
    believed = yaml.safe_load(field_log(survey)["vehicle.yaml"])
    for symbol, value in believed["coefficients"].items():
        assert abs(value / true[symbol] - 1.0) == pytest.approx(0.3)
    other = simulate(load_experiment(find_experiment("field"), (*DURATION, "seed=2")))
    assert yaml.safe_load(field_log(other)["vehicle.yaml"])["coefficients"] != believed["coefficients"]


def test_map_of_the_logs_gives_the_measurements_of_the_simulation(survey, tmp_path):
    for name, text in field_log(survey).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    read = import_logs(tmp_path / "map.yaml")
    assert list(read.sensors) == list(survey.sensors)
    for name, tolerance in {"dvl": 6e-4, "attitude": 1.1e-4, "depth": 6e-3}.items():
        found, made = read.sensors[name].values, survey.sensors[name].values
        known = np.isfinite(found)
        assert known.mean() > 0.5
        assert np.angle(np.exp(1j * (found - made)))[known] == pytest.approx(0.0, abs=tolerance)
        stated = np.nanmax(survey.sensors[name].standard_deviation)
        assert 0.99 * stated < np.nanmax(read.sensors[name].standard_deviation) < 2.1 * stated
    both = min(len(read.inputs.values), len(survey.inputs.values))
    found, made = (dataset.inputs.values[:both, :2] for dataset in (read, survey))
    assert found == pytest.approx(made, abs=np.deg2rad(0.006))
    assert read.inputs.values[:, 2] == pytest.approx(10.0)
    assert read.experiment.identification.prior.mean == "vehicle"
