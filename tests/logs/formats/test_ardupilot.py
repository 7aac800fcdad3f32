"""A DataFlash log written byte by byte as ArduPilot documents it, and a telemetry log written by pymavlink."""

import struct

import numpy as np
import pytest
from pymavlink.dialects.v10 import ardupilotmega as mavlink1
from pymavlink.dialects.v20 import ardupilotmega as mavlink2

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import LOG_TIME, LogColumn
from auvid_cli.logs.formats.open_log import open_log

FMT = 128
COUNT = 40
EPOCH = 1_743_805_382


def message(number, layout, *values):
    return b"\xa3\x95" + bytes([number]) + struct.pack("<" + layout, *values)


def described(number, layout, name, codes, columns, units, multipliers):
    """Format and units of a message."""
    texts = [name.encode(), codes.encode(), columns.encode()]
    unit_texts = [units.encode(), multipliers.encode()]
    length = 3 + struct.calcsize("<" + layout)
    return message(FMT, "BB4s16s64s", number, length, *texts) + message(132, "QB16s16s", 0, number, *unit_texts)


@pytest.fixture
def card(tmp_path):
    """Path of a log: ATT in 0.01 deg, two IMUs, a list, a text; every 20 ms from 1 s after switching on."""
    parts = [
        message(FMT, "BB4s16s64s", FMT, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"),
        message(FMT, "BB4s16s64s", 130, 76, b"UNIT", b"QbZ", b"TimeUS,Id,Label"),
        message(FMT, "BB4s16s64s", 131, 20, b"MULT", b"Qbd", b"TimeUS,Id,Mult"),
        message(FMT, "BB4s16s64s", 132, 44, b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds"),
        *(message(130, "Qb64s", 0, ord(sign), unit) for sign, unit in {"s": b"s", "d": b"deg", "E": b"rad/s"}.items()),
        *(message(131, "Qbd", 0, ord(sign), factor) for sign, factor in {"F": 1e-6, "0": 1.0}.items()),
        described(140, "Qhi", "ATT", "Qce", "TimeUS,Roll,Yaw", "sdd", "FBB"),
        described(141, "QBf", "IMU", "QBf", "TimeUS,I,GyrX", "s#E", "F-0"),
        described(142, "Q64s64s", "MSG", "QaZ", "TimeUS,List,Message", "s--", "F--"),
        described(143, "Q", "NONE", "Q", "TimeUS", "s", "F"),
    ]
    for k in range(COUNT):
        micro = 1_000_000 + 20_000 * k
        parts += [
            message(140, "Qhi", micro, 10 * k, -700 * k),
            *(message(141, "QBf", micro, unit, 0.25 * k + unit) for unit in (0, 1)),
        ]
    samples = struct.pack("<32h", *range(32))
    parts.append(message(142, "Q64s64s", 2_000_000, samples, b"ArduSub V4.1\0rubbish"))
    path = tmp_path / "00000012.BIN"
    path.write_bytes(b"".join(parts))
    return path


def test_each_sent_message_has_table(card):
    tables = open_log(card).tables()
    assert tables["ATT"] == (
        LogColumn(LOG_TIME, "s"),
        LogColumn("TimeUS", "µs"),
        LogColumn("Roll", "deg"),
        LogColumn("Yaw", "deg"),
    )
    assert tables["IMU"] == tables["IMU[0]"] == tables["IMU[1]"]
    assert tables["IMU"][-1] == LogColumn("GyrX", "rad/s")
    assert tables["MSG"][-2:] == (LogColumn("List[31]"), LogColumn("Message", is_text=True))
    assert "NONE" not in tables
    assert "FMT" not in tables


def test_written_values_are_read(card):
    log = open_log(card)
    k = np.arange(COUNT)
    attitude = log.read("ATT", ["Yaw", "Roll", LOG_TIME])
    assert list(attitude) == ["Yaw", "Roll", LOG_TIME]
    np.testing.assert_allclose(attitude[LOG_TIME], 1.0 + 0.02 * k, rtol=1e-15)
    np.testing.assert_allclose(attitude["Roll"], 0.1 * k, rtol=1e-15)
    np.testing.assert_allclose(attitude["Yaw"], -7.0 * k, rtol=1e-15)
    np.testing.assert_array_equal(log.read("IMU[1]", ["GyrX"])["GyrX"], 0.25 * k + 1)
    np.testing.assert_array_equal(log.read("IMU", ["I"])["I"], np.tile([0, 1], COUNT))
    text = log.read("MSG", ["Message", "List[7]"])
    assert text["Message"].tolist() == ["ArduSub V4.1"]
    assert text["List[7]"].tolist() == [7.0]


def test_truncated_last_message_is_left_out(card):
    end = card.read_bytes().index(b"ArduSub")
    card.write_bytes(card.read_bytes()[:end])
    log = open_log(card)
    assert "MSG" not in log.tables()
    assert len(log.read("ATT", ["Yaw"])["Yaw"]) == COUNT


def test_damaged_log_raises_file_error_with_byte(card, capfd):
    whole = bytearray(card.read_bytes())
    start = whole.index(message(140, "Q", 1_200_000))
    whole[start : start + 5] = bytes(5)
    card.write_bytes(whole)
    with pytest.raises(FileError, match=f"is damaged: bad header 0x00 0x00 at {start}"):
        open_log(card).tables()
    assert capfd.readouterr() == ("", "")


def test_missing_name_raises_file_error_with_nearest(card):
    with pytest.raises(FileError, match=r"no column in ATT named 'Rol'.*'Roll'"):
        open_log(card).read("ATT", ["Rol"])
    with pytest.raises(FileError, match=r"no table named 'IMU2'.*'IMU'"):
        open_log(card).read("IMU2", ["GyrX"])


@pytest.fixture(params=[mavlink1, mavlink2], ids=["version 1", "version 2"])
def telemetry(request, tmp_path):
    """Path of a log of attitudes at 10 Hz, quaternions, a text, and an unknown message."""
    dialect = request.param
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    packets = [(0, dialect.MAVLink_statustext_message(6, b"dive").pack(sender))]
    for k in range(COUNT):
        attitude = dialect.MAVLink_attitude_message(100 * k, 0.01 * k, 0.0, -0.02 * k, 0.1, 0.2, 0.0)
        quaternion = dialect.MAVLink_attitude_quaternion_cov_message(
            100_000 * k, [1.0, 0.0, 0.5 * k, 0.0], 0.1, 0.2, 0.3, [0.0] * 9
        )
        packets += [(100_000 * k, attitude.pack(sender)), (100_000 * k, quaternion.pack(sender))]
    unknown = bytearray(packets[0][1])
    unknown[5 if dialect is mavlink1 else 7] = 95
    packets.insert(3, (50_000, bytes(unknown)))
    path = tmp_path / "dive.tlog"
    path.write_bytes(b"".join(struct.pack(">Q", EPOCH * 10**6 + micro) + packet for micro, packet in packets))
    return path


def test_telemetry_has_units_of_mavlink(telemetry):
    log = open_log(telemetry)
    tables = log.tables()
    assert list(tables) == ["ATTITUDE", "ATTITUDE_QUATERNION_COV", "STATUSTEXT"]
    assert tables["ATTITUDE"][:3] == (
        LogColumn(LOG_TIME, "s"),
        LogColumn("time_boot_ms", "ms"),
        LogColumn("roll", "rad"),
    )
    k = np.arange(COUNT)
    attitude = log.read("ATTITUDE", ["yaw", LOG_TIME, "yawspeed"])
    np.testing.assert_array_equal(attitude["yaw"], (-0.02 * k).astype(np.float32))
    np.testing.assert_allclose(attitude[LOG_TIME], EPOCH + 0.1 * k, rtol=0, atol=3e-7)
    np.testing.assert_array_equal(attitude["yawspeed"], 0.0)
    np.testing.assert_array_equal(log.read("ATTITUDE_QUATERNION_COV", ["q[2]"])["q[2]"], 0.5 * k)
    assert log.read("STATUSTEXT", ["text"])["text"].tolist() == ["dive"]


@pytest.mark.parametrize("dialect", [mavlink1, mavlink2], ids=["version 1", "version 2"])
def test_list_in_telemetry_keeps_other_fields_numeric(dialect, tmp_path):
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    vector = dialect.MAVLink_debug_vect_message(b"field", 7, 1.0, 2.0, 3.0)
    path = tmp_path / "vector.tlog"
    path.write_bytes(struct.pack(">Q", EPOCH * 10**6) + vector.pack(sender))
    (columns,) = open_log(path).tables().values()
    assert [column.name for column in columns] == [LOG_TIME, "name", "time_usec", "x", "y", "z"]
    assert open_log(path).read("DEBUG_VECT", ["z"])["z"].tolist() == [3.0]


def test_truncated_telemetry_keeps_whole_messages(telemetry):
    telemetry.write_bytes(telemetry.read_bytes()[:-5])
    log = open_log(telemetry)
    assert len(log.read("ATTITUDE", ["yaw"])["yaw"]) == COUNT
    assert len(log.read("ATTITUDE_QUATERNION_COV", ["q[2]"])["q[2]"]) == COUNT - 1


def test_damaged_telemetry_raises_file_error_with_byte(telemetry):
    whole = bytearray(telemetry.read_bytes())
    start = whole.index(struct.pack(">Q", EPOCH * 10**6 + 100_000))
    altered = whole.copy()
    altered[start + 25] ^= 0xFF
    telemetry.write_bytes(altered)
    with pytest.raises(FileError, match=f"byte {start}: a damaged ATTITUDE message"):
        open_log(telemetry).read("ATTITUDE", ["yaw"])
    telemetry.write_bytes(whole[:start] + b"noise" + whole[start:])
    with pytest.raises(FileError, match=f"byte {start}: damaged"):
        open_log(telemetry).tables()
