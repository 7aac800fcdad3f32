"""Logs of PX4, DUNE (IMC) and MOOS, each written here by its own format."""

import gzip
import struct
import sys

import numpy as np
import pytest

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.open_log import open_log


def ulog():
    """Two instances of a topic, three samples each."""

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    def data(number, k):
        return message("D", struct.pack("<HQff", number, 1_000_000 + 250_000 * k, 0.5 * k, number))

    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    fields = message("F", b"rates:uint64_t timestamp;float[2] xyz;")
    added = b"".join(message("A", struct.pack("<BH", k, k) + b"rates") for k in (0, 1))
    return head + fields + added + b"".join(data(number, k) for k in range(3) for number in (0, 1))


def test_px4_instances_have_tables(tmp_path):
    pytest.importorskip("pyulog")
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog())
    log = open_log(path)
    fields = ["@log_time", "xyz[0]", "xyz[1]"]
    assert {table: [column.name for column in columns] for table, columns in log.tables().items()} == {
        "rates": fields,
        "rates[1]": fields,
    }
    found = log.read("rates[1]", ["@log_time", "xyz[0]", "xyz[1]"])
    assert [values.tolist() for values in found.values()] == [[1.0, 1.25, 1.5], [0.0, 0.5, 1.0], [1.0, 1.0, 1.0]]


def test_damaged_px4_log_raises_file_error(tmp_path):
    pytest.importorskip("pyulog")
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog()[:12])
    with pytest.raises(FileError, match=r"flight\.ulg: is a damaged ULog"):
        open_log(path).tables()


def imc_packets(imcpy, senders=(7,)):
    """Packets of two servos and of a text, one each second."""
    for k in range(4):
        servo = imcpy.SetServoPosition()
        servo.id, servo.value, servo.timestamp, servo.src = k % 2, 0.25 * k, 1e9 + k, senders[k % len(senders)]
        yield imcpy.Packet.serialize(servo)
        entity = imcpy.EntityInfo()
        entity.id, entity.label, entity.timestamp, entity.src = k, "x" * k, 1e9 + k, 7
        yield imcpy.Packet.serialize(entity)


def test_imc_messages_have_tables(tmp_path):
    imcpy = pytest.importorskip("imcpy")
    packets = b"".join(imc_packets(imcpy))
    path = tmp_path / "Data.lsf"
    path.write_bytes(packets + packets[:11])
    log = open_log(path)
    found = log.read("SetServoPosition", ["@log_time", "id", "value", "src"])
    assert found["id"].tolist() == [0.0, 1.0, 0.0, 1.0]
    assert found["value"].tolist() == [0.0, 0.25, 0.5, 0.75]
    np.testing.assert_array_equal(found["@log_time"], 1e9 + np.arange(4))
    # Messages with texts, of different sizes.
    assert sorted(log.read("EntityInfo", ["id"])["id"]) == [0.0, 1.0, 2.0, 3.0]
    assert log.remarks() == ("the last message is cut short: left out",)
    path.write_bytes(packets[:20] + bytes(20))
    with pytest.raises(FileError, match=r"Data\.lsf: is a damaged IMC log"):
        log.__class__(path).tables()


def test_imc_numbers_of_every_type_are_read_as_imcpy_does(tmp_path):
    imcpy = pytest.importorskip("imcpy")
    packets, sent = [], []
    for k in range(3):
        rpm = imcpy.Rpm()
        rpm.value, rpm.timestamp = (-1200, 0, 32767)[k], 1e9 + k
        state = imcpy.EstimatedState()
        state.lat, state.depth, state.timestamp, state.src_ent = 0.7 + 1e-12 * k, -1.5 * k, 1e9 + k, 255
        packets += [imcpy.Packet.serialize(rpm), imcpy.Packet.serialize(state)]
        sent.append((rpm.value, state.lat, state.depth))
    path = tmp_path / "Data.lsf"
    path.write_bytes(b"".join(packets))
    log = open_log(path)
    found = [log.read("Rpm", ["value"])["value"], *log.read("EstimatedState", ["lat", "depth"]).values()]
    np.testing.assert_array_equal(np.column_stack(found), sent)


