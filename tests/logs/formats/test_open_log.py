"""Kinds of logs are recognised by their content."""

import gzip
import io
import os
import re
import sys
import zipfile
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import Log
from auvid_cli.logs.formats.open_log import LogKind, open_log


def zipped(*names):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in names:
            archive.writestr(name, "content")
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("log.csv", b"", "empty"),
        ("log.csv", b"#ROSBAG V2.0\n", r"looks like a ROS 1 bag, whose name must end in \.bag"),
        ("log.bag", b"\x89MCAP0\r\n", r"looks like an MCAP bag, whose name must end in \.mcap"),
        (
            "log.csv",
            b"\xa3\x95\x80\x80\x59FMT\0",
            r"looks like an ArduPilot DataFlash log, whose name must end in \.bin",
        ),
        ("log.bin", bytes(8) + b"\xfd\x09\0\0\0\x01\x01\0\0\0", r"looks like a MAVLink telemetry log.* \.tlog"),
        ("log.h5", b"\x89HDF\r\n\x1a\n\0", "looks like an HDF5 file"),
        ("log.csv", zipped("xl/workbook.xml"), "Excel workbook: save it as CSV"),
        ("log.zip", zipped("log.csv"), "zip archive: unpack it first"),
        (
            "log.npz",
            zipped("time.npy", "u.npy")[:-30],
            "looks like a NumPy archive .* that is cut short: copy it again",
        ),
        ("log.bag.gz", gzip.compress(b"#ROSBAG V2.0\nE\0\0\0\x0a\0\0\0conn", mtime=0), "unpack it with gunzip first"),
        ("log.csv.gz", gzip.compress(b"t,u\n1,2\n", mtime=0)[:10] + bytes(range(255, 0, -1)), "cannot be read"),
        ("log.dat", bytes(range(256)), "unknown kind"),
    ],
)
def test_unreadable_content_raises_file_error_with_hint(tmp_path, name, content, complaint):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileError, match=complaint):
        open_log(path)


def test_text_log_may_have_any_name(tmp_path):
    path = tmp_path / "20210609.log"
    path.write_text("t,u\n1,2\n")
    np.testing.assert_array_equal(open_log(path).read("", ["u"])["u"], [2.0])


@pytest.mark.parametrize("kind", LogKind)
def test_every_kind_of_log_has_a_reader(kind):
    module, _, reader = kind.reader.partition(".")
    assert issubclass(getattr(import_module(f"auvid_cli.logs.formats.{module}"), reader), Log)


def test_missing_file_raises_file_error(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        open_log(tmp_path / "log.csv")
    with pytest.raises(FileError, match=r"folder without metadata\.yaml"):
        open_log(tmp_path)


@pytest.mark.posix
def test_pipe_or_device_raises_file_error(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "pipe.csv", Path("/dev/zero")):
        with pytest.raises(FileError, match="pipe or a device"):
            open_log(path)


@pytest.mark.parametrize(
    ("package", "reader", "name", "content", "extra"),
    [
        ("rosbags.highlevel", "ros", "log.mcap", b"\x89MCAP0\r\n", "rosbags: run pip install '.[ros]'"),
        ("pymavlink.DFReader", "ardupilot", "log.BIN", b"\xa3\x95\x80", "pymavlink: run pip install '.[ardupilot]'"),
    ],
)
def test_missing_package_raises_file_error(tmp_path, monkeypatch, package, reader, name, content, extra):
    monkeypatch.delitem(sys.modules, f"auvid_cli.logs.formats.{reader}", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileError, match=rf"^reading \w+ \w+ needs the package {re.escape(extra)}"):
        open_log(path)


def test_git_lfs_pointer_raises_file_error_with_command(tmp_path):
    path = tmp_path / "dive_0.db3"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0123\nsize 175083520\n")
    with pytest.raises(FileError, match="git lfs pull"):
        open_log(path)
