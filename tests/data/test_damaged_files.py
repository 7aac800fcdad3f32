"""Damaged files are refused in one line, and files are written completely or not at all."""

import os
import subprocess
import sys

import h5py
import numpy as np
import pytest

from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.data.files import locked, replacing, write_text
from auvid_cli.data.netcdf import SCHEMA_VERSION
from auvid_cli.errors import FileError

READ = {"dataset": read_dataset, "estimate": read_estimate}
pytestmark = pytest.mark.usefixtures("walked_here")


def refused(kind, path):
    """The message; it must be one line and name the file."""
    with pytest.raises(FileError) as caught:
        READ[kind](path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


def test_newer_schema_is_refused(kind, copy):
    with h5py.File(copy, "a") as file:
        file.attrs["schema_version"] = SCHEMA_VERSION + 1
    message = refused(kind, copy)
    assert "newer" in message
    assert str(SCHEMA_VERSION + 1) in message


@pytest.mark.parametrize("kept", [0.0, 0.001, 0.3, 0.9])
def test_truncated_file_is_refused(kept, kind, copy):
    with copy.open("rb+") as file:
        file.truncate(int(kept * copy.stat().st_size))
    refused(kind, copy)


def test_text_file_is_refused(kind, tmp_path):
    path = tmp_path / "notes.h5"
    path.write_text("This is no HDF5 file.\n" * 100)
    refused(kind, path)


def test_foreign_hdf5_file_is_refused(kind, tmp_path):
    path = tmp_path / "foreign.h5"
    with h5py.File(path, "w") as file:
        file["measurements"] = np.arange(5.0)
    assert f"not an auvid {kind}" in refused(kind, path)


def test_missing_file_is_refused(kind, tmp_path):
    assert "no such" in refused(kind, tmp_path / "nowhere.h5")


def test_folder_is_refused(kind, tmp_path):
    refused(kind, tmp_path)


def test_other_kind_of_file_is_refused(kind, written):
    other = "estimate" if kind == "dataset" else "dataset"
    assert other in refused(kind, written[other])


@pytest.mark.parametrize("gone", ["settings", "schema_version"])
def test_missing_attribute_is_refused(gone, kind, copy):
    with h5py.File(copy, "a") as file:
        del file.attrs[gone]
    refused(kind, copy)


@pytest.mark.parametrize(
    "gone", ["inputs", "inputs/elevator", "sensors/dvl/u", "truth/coefficient", "sensors/dvl/valid"]
)
def test_missing_part_of_dataset_is_refused(gone, written, tmp_path):
    path = tmp_path / "dataset.h5"
    path.write_bytes(written["dataset"].read_bytes())
    with h5py.File(path, "a") as file:
        del file[gone]
    refused("dataset", path)


@pytest.mark.parametrize("gone", ["mean", "state", "held_value", "innovations/dvl/nis"])
def test_missing_part_of_estimate_is_refused(gone, written, tmp_path):
    path = tmp_path / "estimate.h5"
    path.write_bytes(written["estimate"].read_bytes())
    with h5py.File(path, "a") as file:
        del file[gone]
    refused("estimate", path)


def tampered(path, dataset, name, change):
    """The dataset file with one array changed, which may change its length."""
    write_dataset(path, dataset)
    with h5py.File(path, "a") as file:
        values = file[name][...]
        del file[name]
        file[name] = change(values)
    return path


def short(values):
    return values[:-1]


def backwards(values):
    return values[::-1]


def all_nan(values):
    return np.full_like(values, np.nan)


def all_zero(values):
    return np.zeros_like(values)


def one_nan(values):
    return np.where(np.arange(values.size) == 3, np.nan, values)


def words(values):
    return np.array(["fast"] * values.size, dtype="S4")


@pytest.mark.slow
@pytest.mark.parametrize("change", [short, backwards, all_zero, all_nan, one_nan])
@pytest.mark.parametrize("name", ["inputs/time", "sensors/dvl/time"])
def test_invalid_times_are_refused(name, change, dataset, tmp_path):
    refused("dataset", tampered(tmp_path / "dataset.h5", dataset, name, change))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("inputs/rudder", one_nan),
        ("inputs/rudder", short),
        ("sensors/dvl/u", short),
        ("sensors/dvl/u", words),
        ("sensors/dvl/valid", short),
        ("sensors/dvl/standard_deviation", short),
        ("truth/true_coefficient", short),
        ("truth/u", short),
    ],
)
def test_invalid_values_are_refused(name, change, dataset, tmp_path):
    refused("dataset", tampered(tmp_path / "dataset.h5", dataset, name, change))


def test_unknown_sensor_is_refused(written, tmp_path):
    path = tmp_path / "dataset.h5"
    path.write_bytes(written["dataset"].read_bytes())
    with h5py.File(path, "a") as file:
        file.move("sensors/dvl", "sensors/sonar")
    assert "sonar" in refused("dataset", path)


class Interrupted(Exception):
    """Something goes wrong in the middle of writing."""


def test_failed_write_leaves_no_file(dataset, tmp_path, monkeypatch):
    create_group = h5py.Group.create_group

    def fail_at_truth(group, name):
        if name == "truth":
            raise Interrupted
        return create_group(group, name)

    monkeypatch.setattr(h5py.Group, "create_group", fail_at_truth)
    with pytest.raises(Interrupted):
        write_dataset(tmp_path / "dataset.h5", dataset)
    assert list(tmp_path.iterdir()) == []


SMALL_DISK = """
import resource, signal, sys
from pathlib import Path
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.errors import FileError

dataset = read_dataset(Path(sys.argv[1]))
# No file may grow beyond 20 kB, as on a disk that is nearly full.
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
try:
    write_dataset(Path(sys.argv[2]), dataset)
except FileError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.posix
def test_full_disk_keeps_the_earlier_file(dataset, tmp_path):
    """In a process of its own: the limit holds for everything that a process writes."""
    source, path = tmp_path / "source.h5", tmp_path / "results" / "dataset.h5"
    write_dataset(source, dataset)
    assert source.stat().st_size > 20_000
    path.parent.mkdir()
    path.write_text("an earlier result")
    command = [sys.executable, "-c", SMALL_DISK, str(source), str(path)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "cannot be written" in result.stdout
    assert result.stdout.count("\n") == 1
    assert result.stderr == "", "HDF5 has pages of its own to print"
    assert path.read_text() == "an earlier result"
    assert list(path.parent.iterdir()) == [path]


def test_write_below_a_file_is_refused(dataset, estimate, write_estimate, tmp_path):
    (tmp_path / "results").write_text("a file, not a folder")
    for write, content in ((write_dataset, dataset), (write_estimate, estimate)):
        with pytest.raises(FileError) as caught:
            write(tmp_path / "results" / "run.h5", content)
        assert "\n" not in str(caught.value)


def test_write_onto_a_folder_is_refused(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(FileError):
        write_text(tmp_path / "taken", "text")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


@pytest.mark.skipif(not hasattr(os, "umask") or os.name != "posix", reason="rights of POSIX files")
def test_new_files_follow_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "table.csv", "a,b\n")
        with locked(tmp_path):
            pass
    finally:
        os.umask(before)
    assert {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {
        ".lock": 0o640,
        "table.csv": 0o640,
    }


def test_file_gets_its_name_when_it_is_complete(tmp_path):
    path = tmp_path / "figure.svg"
    with replacing(path) as temporary:
        temporary.write_text("half")
        assert not path.exists()
    assert path.read_text() == "half"
    assert list(tmp_path.iterdir()) == [path]
