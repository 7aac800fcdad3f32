"""Goes through all of an HDF5 file, as a program of its own: on a damaged one libhdf5 may crash, or never come back.

Run as ``python walk.py PARENT SECONDS FILE ...`` it prints a line for each file: what is wrong with it, or nothing. It
needs nothing of auvid, so it is there soon; it ends with the process of the number PARENT, and by itself after so many
seconds.
"""

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from math import prod
from pathlib import Path

import h5py

# What of a damaged file h5py raises here and there.
DAMAGE = OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, OverflowError
# Numbers and text may take so many times their file when they are unpacked; of a small file, so many bytes.
_MOST_TIMES, _ALLOWED = 100, 1 << 26
_WIDEST_ROW = 1 << 20
_BLOCK = 1 << 22
_DIE_WITH_PARENT = 1


def flaw_of(path: Path) -> str:
    """Say in one line what is wrong with a file; nothing if all of it can be read."""
    try:
        with h5py.File(path, "r") as file:
            most = max(_ALLOWED, _MOST_TIMES * path.stat().st_size)
            for item in _items(file):
                _read_attributes(item, most)
                if isinstance(item, h5py.Dataset):
                    _read_values(item, most)
    except DAMAGE as error:
        return " ".join(str(error).split()) or type(error).__name__
    return ""


def _items(file: h5py.File) -> Iterator[h5py.HLObject]:
    """Yield groups and variables, each once, however many names it has; none that stands elsewhere."""
    seen, ahead = set(), [file["/"]]
    while ahead:
        item = ahead.pop()
        if item in seen:
            continue
        seen.add(item)
        yield item
        if isinstance(item, h5py.Group):
            for name in item:
                if not isinstance(item.get(name, getlink=True), h5py.HardLink):
                    raise ValueError(f"{name} in {item.name} is a link, not a part of the file")
                ahead.append(item[name])


def _read_attributes(item: h5py.HLObject, most: int) -> None:
    for name in item.attrs:
        attribute = item.attrs.get_id(name)
        if prod(attribute.shape or ()) * attribute.dtype.itemsize > most:
            raise ValueError(f"attribute {name} of {item.name} claims to be larger than its file can hold")
        item.attrs[name]


def _read_values(data: h5py.Dataset, most: int) -> None:
    if data.is_virtual or data.external:
        raise ValueError(f"{data.name} has its values in another file")
    is_number = data.dtype.kind in "iufb" and data.dtype.itemsize <= 8
    if not is_number and h5py.check_string_dtype(data.dtype) is None:
        raise ValueError(f"{data.name} holds neither real numbers nor text")
    if data.shape is None:
        return
    size, row = data.dtype.itemsize, data.dtype.itemsize * prod(data.shape[1:])
    if size * max(prod(data.shape), prod(data.chunks or ())) > most or row > _WIDEST_ROW:
        raise ValueError(f"{data.name} claims to be larger than its file can hold")
    if not data.shape:
        data[()]
        return
    rows, unit = _BLOCK // max(row, 1), data.chunks[0] if data.chunks else 1
    # Whole chunks: none is unpacked twice.
    rows = max(rows // unit, 1) * unit
    for first in range(0, data.shape[0], rows):
        data[first : first + rows]


def _end_with(parent: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.name == "posix" and os.getppid() != parent:
        sys.exit(1)


def main() -> None:
    """Go through the files that the command line names."""
    parent, seconds, *paths = sys.argv[1:]
    _end_with(int(parent))
    if hasattr(signal, "alarm"):
        # Nobody handles it, so it ends also what does not listen.
        signal.alarm(int(seconds))
    for path in paths:
        flaw = flaw_of(Path(path))
        print(flaw.encode("ascii", "backslashreplace").decode(), flush=True)


if __name__ == "__main__":
    main()