def test_imc_senders_have_tables(tmp_path):
    imcpy = pytest.importorskip("imcpy")
    path = tmp_path / "Data.lsf"
    path.write_bytes(b"".join(imc_packets(imcpy, senders=(7, 9))))
    log = open_log(path)
    assert {"SetServoPosition[7.255]", "SetServoPosition[9.255]"} < {*log.tables()}
    assert log.read("SetServoPosition[9.255]", ["value"])["value"].tolist() == [0.25, 0.75]


@pytest.mark.parametrize(
    "damage",
    [
        lambda packets: [packets[0], packets[1], b"noise" * 9, *packets[2:]],
        lambda packets: [packets[0], packets[1], b"", packets[3][:-9] + bytes(9), *packets[2:]],
        lambda packets: [packets[0], packets[1], packets[3][:4] + b"\xff\xff" + packets[3][6:], *packets[2:]],
    ],
    ids=["noise", "wrong check sum", "wrong size"],
)
def test_damaged_imc_spot_is_skipped_and_counted(tmp_path, damage):
    imcpy = pytest.importorskip("imcpy")
    path = tmp_path / "Data.lsf.gz"
    path.write_bytes(gzip.compress(b"".join(damage([*imc_packets(imcpy)]))))
    log = open_log(path)
    assert log.read("SetServoPosition", ["value"])["value"].tolist() == [0.0, 0.25, 0.5, 0.75]
    assert log.remarks() == ("1 damaged spots skipped, up to the next message",)


def test_cut_compressed_imc_log_is_read_up_to_the_cut(tmp_path):
    imcpy = pytest.importorskip("imcpy")
    whole = gzip.compress(b"".join(imc_packets(imcpy)) * 50)
    path = tmp_path / "Data.lsf.gz"
    path.write_bytes(whole[: -len(whole) // 3])
    log = open_log(path)
    assert 4 <= log.read("SetServoPosition", ["value"])["value"].size < 200
    assert "cut short" in log.remarks()[0]


@pytest.mark.parametrize(("name", "content", "package"), [("a.ulg", ulog(), "pyulog"), ("a.lsf", b"\x54\xfe", "imcpy")])
def test_missing_package_raises_file_error(tmp_path, monkeypatch, name, content, package):
    monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=rf"needs the package {package}: run pip install"):
        open_log(tmp_path / name)


ALOG = """%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%
%% LOG FILE:       ./LOG_1/LOG_1.alog
%% LOGSTART           1635871234.5
%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%%
0.100   NAV_DEPTH       uSim       1.5
0.110   MODE            pHelm      MODE@ACTIVE: SURVEYING
0.200   NAV_DEPTH       uSim       1.6
"""


def test_moos_variables_have_tables(tmp_path):
    path = tmp_path / "LOG_1.alog"
    path.write_text(ALOG)
    log = open_log(path)
    found = log.read("NAV_DEPTH", ["@log_time", "value"])
    assert [values.tolist() for values in found.values()] == [[0.1, 0.2], [1.5, 1.6]]
    assert log.read("MODE", ["value"])["value"].tolist() == ["MODE@ACTIVE: SURVEYING"]
    path.write_text(ALOG + "0.3\n")
    with pytest.raises(FileError, match=r"LOG_1\.alog:8: .*expected time"):
        open_log(path).read("NAV_DEPTH", ["value"])


def test_missing_number_of_moos_variable_is_nan(tmp_path):
    path = tmp_path / "LOG_1.alog"
    path.write_text(ALOG + "0.300   NAV_DEPTH       uSim       NA\n")
    np.testing.assert_array_equal(open_log(path).read("NAV_DEPTH", ["value"])["value"], [1.5, 1.6, np.nan])


def test_binary_glider_log_raises_file_error_with_tool(tmp_path):
    path = tmp_path / "unit.dbd"
    path.write_bytes(b"dbd_label:    DBD(dinkum_binary_data)file\nencoding_ver:    5\n" + bytes(range(9)))
    with pytest.raises(FileError, match="Slocum glider: convert it with dbd2asc"):
        open_log(path)
