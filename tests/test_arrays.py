"""Arrays beyond the limit are kept in files that have no name."""

import errno
import sys

import numpy as np
import psutil
import pytest

from auvid_cli import arrays as module
from auvid_cli.arrays import ArrayStore, release_memory, zeros
from auvid_cli.errors import FileError


@pytest.fixture
def arrays():
    rng = np.random.default_rng(1)
    return [rng.standard_normal((rows, 3)) for rows in (5, 0, 7, 1, 40)]


def filled(arrays):
    store = ArrayStore()
    for array in arrays:
        store.append(array)
    return store


@pytest.mark.parametrize("limit", [0, 5 * 24, 10**6])
def test_arrays_come_back_bit_by_bit(arrays, limit, monkeypatch):
    monkeypatch.setattr(module, "MAX_IN_MEMORY", limit)
    store = filled(arrays)
    assert len(store) == len(arrays)
    assert all(np.array_equal(*pair) for pair in zip(store, arrays, strict=True))
    assert np.array_equal(store[2], arrays[2])
    assert np.array_equal(store[-1], arrays[-1])
    assert all(np.array_equal(*pair) for pair in zip(store[1:3], arrays[1:3], strict=True))
    store.reverse()
    store.append(arrays[0])
    assert all(np.array_equal(*pair) for pair in zip(store, [*arrays[::-1], arrays[0]], strict=True))
    store[0][:] = 1.0, 2.0, 3.0  # a compiled function accepts no array that is read only


def test_temporary_file_has_no_name(arrays, monkeypatch, tmp_path):
    monkeypatch.setattr(module, "MAX_IN_MEMORY", 0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    filled(arrays)
    assert not any(tmp_path.iterdir())


def test_full_disk_is_one_line(arrays, monkeypatch):
    def full(**options):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(module, "MAX_IN_MEMORY", 0)
    monkeypatch.setattr("tempfile.TemporaryFile", full)
    with pytest.raises(FileError, match="No space left"):
        filled(arrays)
    with pytest.raises(FileError, match="No space left"):
        zeros((1, 3))


def test_released_array_keeps_its_values(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "MAX_IN_MEMORY", 0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    array = zeros((10_000, 3))
    assert not array.any()
    array[:, 1] = np.arange(10_000.0)
    release_memory()
    assert np.array_equal(array[:, 1], np.arange(10_000.0))
    assert not array[:, [0, 2]].any()
    assert not any(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory cannot be released")
def test_release_gives_memory_back(monkeypatch):
    monkeypatch.setattr(module, "MAX_IN_MEMORY", 0)
    array, process = zeros((10_000_000,)), psutil.Process()
    array += 1.0
    before = process.memory_info().rss
    release_memory()
    assert process.memory_info().rss < before - 0.9 * array.nbytes
