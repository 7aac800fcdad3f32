"""The suggested map: what it finds in logs as they are written, and that it cannot be used unseen."""

import gzip
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.config.log_map import load_map
from auvid_cli.errors import ConfigError
from auvid_cli.logs.log import Column, Log
from auvid_cli.logs.open import open_log
from auvid_cli.logs.suggest import suggest
from auvid_cli.vehicle.parameters import PARAMETERS

TIME = np.arange(200) * 0.1
WAVE = np.sin(TIME)
NOISE = np.random.default_rng(1).standard_normal(TIME.size)


def written(path: Path, **columns: np.ndarray) -> Path:
    header = ",".join(name.replace("__", " ") for name in columns)
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


@pytest.fixture
def suggested(tmp_path):
    """Function: the suggested map of CSV columns, as text and as YAML."""

    def run(**columns):
        text = suggest([open_log(written(tmp_path / "dive 7.csv", **columns))], tmp_path)
        return text, yaml.safe_load(text)

    return run


def test_names_and_values_tell_sensors_units_and_inputs(suggested):
    text, found = suggested(
        **{"timestamp": 1e3 * TIME, "gyro_x": 9 * WAVE, "gyro_y": WAVE, "gyro_z": WAVE, "acc_z": -9.8 + 0.1 * NOISE},
        **{"roll": 20 * WAVE, "pitch": 10 * WAVE, "true_heading (deg)": 180 + 90 * WAVE, "depth": -3 + WAVE},
        **{"rudder": 20 * WAVE, "rpm": 600 + WAVE},
    )
    assert found["name"] == "dive_7"
    assert found["logs"] == {"dive_7": "dive 7.csv"}
    gyroscope = found["sensors"]["gyroscope"]
    assert gyroscope["columns"] == {"p": "gyro_x", "q": "gyro_y", "r": "gyro_z"}
    assert (gyroscope["unit"], gyroscope["time"]) == ("deg/s", {"column": "timestamp", "unit": "ms"})
    assert found["sensors"]["attitude"]["columns"] == {"phi": "roll", "theta": "pitch", "psi": "true_heading"}
    assert found["sensors"]["attitude"]["unit"] == "deg"
    assert found["sensors"]["depth"]["columns"]["down"] == {"column": "depth", "sign": -1}
    assert found["sensors"]["accelerometer"]["frame"] == "FRD"
    assert "no column found for fx, fy" in text
    assert found["inputs"]["rudder"] == {"column": "rudder", "unit": "deg"}
    assert found["inputs"]["thrust"]["revolutions"] == {"column": "rpm", "unit": "rpm"}
    assert "dvl" not in found["sensors"]


def test_noise_is_measured_and_left_to_the_user(suggested):
    text, found = suggested(t=TIME, u=2.0 + 0.03 * NOISE, rudder=0.1 * WAVE)
    assert found["sensors"]["dvl"]["standard_deviation"] is None
    # Of white noise of this size.
    assert "the signals look like 0.03" in text or "the signals look like 0.02" in text


@pytest.mark.parametrize("sign", [1, -1])
def test_fins_that_go_against_each_other_are_said(suggested, sign):
    text, _ = suggested(t=TIME, u=WAVE, fin_right=20 * WAVE, fin_left=sign * 20 * WAVE + 0.1 * NOISE)
    assert ("right and left go against each other" in text) == (sign < 0)


def test_sensor_upside_down_and_flag_of_validity(suggested):
    # The roll of a sensor that hangs from the deck: near +-180 degrees.
    roll = np.degrees(np.arctan2(np.sin(np.pi + 0.1 * WAVE), np.cos(np.pi + 0.1 * WAVE)))
    _, found = suggested(t=TIME, roll=roll, att_valid=np.ones(TIME.size), rudder=WAVE)
    assert found["sensors"]["attitude"]["mount"] == "upside down"
    assert found["sensors"]["attitude"]["valid"] == {"column": "att_valid", "values": [True, 1]}


def test_column_without_a_number_is_left_out(suggested):
    text, found = suggested(t=TIME, u=WAVE, v=np.full(TIME.size, np.nan), rudder=WAVE)
    assert found["sensors"]["dvl"]["columns"] == {"u": "u"}
    assert "no column found for v, w" in text


def test_fins_in_counts(suggested):
    _, found = suggested(t=TIME, u=WAVE, **{"Fin Yaw T": 128 + 90 * WAVE, "Fin Pitch R": 128 + 5 * WAVE})
    assert found["inputs"]["fins"]["top"] == {"column": "Fin Yaw T", "centre": 128, "scale": None}
    assert found["inputs"]["fins"]["right"]["scale"] is None


def test_quaternion_that_changes_is_the_attitude(tmp_path):
    still, moving = {axis: np.ones(TIME.size) for axis in "wxyz"}, {axis: WAVE for axis in "wxyz"}
    first = written(tmp_path / "a.csv", t=TIME, **{f"orientation.{axis}": q for axis, q in still.items()})
    second = written(tmp_path / "b.csv", t=TIME, **{f"orientation.{axis}": q for axis, q in moving.items()})
    found = yaml.safe_load(suggest([open_log(first), open_log(second)], tmp_path))
    attitude = found["sensors"]["attitude"]
    assert (attitude["log"], attitude["frame"], attitude["reference"]) == ("b", "FLU", "ENU")
    assert attitude["quaternion"]["w"] == "orientation.w"


def test_clock_as_text_and_a_compressed_log(tmp_path):
    path = tmp_path / "log.csv.gz"
    rows = "\n".join(f"59:{50 + k % 10}.0,{k}.5,{k}" for k in range(20))
    path.write_bytes(gzip.compress(f"Time,Vehicle depth (m),depth (m)\n{rows}\n".encode()))
    found = yaml.safe_load(suggest([open_log(path)], tmp_path))
    assert found["sensors"]["depth"]["time"] == {"column": "Time"}
    assert found["sensors"]["depth"]["unit"] == "m"


class OneColumn(Log):
    """A log of times and one wave, of any names and unit."""

    def __init__(self, path, table, column):
        super().__init__(path)
        self.table, self.column = table, column

    def tables(self):
        return {self.table: (Column("time"), self.column)}

    def read(self, table, columns):
        return {name: TIME if name == "time" else WAVE for name in columns}


NAMES = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zl", "Zp", "Cn", "Co")), max_size=12)


@given(
    NAMES, NAMES, st.sampled_from(["roll", "u", "rudder", "depth"]), st.sampled_from(["", "%", "deg", "m", "#", "°"])
)
def test_whatever_things_are_called_the_map_is_yaml(table, stem, ending, unit):
    column = Column(f"{stem}.{ending}", unit)
    found = yaml.safe_load(suggest([OneColumn(Path(f"{stem.replace('/', '')}7.csv"), table, column)], Path()))
    assert isinstance(next(iter(found["logs"])), str)
    rows = found["inputs"] if ending == "rudder" else next(iter(found["sensors"].values()))
    readings = rows["rudder"] if ending == "rudder" else next(iter(rows["columns"].values()))
    assert rows.get("table", "") == table
    assert (readings["column"] if isinstance(readings, dict) else readings) == column.name


def test_import_refuses_what_is_not_filled_in(suggested, tmp_path):
    text, _ = suggested(t=TIME, u=2.0 + WAVE, rudder=0.1 * WAVE)
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_map(path)
    for missing in ("vehicle.parameters.m: ", "vehicle.size.length: ", "sensors.dvl.standard_deviation: "):
        assert missing in str(caught.value)
    assert str(caught.value).count("got nothing") == text.count(": null # required") == len(PARAMETERS) + 2 + 1
