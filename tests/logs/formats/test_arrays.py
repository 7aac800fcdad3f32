"""Files of named arrays, written by NumPy, SciPy and h5py themselves."""

import os

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from scipy.io.matlab import MatlabOpaque

from auvid_cli.errors import FileError
from auvid_cli.logs.formats import arrays
from auvid_cli.logs.formats.log import LogColumn
from auvid_cli.logs.formats.open_log import open_log

TIME = np.arange(5) * 0.1
ANGLES = np.arange(15.0).reshape(5, 3)


def names(log):
    return {table: [column.name for column in columns] for table, columns in log.tables().items()}


def assert_reads(log, table, expected):
    found = log.read(table, list(expected))
    assert list(found) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)


def test_arrays_of_equal_length_form_table(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, t=TIME, angles=ANGLES, flag=TIME > 0.15, clock=np.array(["10:31:54"] * 5), mass=np.array(18.7))
    log = open_log(path)
    assert log.tables() == {
        "": (
            LogColumn("t"),
            LogColumn("angles[0]"),
            LogColumn("angles[1]"),
            LogColumn("angles[2]"),
            LogColumn("flag"),
            LogColumn("clock", is_text=True),
        )
    }
    assert_reads(log, "", {"angles[2]": [2, 5, 8, 11, 14], "flag": [0, 0, 1, 1, 1], "clock": ["10:31:54"] * 5})


def test_other_lengths_form_tables_named_by_first_array(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, imu_time=TIME, p=TIME + 1, dvl_time=TIME[:2], u=TIME[:2] + 2)
    assert names(open_log(path)) == {"imu_time": ["imu_time", "p"], "dvl_time": ["dvl_time", "u"]}
    assert_reads(open_log(path), "dvl_time", {"u": [2.0, 2.1]})


def test_a_structured_array_is_a_table_of_its_fields(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, dvl=np.array([(0.0, 1.5), (0.2, 1.6)], dtype=[("time", "f8"), ("u", "f4")]))
    assert_reads(open_log(path), "dvl", {"u": np.array([1.5, 1.6], np.float32), "time": [0.0, 0.2]})


def test_time_may_run_along_the_rows(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, t=TIME, angles=ANGLES.T)
    assert_reads(open_log(path), "", {"angles[1]": [1, 4, 7, 10, 13], "t": TIME})


@pytest.mark.slow
def test_structs_of_matlab_are_tables_of_their_fields(tmp_path):
    path = tmp_path / "log.mat"
    savemat(
        path,
        {
            "t": TIME[:, None],
            "dvl": {"time": TIME[:3], "u": TIME[:3] + 1, "beams": {"range": TIME[:3] + 2}},
            "run": {"imu": {"time": TIME, "q": ANGLES}, "depth": {"time": TIME[:2], "d": TIME[:2]}},
            "name": "REMUS",
        },
    )
    log = open_log(path)
    assert names(log) == {
        "": ["t"],
        "dvl": ["time", "u", "beams.range"],
        "run.imu": ["time", "q[0]", "q[1]", "q[2]"],
        "run.depth": ["time", "d"],
    }
    assert_reads(log, "run.imu", {"q[1]": [1, 4, 7, 10, 13], "time": TIME})
    assert_reads(log, "dvl", {"beams.range": TIME[:3] + 2})
    assert_reads(log, "", {"t": TIME})


@pytest.mark.slow
def test_a_structure_with_time_of_simulink_is_a_table(tmp_path):
    path = tmp_path / "log.mat"
    signals = np.array([({"values": TIME + 1, "label": "u"},), ({"values": TIME + 2, "label": "v"},)], dtype=object)
    savemat(path, {"out": {"time": TIME, "signals": signals[:, 0]}})
    log = open_log(path)
    assert names(log) == {"out": ["time", "signals[0].values", "signals[1].values"]}
    assert_reads(log, "out", {"signals[1].values": TIME + 2})


