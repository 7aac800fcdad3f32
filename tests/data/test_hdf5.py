"""Whatever is in a file, reading it ends, and ends in a dataset, an estimate, or one line."""

import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest

from auvid_cli.data import hdf5
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.errors import AuvidError, FileError
from auvid_cli.logs.formats.open_log import open_log

READ = {"dataset": read_dataset, "estimate": read_estimate}


def endless(path, dataset):
    """A dataset with an attribute that claims too large a size, on which libhdf5 never returns."""
    write_dataset(path, dataset)
    content = bytearray(path.read_bytes())
    # After the name follow type and dimensions; this is the second byte of the number of entries.
    content[content.index(b"DIMENSION_LIST") + 31] = 0xFF
    path.write_bytes(content)
    return path


def refused(kind, path):
    with pytest.raises(FileError) as caught:
        READ[kind](path)
    message = str(caught.value)
    assert message.isprintable()
    assert str(path) in message
    return message


@pytest.fixture
def at_once(monkeypatch):
    """A scan has no time beyond that for its size."""
    monkeypatch.setattr(hdf5, "scan_in_child", partial(hdf5.scan_in_child, seconds=0))


@pytest.mark.slow
def test_endless_file_is_refused(dataset, tmp_path, at_once):
    assert "does not return" in refused("dataset", endless(tmp_path / "dataset.h5", dataset))


@pytest.mark.slow
def test_scan_of_several_files_names_the_endless_one(dataset, written, tmp_path, at_once):
    sound = shutil.copy(written["dataset"], tmp_path / "sound.h5")
    bad = endless(tmp_path / "endless.h5", dataset)
    hdf5.scan([sound, bad, written["estimate"]])
    assert "does not return" in refused("dataset", bad)
    read_dataset(sound)
    read_estimate(written["estimate"])


class Aborting:
    """Function that ends the process that receives it."""

    def __reduce__(self):
        return os.abort, ()


def test_crash_of_the_scan_refuses_the_file(written, tmp_path, monkeypatch):
    monkeypatch.setattr(hdf5, "_flaw_in_time", Aborting())
    assert "crash" in refused("dataset", shutil.copy(written["dataset"], tmp_path / "dataset.h5"))


@pytest.mark.slow
def test_interrupt_ends_wait_and_scan(dataset, tmp_path):
    path, start = endless(tmp_path / "dataset.h5", dataset), time.monotonic()
    threading.Timer(1.0, os.kill, [os.getpid(), signal.SIGINT]).start()
    with pytest.raises(KeyboardInterrupt):
        read_dataset(path)
    assert time.monotonic() - start < hdf5.SCAN_TIME
    assert not multiprocessing.active_children()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it ends after its time, not at once")
def test_scan_ends_with_its_parent(dataset, tmp_path):
    path = endless(tmp_path / "dataset.h5", dataset)
    code = f"from auvid_cli.data.hdf5 import scan; from pathlib import Path; scan([Path({str(path)!r})])"
    with subprocess.Popen([sys.executable, "-c", code]) as parent:
        children = []
        while not children:
            time.sleep(0.05)
            running = [int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit()]
            children = [each for each in running if parent_of(each) == parent.pid]
        # Until the child has called `prctl`, it compares its parent itself.
        parent.kill()
    for _ in range(200):
        if all(parent_of(child) is None for child in children):
            break
        time.sleep(0.05)
    assert all(parent_of(child) is None for child in children)


def parent_of(pid):
    """None of a process that has ended."""
    try:
        state, parent = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[:2]
    except OSError:
        return None
    return None if state == "Z" else int(parent)


def test_own_file_is_scanned_only_after_a_change(dataset, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(hdf5, "scan_in_child", lambda paths, foreign: asked.extend(paths) or [""] * len(paths))
    path = tmp_path / "dataset.h5"
    write_dataset(path, dataset)
    read_dataset(path)
    assert asked == []
    with h5py.File(path, "a") as file:
        file["remark"] = np.zeros(10)
    for _ in range(2):
        read_dataset(path)
    assert asked == [path]


# Benchmarks do the same thousands of times.
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "files"), [("dataset", 40), ("estimate", 10)])
def test_flipped_bytes_are_read_or_refused_in_one_line(kind, files, written, tmp_path, monkeypatch):
    content, rng, paths = written[kind].read_bytes(), random.Random(1), []
    # Damage to names is more likely to matter than damage to numbers.
    marks = [found.start() for found in re.finditer(rb"[A-Za-z_]{4,}", content)]
    for number in range(files):
        harmed = bytearray(content)
        for _ in range(3):
            place = min(rng.choice(marks) + rng.randrange(100), len(content) - 1)
            harmed[place] = rng.choice((0, 255, rng.randrange(256)))
        paths.append(tmp_path / f"{number}.h5")
        paths[-1].write_bytes(harmed)
    rest = list(paths)
    while rest:
        flaws = hdf5.scan_in_child(rest, seconds=0)
        for path, flaw in zip(rest, flaws, strict=False):
            if not flaw:
                hdf5.trust(path)
                with suppress(AuvidError):
                    READ[kind](path)
        rest = rest[len(flaws) :]


