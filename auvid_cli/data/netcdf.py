"""HDF5 files by the netCDF-4 conventions, so that xarray opens every group as it is."""

import hashlib
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from auvid_cli import __version__
from auvid_cli.data.files import replacing
from auvid_cli.errors import FileError

SCHEMA_VERSION = 1
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
    # Made in memory and written as bytes: on a full disk HDF5 prints pages of its own, or crashes.
    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        file.attrs.update(
            {
                "Conventions": "CF-1.11",
                "kind": f"auvid {kind}",
                "schema_version": SCHEMA_VERSION,
                "settings": settings,
                "seed": seed,
                "auvid_version": __version__,
                "library_versions": ", ".join(f"{name} {version(name)}" for name in _LIBRARIES),
                "platform": f"{platform.platform()}, Python {sys.version.split()[0]}",
                "created": datetime.now(UTC).isoformat(timespec="seconds"),
                **attributes,
            }
        )
        yield file
        file.flush()
        image = file.id.get_file_image()
    with replacing(path) as temporary:
        temporary.write_bytes(image)


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
    data.attrs["long_name"] = long_name
    if unit:
        data.attrs["units"] = unit
    return data


def write_variable(
    group: h5py.Group, name: str, values: NDArray, dimensions: tuple[str, ...], long_name: str, unit: str = ""
) -> None:
    """A variable on dimensions already written in the group."""
    data = _create(group, name, values, long_name, unit)
    for axis, dimension in enumerate(dimensions):
        data.dims[axis].attach_scale(group[dimension])


def read_array(group: h5py.Group, name: str) -> NDArray[np.float64]:
    """A numeric variable as doubles."""
    return np.asarray(_variable(group, name)[...], dtype=np.float64)


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
