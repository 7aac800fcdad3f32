"""Logs of text other than CSV in UTF-8: each holds numbers that are written here by hand."""

import json

import numpy as np
import pytest

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME
from auvid_cli.logs.formats.open_log import open_log

DATAFLASH = """FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Columns
FMT, 10, 31, ATT, Qcc, TimeUS,Roll,Pitch
FMT, 11, 49, IMU, QBf, TimeUS,I,GyrX
FMT, 12, 49, MSG, QZ, TimeUS,Message
UNIT, 0, d, deg
FMT, 13, 49, FMTU, QBNN, TimeUS,FmtType,UnitIds,MultIds
FMT, 14, 49, UNIT, QbZ, TimeUS,Id,Label
UNIT, 0, d, deg
UNIT, 0, s, s
FMTU, 0, 10, sdd, F00
ATT, 5000000, -0.70, 0.12
IMU, 5000300, 0, 0.001
IMU, 5000320, 1, 0.002
MSG, 5000400, Ready, in 3, 2
ATT, 5100000, -0.71, 0.13
IMU, 5100300, 0, 0.003
"""


@pytest.fixture
def opened(tmp_path):
    def run(name, content):
        path = tmp_path / name
        path.write_bytes(content)
        return open_log(path)

    return run


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_text_is_read(opened, encoding):
    log = opened("log.csv", ("\ufefft,Höhe\n0,1.5\n1,2.5\n").encode(encoding))
    values = log.read("", ["t", "Höhe"])
    assert values["t"].tolist() == [0.0, 1.0]
    assert values["Höhe"].tolist() == [1.5, 2.5]


def test_damaged_utf_16_text_is_refused(opened):
    with pytest.raises(FileError, match="UTF-16"):
        opened("log.csv", b"\xff\xfet\0,\0u\0\n\0\x00\xd8")


@pytest.mark.parametrize("name", ["00000012.log", "00000012.BIN"])
def test_dataflash_text_has_table_for_each_message(opened, name):
    log = opened(name, DATAFLASH.encode())
    assert [column.unit for column in log.tables()["ATT"]] == ["s", "s", "deg", "deg"]
    attitude = log.read("ATT", [LOG_TIME, "Roll"])
    assert attitude[LOG_TIME] == pytest.approx([5.0, 5.1])
    assert attitude["Roll"].tolist() == [-0.70, -0.71]
    assert log.read("IMU[0]", ["GyrX"])["GyrX"].tolist() == [0.001, 0.003]
    assert log.read("MSG", ["Message"])["Message"].tolist() == ["Ready, in 3, 2"]


def test_dataflash_text_leaves_out_cut_row(opened):
    log = opened("a.log", (DATAFLASH + "ATT, 52000").encode())
    assert log.read("ATT", ["Roll"])["Roll"].size == 2
    assert log.remarks() == ("the last row is cut short: left out",)


def test_dataflash_text_with_short_row_inside_is_refused(opened):
    log = opened("a.log", (DATAFLASH + "ATT, 52000\nATT, 5300000, 1, 2\n").encode())
    with pytest.raises(FileError, match=r"a\.log:17: ATT with 1 fields"):
        log.tables()


def velocity(number, valid=True):
    """Return a report of a DVL A50 in the form of the protocol of Water Linked."""
    return {
        "time": 106.4,
        "vx": 0.1 * number,
        "vy": 0.0,
        "vz": -0.01,
        "fom": 0.001,
        "altitude": 0.49,
        "transducers": [{"id": k, "distance": 0.5 + k, "beam_valid": valid} for k in range(2)],
        "velocity_valid": valid,
        "status": 0,
        "format": "json_v3",
        "type": "velocity",
        "time_of_validity": 1638191471563017 + 100_000 * number,
    }


def test_json_lines_form_table_for_each_type(opened):
    lines = [
        velocity(0),
        {"ts": 1.5, "yaw": 3.0, "type": "position_local"},
        velocity(1, valid=False),
        {"response": "x"},
    ]
    log = opened("a50.json", "".join(json.dumps(line) + "\n" for line in lines).encode() + b'{"time": 1')
    values = log.read("velocity", ["vx", "velocity_valid", "transducers[1].distance", "time_of_validity"])
    assert values["vx"] == pytest.approx([0.0, 0.1])
    assert values["velocity_valid"].tolist() == [1.0, 0.0]
    assert values["transducers[1].distance"].tolist() == [1.5, 1.5]
    assert np.diff(values["time_of_validity"]) == pytest.approx([100_000.0])
    assert log.read("position_local", ["yaw"])["yaw"].tolist() == [3.0]
    assert log.remarks() == ("the last row is cut short: left out",)


def test_json_lines_with_broken_line_are_refused(opened):
    with pytest.raises(FileError, match=r"a50\.json:2: no JSON object"):
        opened("a50.json", b'{"a": 1}\n{"a": \n{"a": 2}\n').tables()


@pytest.mark.parametrize("line", [f'{{"a": 1{"0" * 400}}}', '{"a":' * 2000 + "1" + "}" * 2000, "[1]"])
def test_json_lines_beyond_numbers_are_refused(opened, line):
    with pytest.raises(FileError, match=r"a50\.json:2: "):
        opened("a50.json", f'{{"a": 1}}\n{line}\n{{"a": 2}}\n'.encode()).tables()


def test_ros2_echo_without_names_gets_names_of_its_message(opened):
    row = "{},{},imu_link," + ",".join(str(0.25 * k) for k in range(37)) + "\n"
    log = opened("imu.csv", "".join(row.format(1718000000, 100_000_000 * k) for k in range(3)).encode())
    values = log.read("", ["header.stamp.nanosec", "orientation.w", "angular_velocity.x", "linear_acceleration.z"])
    assert values["header.stamp.nanosec"].tolist() == [0.0, 1e8, 2e8]
    assert values["orientation.w"].tolist() == [0.75] * 3
    assert values["angular_velocity.x"].tolist() == [0.25 * 13] * 3
    assert values["linear_acceleration.z"].tolist() == [0.25 * 27] * 3
