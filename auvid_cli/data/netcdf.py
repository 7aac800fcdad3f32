"""Writing HDF5 files by the netCDF-4 conventions, so that xarray opens every group as it is."""

import hashlib
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from io import RawIOBase
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from auvid_cli import __version__
from auvid_cli.data.files import replacing
from auvid_cli.data.hdf5 import trust

SCHEMA_VERSION = 2
_CHUNK_ROWS = 8192
_BLOCK = 50_000
_LIBRARIES = ("numpy", "scipy", "numba", "filterpy", "h5py", "pydantic", "pint", "matplotlib")


@contextmanager
def new_file(path: Path, kind: str, settings: str, seed: int, **attributes: Any) -> Iterator[h5py.File]:
    """Make a new file with its provenance written; it gets its name when the block ends well.

    Parameters
    ----------
    path : Path
    kind : str
        "dataset" or "estimate".
    settings : str
        The full resolved settings as YAML text.
    seed : int
    **attributes
        More root attributes.
    """
    with replacing(path) as temporary, temporary.open("w+b", buffering=0) as raw:
        disk = _Disk(raw)
        with h5py.File(disk, "w") as file:
            file.attrs.update(
                {
                    "Conventions": "CF-1.11",
                    "kind": f"auvid {kind}",
                    "schema_version": SCHEMA_VERSION,
                    "settings": settings,
                    "seed": seed,
                    "auvid_version": __version__,
                    "library_versions": _library_versions(),
                    "platform": f"{platform.platform()}, Python {sys.version.split()[0]}",
                    "created": datetime.now(UTC).isoformat(timespec="seconds"),
                    **attributes,
                }
            )
            yield file
        disk.raise_failure()
    trust(path)


@cache
def _library_versions() -> str:
    return ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)


class _Disk:
    """The file object that HDF5 writes to: it keeps the first failure to itself.

    On a full disk HDF5 prints pages of its own, or crashes when it closes what it could not write. So it is
    told that all is well, and whoever writes asks for the failure.
    """

    def __init__(self, raw: RawIOBase) -> None:
        self._raw = raw
        self._failure: OSError | None = None
        self.read, self.readinto, self.seek, self.tell = raw.read, raw.readinto, raw.seek, raw.tell

    def write(self, data: memoryview) -> int:
        try:
            if self._failure is None:
                rest = memoryview(data)
                while rest.nbytes:
                    rest = rest[self._raw.write(rest) :]
        except OSError as error:
            self._failure = error
        return len(data)

    def truncate(self, size: int) -> int:
        try:
            return self._raw.truncate(size)
        except OSError as error:
            self._failure = self._failure or error
            return size

    def flush(self) -> None:
        """Do nothing: nothing is buffered."""

    def raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure


def write_dimension(group: h5py.Group, name: str, values: NDArray, long_name: str, unit: str = "") -> None:
    """Write a coordinate variable: a dimension scale that later variables of the group attach to."""
    _create(group, name, values, long_name, unit).make_scale(name)


def _create(group: h5py.Group, name: str, values: NDArray, long_name: str, unit: str) -> h5py.Dataset:
    if values.dtype.kind in "UO":
        data = group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        data = group.create_dataset(name, values.shape, values.dtype)
        # A column of a table is copied for the library: of ten hours at 100 Hz 29 MB, were it whole.
        for first in range(0, len(values), _BLOCK):
            data[first : first + _BLOCK] = values[first : first + _BLOCK]
    _describe(data, long_name, unit)
    return data


def _describe(data: h5py.Dataset, long_name: str, unit: str) -> None:
    data.attrs["long_name"] = long_name
    if unit:
        data.attrs["units"] = unit


def _attach(data: h5py.Dataset, group: h5py.Group, dimensions: tuple[str, ...]) -> None:
    for axis, dimension in enumerate(dimensions):
        data.dims[axis].attach_scale(group[dimension])


def write_variable(
    group: h5py.Group, name: str, values: NDArray, dimensions: tuple[str, ...], long_name: str, unit: str = ""
) -> None:
    """Write a variable on dimensions already written in the group."""
    _attach(_create(group, name, values, long_name, unit), group, dimensions)


def write_growing(
    group: h5py.Group, name: str, shape: tuple[int, ...], dimensions: tuple[str, ...], long_name: str, unit: str = ""
) -> None:
    """Make a variable of doubles without rows yet, each of `shape`. Named as its dimension, it is its scale."""
    data = group.create_dataset(name, (0, *shape), np.float64, maxshape=(None, *shape), chunks=(_CHUNK_ROWS, *shape))
    _describe(data, long_name, unit)
    if dimensions == (name,):
        data.make_scale(name)
    else:
        _attach(data, group, dimensions)


def append(group: h5py.Group, name: str, rows: NDArray[np.float64]) -> None:
    """Append rows to a growing variable."""
    data = group[name]
    assert isinstance(data, h5py.Dataset)
    before = data.shape[0]
    data.resize(before + len(rows), axis=0)
    data[before:] = rows


def digest(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
