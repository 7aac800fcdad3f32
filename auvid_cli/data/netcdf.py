"""Write and read HDF5 files by the netCDF-4 conventions; check their structure and their arrays."""

import hashlib
import platform
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from io import RawIOBase
from pathlib import Path
from typing import Annotated, Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from auvid_cli._version import __version__
from auvid_cli.arrays import Array, release_memory, stored, zeros
from auvid_cli.config.settings import Settings
from auvid_cli.config.units import parse_quantity
from auvid_cli.data.files import replacing
from auvid_cli.data.hdf5 import READ_ERRORS, open_hdf5, trust
from auvid_cli.errors import FileError, InvalidDataError
from auvid_cli.text import one_line, shortened
from auvid_cli.vehicle.parameters import Quantity

SCHEMA_VERSION = 2
_CHUNK_ROWS = 8192
_BLOCK_ROWS = 50_000
_MAX_NAMES = 1000
_LIBRARIES = ("numpy", "scipy", "numba", "filterpy", "h5py", "pydantic", "pint", "matplotlib")


@contextmanager
def new_file(path: Path, kind: str, settings: str, seed: int, **attributes: Any) -> Iterator[h5py.File]:
    """Create a file with its provenance; it gets its name when the block ends without an error.

    Parameters
    ----------
    path : Path
    kind : str
        "dataset" or "estimate".
    settings : str
        All resolved settings as YAML.
    seed : int
    **attributes
        More root attributes.
    """
    with replacing(path) as temporary, temporary.open("w+b", buffering=0) as raw:
        disk = _Disk(raw)
        with _writing(path, disk), h5py.File(disk, "w") as file:
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
    trust(path)


@contextmanager
def _writing(path: Path, disk: "_Disk") -> Iterator[None]:
    """Raise the failure of a disk first, and turn an InvalidDataError into a FileError."""
    try:
        yield
    except InvalidDataError as error:
        disk.raise_failure()
        raise FileError(f"{path}: not written: {one_line(str(error))}") from None
    disk.raise_failure()


@cache
def _library_versions() -> str:
    return ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)


