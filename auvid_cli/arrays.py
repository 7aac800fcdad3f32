"""Arrays of doubles: their type, angles modulo one turn, and large arrays that are kept in temporary files.

These files are created without a name, or are deleted as soon as they are open, so that they also disappear if the
process is killed. They are in the folder of temporary files (``TMPDIR``).
"""

import ctypes
import mmap
import os
import sys
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from math import prod
from threading import Lock
from typing import IO, Any, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from auvid_cli.errors import FileError

Array = NDArray[np.float64]


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: NDArray[np.float64]) -> NDArray[np.float64]: ...
def wrap(angle: Any) -> Any:
    """Return angles or differences of angles, rad, in [-pi, pi); also used in compiled code."""
    return angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5)


# Largest size in memory of one array, or of the arrays of one store: some 40 minutes of a trajectory at 100 Hz.
MAX_IN_MEMORY = 2**24  # bytes

# Only Linux can map memory to a file of reserved size, and release it.
_CAN_RELEASE = hasattr(os, "posix_fallocate") and hasattr(mmap, "MADV_DONTNEED")
_mapped = weakref.WeakSet[mmap.mmap]()
_mapping = Lock()


@contextmanager
def _writing() -> Iterator[None]:
    """Turn an OSError into a FileError."""
    try:
        yield
    except OSError as error:
        where, reason = tempfile.gettempdir(), error.strerror or error
        raise FileError(f"{where}: temporary file not written: {reason}; set TMPDIR to another folder") from None


def zeros(shape: tuple[int, ...]) -> Array:
    """Return an array of zeros; a large one is mapped to a temporary file (see `release_memory`).

    Raises
    ------
    FileError
        If the temporary file cannot be written.
    """
    size = 8 * prod(shape)
    if size <= MAX_IN_MEMORY or not _CAN_RELEASE:
        return np.zeros(shape)
    with _writing(), tempfile.TemporaryFile(buffering=0) as file:
        # Reserved, because a write to mapped memory ends the process if the disk is full.
        os.posix_fallocate(file.fileno(), 0, size)
        mapped = mmap.mmap(file.fileno(), size)
    with _mapping:
        _mapped.add(mapped)
    return np.ndarray(shape, np.float64, mapped)


def stored(values: Array) -> Array:
    """Return the same values; many of them in an array that is mapped to a temporary file, see `zeros`."""
    if values.nbytes <= MAX_IN_MEMORY:
        return values
    copy = zeros(values.shape)
    copy[...] = values
    return copy


def release_memory() -> None:
    """Release the memory of large arrays of `zeros`; the next use reads their values from the files.

    Called between steps that use long data.
    """
    with _mapping:
        for mapped in _mapped:
            mapped.madvise(mmap.MADV_DONTNEED)


def trim_heap() -> None:
    """Return freed memory to the system; glibc keeps memory that threads have freed, even after they end."""
    # Other C libraries have no such function.
    if sys.platform == "linux":
        with suppress(AttributeError):
            ctypes.CDLL(None).malloc_trim(0)


class _Place(NamedTuple):
    """Place of an array in the file."""

    offset: int  # bytes
    shape: tuple[int, ...]


class ArrayStore(Sequence[Array]):
    """Sequence of C-contiguous arrays of doubles, to which arrays can be appended."""

    def __init__(self) -> None:
        self._entries, self._room = list[Array | _Place](), MAX_IN_MEMORY
        self._file: IO[bytes] | None = None
        self._position = Lock()  # of the file: several threads may read

    def append(self, array: Array) -> None:
        """Append an array, which must not be changed afterwards.

        Raises
        ------
        FileError
            If the temporary file cannot be written.
        """
        if array.nbytes <= self._room:
            self._room -= array.nbytes
            self._entries.append(array)
            return
        # Later arrays go to the file, too.
        self._room = 0
        with _writing():
            file = self._file or self._open()
            with self._position:
                place = _Place(file.seek(0, 2), array.shape)
                array.tofile(file)
        self._entries.append(place)

    def _open(self) -> IO[bytes]:
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115  # Closed with the store.
        weakref.finalize(self, self._file.close)
        return self._file

    def reverse(self) -> None:
        """Reverse the order of the arrays."""
        self._entries.reverse()

    def __len__(self) -> int:
        return len(self._entries)

    @overload
    def __getitem__(self, index: int) -> Array: ...
    @overload
    def __getitem__(self, index: slice) -> list[Array]: ...
    def __getitem__(self, index: int | slice) -> Array | list[Array]:
        if isinstance(index, slice):
            return [self._read(entry) for entry in self._entries[index]]
        return self._read(self._entries[index])

    def __iter__(self) -> Iterator[Array]:
        return map(self._read, self._entries)

    def _read(self, entry: Array | _Place) -> Array:
        if not isinstance(entry, _Place):
            return entry
        assert self._file is not None, "an array has a place only if it was written"
        with self._position:
            self._file.seek(entry.offset)
            return np.fromfile(self._file, count=prod(entry.shape)).reshape(entry.shape)
