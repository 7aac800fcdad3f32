"""Reading what `auvid_cli.data.netcdf` writes, from files that may be anybody's: all that is read is as it must be."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from auvid_cli.config.quantity import parse_quantity
from auvid_cli.config.settings import Settings
from auvid_cli.data.hdf5 import DAMAGE, open_hdf5
from auvid_cli.data.netcdf import SCHEMA_VERSION
from auvid_cli.errors import FileError
from auvid_cli.printable import one_line, shortened
from auvid_cli.vehicle.parameters import Quantity

_MOST_NAMES = 1000


class FileAttributes(Settings):
    """What the root of every file says of it; each kind of file has a form that adds to this."""

    schema_version: Annotated[int, Field(ge=1)]


Form = TypeVar("Form", bound=FileAttributes)


@contextmanager
def open_file(path: Path, kind: str) -> Iterator[h5py.File]:
    """Open an existing file, checked to be auvid's, of this kind and of a schema that is understood.

    Raises
    ------
    FileError
        If it is missing, truncated, not HDF5, of another kind, newer, or lacks what it must have; what is wrong with
        it may be raised within the block as a ValueError that says where.
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
    except DAMAGE as error:
        raise FileError(f"{path}: damaged or not an auvid {kind} file: {one_line(str(error))}") from error


def read_attributes(file: h5py.File, form: type[Form]) -> Form:
    """Read the root attributes that a form asks for, and no others.

    Raises
    ------
    ValueError
        If one is missing or is not as it must be.
    """
    attributes = {name: _plain(file.attrs[name]) for name in form.model_fields if name in file.attrs}
    try:
        return form.model_validate(attributes)
    except ValidationError as error:
        first = error.errors()[0]
        name, why = str(first["loc"][0]), first["msg"]
        if first["type"] == "string_pattern_mismatch":
            # A pattern says nothing to whoever reads it.
            why = f"{attributes[name]!r} is not as auvid writes it"
        raise ValueError(f"attribute {name}: {shortened(one_line(why))}") from None


def _plain(value: Any) -> Any:
    """Return a number of NumPy's as Python's own."""
    return value.item() if isinstance(value, np.generic) else value


def read_array(group: h5py.Group, name: str, every: int = 1, ndim: int = 1) -> NDArray[np.float64]:
    """Read a numeric variable as doubles; of its rows every so many, and the last."""
    data = _variable(group, name, "numbers", ndim)
    rows = data[(data.shape[0] - 1) % every :: every] if every > 1 else data[...]
    return np.asarray(rows, dtype=np.float64)


def check_units(group: h5py.Group, quantities: Iterable[Quantity]) -> None:
    """Refuse values in other units than auvid's, where a file states any.

    Raises
    ------
    ValueError
        With the variable, its unit, and what is expected.
    """
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


def read_table(group: h5py.Group, names: Sequence[str], every: int = 1) -> NDArray[np.float64]:
    """Read variables of one length side by side, as `read_array` does."""
    first = read_array(group, names[0], every)
    table = np.empty((len(first), len(names)))
    table[:, 0] = first
    for column, name in enumerate(names[1:], 1):
        values = read_array(group, name, every)
        if values.size != len(first):
            raise ValueError(f"{group.name}/{name} is not as long as {group.name}/{names[0]}")
        table[:, column] = values
    return table


def mark_missing(group: h5py.Group, name: str, values: NDArray[np.float64]) -> None:
    """Put NaN in place of values where a variable of flags is zero."""
    flags = read_array(group, name, ndim=2)
    if flags.shape != values.shape:
        raise ValueError(f"{group.name}/{name} does not fit the values that it is about")
    values[flags == 0.0] = np.nan


def read_rows(group: h5py.Group, name: str, first: int, last: int, ndim: int = 1) -> NDArray[np.float64]:
    """Read consecutive rows of a numeric variable as doubles."""
    return np.asarray(_variable(group, name, "numbers", ndim)[first:last], dtype=np.float64)


def count_rows(group: h5py.Group, name: str) -> int:
    """Count the rows of a variable of one dimension."""
    return _variable(group, name, "numbers", 1).shape[0]


def read_names(group: h5py.Group, name: str) -> tuple[str, ...]:
    """Read a variable of strings, of which there are not many."""
    data = _variable(group, name, "text", 1)
    if data.shape[0] > _MOST_NAMES:
        raise ValueError(f"{data.name} has more entries than there are names")
    return tuple(str(text) for text in data.asstr()[...])


def subgroups(group: h5py.Group, name: str) -> dict[str, h5py.Group]:
    """Return the groups in a group, by name; none if that does not exist."""
    if name not in group:
        return {}
    return {key: item for key, item in subgroup(group, name).items() if isinstance(item, h5py.Group)}


def subgroup(group: h5py.Group, name: str) -> h5py.Group:
    """Return a group that must be there."""
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
