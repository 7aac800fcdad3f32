"""Open HDF5 files of any origin, after a child process has read them to the end.

On a damaged file libhdf5 may crash or never return, and an HDF5 file can refer to any other file.
"""

import faulthandler
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from math import ceil, prod
from pathlib import Path
from typing import TypeGuard

import h5py

from auvid_cli.child_processes import WorkerDied, Workers
from auvid_cli.regular_files import check_regular_file
from auvid_cli.text import one_line

# Errors that h5py raises on damaged files.
READ_ERRORS = OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, OverflowError
SCAN_TIME = 10  # s
_SCAN_RATE = 20e6  # bytes/s
# Largest compression ratio of DEFLATE.
_MAX_COMPRESSION = 1032
# Any file may unpack to this size.
_ALWAYS_ALLOWED = 1 << 28  # bytes
_MAX_ATTRIBUTE = 4_000_000  # bytes
_BLOCK = 1 << 22  # bytes
_DISK_BLOCK = 512  # bytes, unit of `st_blocks`
_MATLAB_CLASS = "MATLAB_class"


# Reason to refuse each file version; empty if the file can be read.
_flaws: dict[tuple[int, ...], str] = {}


@contextmanager
def open_hdf5(path: Path, foreign: bool = False) -> Iterator[h5py.File]:
    """Open a file of any origin for reading, after it has been scanned.

    Parameters
    ----------
    path : pathlib.Path
    foreign : bool
        Whether another program wrote it: only variables of `numbers_in` may be read, and no group of the root whose
        name begins with ``#``. In auvid's own files everything must be numbers or text.

    Raises
    ------
    ValueError
        If it is not a regular file, or is refused; the message omits the path.
    """
    check_regular_file(path)
    scan([path], foreign)
    if flaw := _flaws.get(_version(path, foreign), "changes while it is read"):
        raise ValueError(flaw)
    with h5py.File(path, "r") as file:
        yield file


def numbers_in(item: object) -> TypeGuard[h5py.Dataset]:
    """Whether an item of a file is a variable of real numbers."""
    return isinstance(item, h5py.Dataset) and item.dtype.kind in "iufb" and item.dtype.itemsize <= 8


def trust(path: Path) -> None:
    """Mark a file that this process has just written as readable without a scan."""
    _flaws[_version(path, False)] = ""


def scan(paths: Iterable[Path], foreign: bool = False) -> None:
    """Scan files in one child process, each version once; ignore missing files."""
    versions = {_version(path, foreign): path for path in paths if path.is_file()}
    if new := {version: path for version, path in versions.items() if version not in _flaws}:
        # If a file ended the child, the files after it have no result; they are scanned when they are opened.
        _flaws.update(zip(new, scan_in_child(list(new.values()), foreign), strict=False))


def _version(path: Path, foreign: bool) -> tuple[int, ...]:
    status = path.stat()
    return foreign, status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def scan_in_child(paths: Iterable[Path], foreign: bool = False, seconds: int = SCAN_TIME) -> list[str]:
    """Return the flaw of each file, up to the first that ended the child; `seconds` is the limit of a small file."""
    flaws: list[str] = []
    try:
        with Workers(1) as worker:
            flaws.extend(worker.submit(_flaw_in_time, path, foreign, seconds).result() for path in paths)
    except WorkerDied:
        flaws.append("the HDF5 library crashes on it, or does not return")
    return flaws


def _flaw_in_time(path: Path, foreign: bool, seconds: int) -> str:
    seconds += ceil(path.stat().st_size / _SCAN_RATE)
    # At the limit the process ends, even inside libhdf5.
    with Path(os.devnull).open("w") as nowhere:
        faulthandler.dump_traceback_later(seconds, exit=True, file=nowhere)
        try:
            return flaw_of(path, foreign)
        finally:
            faulthandler.cancel_dump_traceback_later()


def flaw_of(path: Path, foreign: bool = False) -> str:
    """Return the reason to refuse a file, in one line; empty if all of it can be read."""
    try:
        with h5py.File(path, "r") as file:
            allowed = max(_ALWAYS_ALLOWED, _MAX_COMPRESSION * _stored_size(path))
            for item in _items(file, foreign):
                _read_attributes(item, foreign)
                if isinstance(item, h5py.Dataset):
                    allowed -= _read_values(item, foreign, allowed)
    except READ_ERRORS as error:
        return one_line(str(error)) or type(error).__name__
    return ""


def _stored_size(path: Path) -> int:
    """Return the size of a file, bytes; without its holes where the operating system counts blocks."""
    status = path.stat()
    return min(status.st_size, _DISK_BLOCK * getattr(status, "st_blocks", status.st_size))


def _items(file: h5py.File, foreign: bool) -> Iterator[h5py.HLObject]:
    """Yield groups and variables, each once; refuse soft and external links."""
    seen, waiting = set(), [file["/"]]
    while waiting:
        item = waiting.pop()
        if item in seen:
            continue
        seen.add(item)
        yield item
        if isinstance(item, h5py.Group):
            for name in map(str, item):
                if foreign and item.name == "/" and name.startswith("#"):
                    continue
                if not isinstance(item.get(name, getlink=True), h5py.HardLink):
                    raise ValueError(f"{name} in {item.name} is a link, not a part of the file")
                waiting.append(item[name])


def _read_attributes(item: h5py.HLObject, foreign: bool) -> None:
    for name in item.attrs:
        if foreign and name != _MATLAB_CLASS:
            continue
        attribute = item.attrs.get_id(name)
        size = prod(attribute.shape or ()) * attribute.dtype.itemsize
        if size <= _MAX_ATTRIBUTE and isinstance(value := item.attrs[name], str):
            size = len(value)
        if size > _MAX_ATTRIBUTE:
            raise ValueError(f"attribute {name} of {item.name} is larger than {_MAX_ATTRIBUTE / 1e6:g} MB")


def _read_values(data: h5py.Dataset, foreign: bool, allowed: int) -> int:
    """Read a variable block by block and return its size, bytes."""
    if data.is_virtual or data.external:
        raise ValueError(f"{data.name} has its values in another file")
    if foreign and not numbers_in(data):
        return 0
    if not numbers_in(data) and h5py.check_string_dtype(data.dtype) is None:
        raise ValueError(f"{data.name} holds neither real numbers nor text")
    if data.shape is None:
        return 0
    width = data.dtype.itemsize
    if not data.shape:
        data[()]
        return width
    row, size = width * prod(data.shape[1:]), width * prod(data.shape)
    if max(size, width * prod(data.chunks or ())) > allowed:
        raise ValueError(f"{data.name} claims to be larger than its file can hold")
    # Read whole chunks, so that each is unpacked once.
    unit = data.chunks[0] if data.chunks else 1
    rows = max(_BLOCK // max(row, 1) // unit, 1) * unit
    for first in range(0, data.shape[0], rows):
        data[first : first + rows]
    return size