class _Disk:
    """File object that HDF5 writes to; it reports success and keeps the first failure for `raise_failure`.

    On a full disk HDF5 prints long messages, or crashes when it closes a file that it could not write.
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
        """Do nothing, because the file is not buffered."""

    def raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure


def write_dimension(group: h5py.Group, name: str, values: NDArray, long_name: str, unit: str = "") -> None:
    """Write a coordinate variable: a dimension scale for later variables of the group."""
    _create(group, name, values, long_name, unit).make_scale(name)


def _create(group: h5py.Group, name: str, values: NDArray, long_name: str, unit: str) -> h5py.Dataset:
    if values.dtype.kind in "UO":
        data = group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        data = group.create_dataset(name, values.shape, values.dtype)
        # h5py copies a column of a table; a block is smaller than the 29 MB of ten hours at 100 Hz.
        for first in range(0, len(values), _BLOCK_ROWS):
            data[first : first + _BLOCK_ROWS] = values[first : first + _BLOCK_ROWS]
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
    """Write a variable on dimensions that are already in the group."""
    _attach(_create(group, name, values, long_name, unit), group, dimensions)


def write_growing(
    group: h5py.Group, name: str, shape: tuple[int, ...], dimensions: tuple[str, ...], long_name: str, unit: str = ""
) -> None:
    """Create an empty variable of doubles with rows of `shape`; a scale if it is named like its dimension."""
    data = group.create_dataset(name, (0, *shape), np.float64, maxshape=(None, *shape), chunks=(_CHUNK_ROWS, *shape))
    _describe(data, long_name, unit)
    if dimensions == (name,):
        data.make_scale(name)
    else:
        _attach(data, group, dimensions)


def append(group: h5py.Group, name: str, rows: Array) -> None:
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


class FileAttributes(Settings):
    """Root attributes of every file; each kind of file adds its own."""

    schema_version: Annotated[int, Field(ge=1)]


Form = TypeVar("Form", bound=FileAttributes)


@contextmanager
def open_file(path: Path, kind: str) -> Iterator[h5py.File]:
    """Open a file of auvid of this kind and of a known schema.

    Raises
    ------
    FileError
        If it is missing, damaged, of another kind or of a newer schema, or if the block raises an error of
        `READ_ERRORS`, such as a ValueError with the place in the file.
    """
    if not path.is_file():
        raise FileError(f"{path}: no such {kind} file")
    try:
        with open_hdf5(path) as file:
            attribute = file.attrs.get("kind")
            kind_of_file = one_line(attribute) if isinstance(attribute, str) else ""
            if kind_of_file != f"auvid {kind}":
                raise FileError(
                    f"{path}: not an auvid {kind} file" + (f" but an {kind_of_file} file" if kind_of_file else "")
                )
            schema = read_attributes(file, FileAttributes).schema_version
            if schema > SCHEMA_VERSION:
                raise FileError(
                    f"{path}: written by a newer auvid (schema {schema}, this one reads up to {SCHEMA_VERSION}); "
                    "upgrade with pip install --upgrade auvid"
                )
            yield file
    except READ_ERRORS as error:
        raise FileError(f"{path}: damaged or not an auvid {kind} file: {one_line(str(error))}") from error


def read_attributes(file: h5py.File, form: type[Form]) -> Form:
    """Read the root attributes that are fields of `form`; raise a ValueError if one is missing or invalid."""
    values = {name: file.attrs[name] for name in form.model_fields if name in file.attrs}
    attributes = {name: value.item() if isinstance(value, np.generic) else value for name, value in values.items()}
    try:
        return form.model_validate(attributes)
    except ValidationError as error:
        first = error.errors()[0]
        name, reason = str(first["loc"][0]), first["msg"]
        if first["type"] == "string_pattern_mismatch":
            reason = f"invalid value {attributes[name]!r}; not written by auvid"
        raise ValueError(f"attribute {name}: {shortened(one_line(reason))}") from None


def read_array(group: h5py.Group, name: str, every: int = 1, ndim: int = 1) -> Array:
    """Read a numeric variable as doubles: every `every`-th row, the last one included."""
    return stored(_rows(group, name, every, ndim))


def _rows(group: h5py.Group, name: str, every: int, ndim: int = 1) -> Array:
    data = _variable(group, name, "numbers", ndim)
    rows = data[(data.shape[0] - 1) % every :: every] if every > 1 else data[...]
    return np.asarray(rows, dtype=np.float64)


def check_units(group: h5py.Group, quantities: Iterable[Quantity]) -> None:
    """Raise a ValueError if the file states a unit other than the expected one."""
    for quantity in quantities:
        unit = group[quantity.symbol].attrs.get("units")
        if unit is not None and not _is_unit(unit, quantity.unit):
            raise ValueError(
                f"{group.name}/{quantity.symbol} is in {shortened(one_line(str(unit)))}; expected {quantity.unit}"
            )


def _is_unit(text: Any, unit: str) -> bool:
    if text == unit:
        return True
    try:
        return isinstance(text, str) and bool(text.strip()) and parse_quantity(f"1 {text}", unit) == 1.0
    except ValueError:
        return False


def read_table(group: h5py.Group, names: Sequence[str], every: int = 1) -> Array:
    """Read variables of equal length as columns, see `read_array`."""
    first = _rows(group, names[0], every)
    table = zeros((len(first), len(names)))
    table[:, 0] = first
    for column, name in enumerate(names[1:], 1):
        values = _rows(group, name, every)
        if values.size != len(first):
            raise ValueError(f"{group.name}/{name} and {group.name}/{names[0]} differ in length")
        table[:, column] = values
    release_memory()
    return table


def mark_missing(group: h5py.Group, name: str, values: Array) -> None:
    """Set values to NaN where a variable of flags is zero."""
    flags = read_array(group, name, ndim=2)
    if flags.shape != values.shape:
        raise ValueError(f"{group.name}/{name} and its values differ in shape")
    values[flags == 0.0] = np.nan


def read_rows(group: h5py.Group, name: str, first: int, last: int, ndim: int = 1) -> Array:
    """Read the rows from `first` to before `last` of a numeric variable as doubles."""
    return np.asarray(_variable(group, name, "numbers", ndim)[first:last], dtype=np.float64)


def count_rows(group: h5py.Group, name: str) -> int:
    """Return the length of a variable of one dimension."""
    return _variable(group, name, "numbers", 1).shape[0]


def read_names(group: h5py.Group, name: str) -> tuple[str, ...]:
    """Read a variable of at most `_MAX_NAMES` strings."""
    data = _variable(group, name, "text", 1)
    if data.shape[0] > _MAX_NAMES:
        raise ValueError(f"{data.name} has {data.shape[0]} entries; expected at most {_MAX_NAMES}")
    return tuple(str(text) for text in data.asstr()[...])


def subgroups(group: h5py.Group, name: str) -> dict[str, h5py.Group]:
    """Return the groups in a group by name, none if it does not exist."""
    if name not in group:
        return {}
    return {key: item for key, item in subgroup(group, name).items() if isinstance(item, h5py.Group)}


def subgroup(group: h5py.Group, name: str) -> h5py.Group:
    """Return a group; raise a KeyError if it does not exist."""
    item = group[name]
    if not isinstance(item, h5py.Group):
        raise KeyError(f"{name} is not a group")
    return item


def _variable(group: h5py.Group, name: str, holds: str, ndim: int) -> h5py.Dataset:
    item = group[name]
    if not isinstance(item, h5py.Dataset):
        raise KeyError(f"{name} is not a variable")
    is_text = h5py.check_string_dtype(item.dtype) is not None
    if item.shape is None or len(item.shape) != ndim or holds != ("text" if is_text else "numbers"):
        raise ValueError(f"{item.name} does not hold {holds} of {ndim} {'dimension' if ndim == 1 else 'dimensions'}")
    return item
