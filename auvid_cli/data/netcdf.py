"""HDF5 files by the netCDF-4 conventions, so that xarray opens every group as it is."""

import hashlib
import platform
import sys
from collections.abc import Iterator, Sequence
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
from auvid_cli.errors import FileError

SCHEMA_VERSION = 1
_CHUNK_ROWS = 8192
_LIBRARIES = ("numpy", "scipy", "numba", "filterpy", "h5py", "pydantic", "pint", "matplotlib")


@contextmanager
def new_file(path: Path, kind: str, settings: str, seed: int, **attributes: Any) -> Iterator[h5py.File]:
    """A new file with its provenance written; it gets its name when the block ends well.

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
        """Nothing is buffered."""

    def raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure


@contextmanager
def open_file(path: Path, kind: str) -> Iterator[h5py.File]:
    """An existing file, checked to be auvid's, of this kind and of a schema that is understood.

    Raises
    ------
    FileError
        If it is missing, truncated, not HDF5, of another kind, newer, or lacks what it must have.
    """
    if not path.is_file():
        raise FileError(f"{path}: no such {kind} file")
    try:
        with h5py.File(path, "r") as file:
            found = file.attrs.get("kind")
            if found != f"auvid {kind}":
                raise FileError(f"{path}: not an auvid {kind} file" + (f" but an {found} file" if found else ""))
            schema = int(read_attribute(file, "schema_version"))
            if schema > SCHEMA_VERSION:
                raise FileError(
                    f"{path}: written by a newer auvid (schema {schema}, this one reads up to {SCHEMA_VERSION}); "
                    "upgrade with pip install --upgrade auvid"
                )
            yield file
    except FileError:
        raise
    except (OSError, KeyError, ValueError, TypeError, IndexError) as error:
        raise FileError(f"{path}: damaged or not an auvid {kind} file: {_one_line(error)}") from error


def write_dimension(group: h5py.Group, name: str, values: NDArray, long_name: str, unit: str = "") -> None:
    """A coordinate variable: a dimension scale that later variables of the group attach to."""
    _create(group, name, values, long_name, unit).make_scale(name)


def _create(group: h5py.Group, name: str, values: NDArray, long_name: str, unit: str) -> h5py.Dataset:
    if values.dtype.kind in "UO":
        data = group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        data = group.create_dataset(name, data=values)
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
    """A variable on dimensions already written in the group."""
    _attach(_create(group, name, values, long_name, unit), group, dimensions)


def write_growing(
    group: h5py.Group, name: str, shape: tuple[int, ...], dimensions: tuple[str, ...], long_name: str, unit: str = ""
) -> None:
    """A variable of doubles without rows yet; `shape` is that of a row. Named as its dimension, it is its scale."""
    data = group.create_dataset(name, (0, *shape), np.float64, maxshape=(None, *shape), chunks=(_CHUNK_ROWS, *shape))
    _describe(data, long_name, unit)
    if dimensions == (name,):
        data.make_scale(name)
    else:
        _attach(data, group, dimensions)


def append(group: h5py.Group, name: str, rows: NDArray[np.float64]) -> None:
    """More rows of a growing variable."""
    data = _variable(group, name)
    before = data.shape[0]
    data.resize(before + len(rows), axis=0)
    data[before:] = rows


def read_array(group: h5py.Group, name: str, every: int = 1) -> NDArray[np.float64]:
    """A numeric variable as doubles; of its rows every so many, and the last."""
    data = _variable(group, name)
    rows = data[(data.shape[0] - 1) % every :: every] if every > 1 else data[...]
    return np.asarray(rows, dtype=np.float64)


def read_table(group: h5py.Group, names: Sequence[str], every: int = 1) -> NDArray[np.float64]:
    """Variables of one length side by side, as `read_array`."""
    first = read_array(group, names[0], every)
    table = np.empty((len(first), len(names)))
    table[:, 0] = first
    for column, name in enumerate(names[1:], 1):
        table[:, column] = read_array(group, name, every)
    return table


def mark_missing(group: h5py.Group, name: str, values: NDArray[np.float64]) -> None:
    """NaN in place of values where a variable of flags is zero."""
    values[_variable(group, name)[...] == 0] = np.nan


def read_rows(group: h5py.Group, name: str, first: int, last: int) -> NDArray[np.float64]:
    """Consecutive rows of a numeric variable as doubles."""
    return np.asarray(_variable(group, name)[first:last], dtype=np.float64)


def count_rows(group: h5py.Group, name: str) -> int:
    """How many rows a variable has."""
    return _variable(group, name).shape[0]


def read_names(group: h5py.Group, name: str) -> tuple[str, ...]:
    """A variable of strings."""
    return tuple(str(text) for text in _variable(group, name).asstr()[...])


def read_attribute(file: h5py.File, name: str) -> str:
    """A root attribute as text; KeyError if there is none."""
    return str(file.attrs[name])


def subgroups(group: h5py.Group, name: str) -> dict[str, h5py.Group]:
    """The groups in a group, by name; none if that does not exist."""
    if name not in group:
        return {}
    return {key: item for key, item in subgroup(group, name).items() if isinstance(item, h5py.Group)}


def subgroup(group: h5py.Group, name: str) -> h5py.Group:
    """A group that must be there."""
    item = group[name]
    if not isinstance(item, h5py.Group):
        raise KeyError(f"{name} is not a group")
    return item


def _variable(group: h5py.Group, name: str) -> h5py.Dataset:
    item = group[name]
    if not isinstance(item, h5py.Dataset):
        raise KeyError(f"{name} is not a variable")
    return item


def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