def tampered(kind, written, folder, change):
    path = shutil.copy(written[kind], folder / f"{kind}.h5")
    with h5py.File(path, "a") as file:
        change(file)
    return path


def put(name, values):
    def change(file):
        del file[name]
        file[name] = values

    return change


STRUCTURE = {
    "a soft link": lambda file: file.__setitem__("inputs/more", h5py.SoftLink("/inputs")),
    "a loop of soft links": lambda file: file.__setitem__("inputs/more", h5py.SoftLink("/inputs/more")),
    "a link to another file": lambda file: file.__setitem__("more", h5py.ExternalLink("/etc/passwd", "/")),
    "values in another file": lambda file: file.create_dataset("v", (4,), "f8", external=[("/etc/passwd", 0, 32)]),
    "values of another variable": lambda file: file.create_virtual_dataset("v", h5py.VirtualLayout((4,), "f8")),
    "complex numbers": put("inputs/time", np.arange(5) + 1j),
    "compounds": put("inputs/time", np.zeros(5, "f8,i4")),
    "references": lambda file: file.create_dataset("v", data=file["inputs"].ref, dtype=h5py.ref_dtype),
    "more than there can be": lambda file: file.create_dataset("v", (10**12,), "f8", chunks=(1000,)),
    "a great chunk": lambda file: file.create_dataset("v", (1,), "f8", chunks=(10**8,), maxshape=(None,)),
}


@pytest.mark.usefixtures("walked_here")
@pytest.mark.parametrize("what", STRUCTURE)
def test_structure_that_auvid_does_not_write_is_refused(what, written, tmp_path):
    refused("dataset", tampered("dataset", written, tmp_path, STRUCTURE[what]))


def test_recursive_groups_are_scanned_once(written, tmp_path):
    path = tampered("dataset", written, tmp_path, lambda file: file.__setitem__("inputs/again", file["/"]))
    assert hdf5.flaw_of(path) == ""


def matlab(path, change):
    """Write a MATLAB 7.3 file with one vector and more."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = np.arange(5.0)[None]
        change(file)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")
    return open_log(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "what", ["a soft link", "a link to another file", "values in another file", "values of another variable"]
)
def test_matlab_file_that_refers_to_another_is_refused(what, tmp_path):
    log = matlab(tmp_path / "log.mat", STRUCTURE[what] if what != "a soft link" else link_in_root)
    with pytest.raises(FileError, match=r"log\.mat: .*(link|another file)"):
        log.tables()


def link_in_root(file):
    file["more"] = h5py.SoftLink("/t")


def test_matlab_cells_and_complex_numbers_are_ignored(tmp_path):
    def change(file):
        file["#refs#/a"] = h5py.SoftLink("/t")
        file.create_dataset("cells", (3,), h5py.ref_dtype)
        file["z"] = np.arange(5) + 1j

    assert [column.name for column in matlab(tmp_path / "log.mat", change).tables()[""]] == ["t"]


def test_matlab_file_of_holes_is_refused(tmp_path):
    def change(file):
        file.create_dataset("u", (10**8,), "f8").id.get_offset()
        file["u"][-1] = 1.0

    with pytest.raises(FileError, match=r"log\.mat: .*larger than its file"):
        matlab(tmp_path / "log.mat", change).tables()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "log.mat")
    with pytest.raises(ValueError, match="pipe"), hdf5.open_hdf5(tmp_path / "log.mat"):
        pass


@pytest.mark.usefixtures("walked_here")
def test_scan_needs_neither_alarms_nor_holes(written, tmp_path, monkeypatch):
    """As on Windows."""
    monkeypatch.delattr(os, "SEEK_DATA")
    assert hdf5.flaw_of(written["dataset"]) == ""
    read_dataset(shutil.copy(written["dataset"], tmp_path / "dataset.h5"))


def test_attribute_of_many_megabytes_is_refused(written, tmp_path):
    path = tampered("dataset", written, tmp_path, lambda file: file.attrs.__setitem__("settings", "a" * 10**7))
    assert "settings" in hdf5.flaw_of(path)