def test_matlab_7_3_file_reads_alike(tmp_path):
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        # MATLAB keeps the columns of an array together: there its dimensions are in the other order.
        file["t"] = TIME[None, :]
        file["angles"] = ANGLES.T
        file["dvl/u"] = TIME[None, :3]
        file["dvl/time"] = TIME[None, :3] + 1
        file["name"] = np.frombuffer(b"R\0E\0M\0", np.uint16)[:, None]
        file["name"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")
    log = open_log(path)
    assert names(log) == {"": ["angles[0]", "angles[1]", "angles[2]", "t"], "dvl": ["time", "u"]}
    assert_reads(log, "", {"t": TIME, "angles[2]": [2, 5, 8, 11, 14]})
    assert_reads(log, "dvl", {"u": TIME[:3]})


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["npz", "mat"])
def test_truncated_file_raises_file_error(tmp_path, suffix):
    path = tmp_path / f"log.{suffix}"
    arrays = {"t": TIME, "noise": np.random.default_rng(0).normal(size=5000)}
    if suffix == "npz":
        np.savez(path, **arrays)
    else:
        savemat(path, arrays)
    whole = path.read_bytes()
    for length in (200, 1000, len(whole) // 2, len(whole) - 100):
        path.write_bytes(whole[:length])
        with pytest.raises(FileError, match=r"log\."):
            open_log(path).tables()


def test_file_without_arrays_raises_file_error(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, mass=18.7, note="no log")
    with pytest.raises(FileError, match="no arrays of numbers"):
        open_log(path).tables()


def test_missing_column_raises_file_error_with_nearest(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, time=TIME, depth=TIME)
    with pytest.raises(FileError, match=r"no column named 'dept'.*'depth'"):
        open_log(path).read("", ["dept"])


def test_matlab_file_that_crashes_reader_raises_file_error(tmp_path, monkeypatch):
    savemat(tmp_path / "log.mat", {"t": TIME})
    # In place of what SciPy does on some damaged files.
    monkeypatch.setattr(arrays, "loadmat", _abort)
    with pytest.raises(FileError, match=r"log\.mat: damaged"):
        open_log(tmp_path / "log.mat").tables()


def _abort(path, **options):
    os.abort()


@pytest.mark.slow
def test_signal_one_sample_short_has_the_time_of_its_struct(tmp_path):
    path = tmp_path / "log.mat"
    savemat(path, {"dvl": {"rovtime": TIME, "u": TIME[:-1] + 1}, "depth": {"time": TIME[:-1], "d": TIME[:-1]}})
    log = open_log(path)
    assert names(log) == {"dvl": ["rovtime", "u"], "depth": ["time", "d"]}
    assert_reads(log, "dvl", {"rovtime": TIME, "u": [*(TIME[:-1] + 1), np.nan]})
    (remark,) = log.remarks()
    assert remark.startswith("dvl.u: one sample shorter")


@pytest.mark.slow
def test_matrix_of_many_columns_has_time_along_rows(tmp_path):
    path = tmp_path / "log.mat"
    savemat(path, {"data": np.arange(600.0).reshape(3, 200)})
    assert_reads(open_log(path), "", {"data[2]": np.arange(400.0, 600.0)})


def test_object_of_matlab_is_named_with_its_export(tmp_path):
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = TIME[None]
        run = file.create_group("run")
        run["TT"] = np.zeros((1, 6), np.uint32)
        run["TT"].attrs["MATLAB_class"] = np.bytes_("timetable")
        run["TT"].attrs["MATLAB_object_decode"] = np.int32(3)
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + content[512:])
    log = open_log(path)
    assert names(log) == {"": ["t"]}
    (remark,) = log.remarks()
    assert remark.startswith("run.TT is a timetable of MATLAB")
    assert "timetable2table(run.TT)" in remark


def test_object_of_old_matlab_file_is_named(tmp_path, monkeypatch):
    fields = [("s0", "O"), ("s1", "O"), ("s2", "O"), ("arr", "O")]
    opaque = np.array([(b"when", b"MCOS", b"datetime", np.zeros(6, np.uint32))], fields).view(MatlabOpaque)
    path = tmp_path / "log.mat"
    savemat(path, {"t": TIME})
    monkeypatch.setattr(arrays.MatlabLog, "content", {"t": TIME, "None": opaque})
    assert "when is a datetime of MATLAB" in open_log(path).remarks()[0]
    monkeypatch.setattr(arrays.MatlabLog, "content", {"None": opaque})
    with pytest.raises(FileError, match=r"when is a datetime of MATLAB.*posixtime"):
        open_log(path).tables()
