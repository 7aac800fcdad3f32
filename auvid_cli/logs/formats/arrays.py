"""Files of named arrays as logs: NumPy archives and MATLAB files.

Arrays of equal length form a table, which has the name of their struct, or no name without a struct. If lengths differ,
each length forms a table with the name of its first array.
"""

from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import mat_struct

from auvid_cli.child_processes import Workers
from auvid_cli.data.files import damage_as_file_error
from auvid_cli.data.hdf5 import numbers_in, open_hdf5
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import ColumnValues, FileLog, LogColumn, Tables

_MAX_COLUMNS = 100  # columns of an array or structs of a list; larger ones, such as images, are left out

_MAX_TOTAL = 10_000  # columns of a file

_Path = tuple[str, ...]
# Kinds of dtypes.
_NUMBERS = "biuf"
_TEXT = "UM"


class _Shape(NamedTuple):
    shape: tuple[int, ...]
    is_text: bool


class _Place(NamedTuple):
    """Array of a column, and the index of its row (`across`) or column if it has two dimensions."""

    path: _Path
    number: int | None
    across: bool
    is_text: bool


class ArrayLog(FileLog):
    """A file of named arrays; one with two dimensions has the columns ``name[0]``, ``name[1]``.

    Only variables with the requested columns are loaded.
    """

    def _find_tables(self) -> Tables:
        return {
            table: tuple(LogColumn(name, is_text=place.is_text) for name, place in columns.items())
            for table, columns in self._places.items()
        }

    def _read(self, table: str, columns: Sequence[LogColumn]) -> dict[str, ColumnValues]:
        places = {column.name: self._places[table][column.name] for column in columns}
        values: dict[str, ColumnValues] = {}
        arrays = dict(self._arrays({place.path[0] for place in places.values()}))
        for name, place in places.items():
            array = arrays[place.path]
            if place.number is not None:
                array = array[place.number] if place.across else array[:, place.number]
            values[name] = array.astype(str if place.is_text else np.float64)
        return {name: values[name] for name in places}

    @cached_property
    def _places(self) -> dict[str, dict[str, _Place]]:
        shapes = {path: _Shape(array.shape, array.dtype.kind in _TEXT) for path, array in self._arrays()}
        places = _tabulate(shapes)
        if not places:
            raise FileError(f"{self.path}: no arrays of numbers")
        if (n_columns := sum(map(len, places.values()))) > _MAX_TOTAL:
            raise FileError(f"{self.path}: has {n_columns} columns; expected at most {_MAX_TOTAL}")
        return places

    def _refusing_damage(self) -> AbstractContextManager[None]:
        return damage_as_file_error(lambda reason: f"{self.path}: damaged, or of another kind than its name: {reason}")

    @abstractmethod
    def _arrays(self, variables: Collection[str] | None = None) -> Iterator[tuple[_Path, Any]]:
        """Yield path and array for all numbers and text in variables, by default all; vectors have one dimension."""


class NumpyLog(ArrayLog):
    """A NumPy archive."""

    def _arrays(self, variables: Collection[str] | None = None) -> Iterator[tuple[_Path, NDArray[Any]]]:
        with self._refusing_damage(), np.load(self.path) as archive:
            for variable in archive.files if variables is None else variables:
                # Members that are not arrays are returned as bytes.
                array = np.asarray(archive[variable])
                if array.dtype.names is None:
                    yield from _if_usable((variable,), np.squeeze(array))
                for field in array.dtype.names or ():
                    yield from _if_usable((variable, field), np.squeeze(array[field]))


class MatlabLog(ArrayLog):
    """A MATLAB file up to version 7."""

    def _arrays(self, variables: Collection[str] | None = None) -> Iterator[tuple[_Path, NDArray[Any]]]:
        for variable in (
            [name for name in self._content if not name.startswith("__")] if variables is None else variables
        ):
            yield from _flatten((variable,), self._content[variable])

    @cached_property
    def _content(self) -> dict[str, Any]:
        # In another process, because a damaged file may crash the reader.
        with self._refusing_damage(), Workers(1, "spawn") as worker:
            return worker.submit(loadmat, self.path, struct_as_record=False, squeeze_me=True).result()


class MatlabHdf5Log(ArrayLog):
    """A MATLAB file of version 7.3: arrays of numbers, and structs of them."""

    def _arrays(self, variables: Collection[str] | None = None) -> Iterator[tuple[_Path, NDArray[Any]]]:
        with self._refusing_damage(), open_hdf5(self.path, foreign=True) as file:
            if variables is None:
                variables = [str(name) for name in file if not str(name).startswith("#")]
            for variable in variables:
                item = file[variable]
                datasets = {(variable,): item}
                if isinstance(item, h5py.Group):
                    names: list[str] = []
                    item.visit(names.append)
                    datasets = {(variable, *name.split("/")): item[name] for name in names}
                for path, dataset in datasets.items():
                    if numbers_in(dataset):
                        yield from _if_usable(path, _values(dataset))


def _values(dataset: h5py.Dataset) -> NDArray[Any]:
    """Return a dataset as MATLAB shows it; empty for text and cells, which are stored elsewhere."""
    kind = dataset.attrs.get("MATLAB_class", b"double")
    return np.empty(0) if kind in (b"char", b"cell") else np.squeeze(dataset[()].T)


def _flatten(path: _Path, content: Any) -> Iterator[tuple[_Path, NDArray[Any]]]:
    """Yield path and array for a MATLAB variable and the fields of its structs."""
    if isinstance(content, mat_struct):
        for field in vars(content)["_fieldnames"]:
            yield from _flatten((*path, field), getattr(content, field))
    elif isinstance(content, np.ndarray) and content.dtype == object:
        if content.size and all(isinstance(element, str) for element in content.flat):
            yield from _if_usable(path, content.astype(str))
        elif content.size <= _MAX_COLUMNS:
            for k, element in enumerate(content.flat):
                yield from _flatten((*path[:-1], f"{path[-1]}[{k}]"), element)
    elif isinstance(content, np.ndarray):
        yield from _if_usable(path, content)


def _if_usable(path: _Path, array: NDArray[Any]) -> Iterator[tuple[_Path, NDArray[Any]]]:
    """Yield path and array if it has numbers or text, more than one row and few columns."""
    few = array.ndim == 1 or (array.ndim == 2 and min(array.shape) <= _MAX_COLUMNS)
    if array.size > 1 and few and array.dtype.kind in _NUMBERS + _TEXT:
        yield path, array


def _tabulate(shapes: Mapping[_Path, _Shape]) -> dict[str, dict[str, _Place]]:
    vectors = {shape.shape[0] for shape in shapes.values() if len(shape.shape) == 1}
    groups: dict[tuple[str, int], list[_Path]] = {}
    across = {}
    for path, (shape, _) in shapes.items():
        # Time may run along the rows, as the lengths of vectors show.
        across[path] = len(shape) == 2 and shape[0] not in vectors and shape[1] in vectors
        struct = path[0] if len(path) > 1 else ""
        groups.setdefault((struct, shape[1] if across[path] else shape[0]), []).append(path)
    parents = [_parent(paths) for paths in groups.values()]
    tables: dict[str, dict[str, _Place]] = {}
    for parent, paths in zip(parents, groups.values(), strict=True):
        table = ".".join(parent if parents.count(parent) == 1 else paths[0])
        columns = tables[table] = {}
        for path in paths:
            name, (shape, is_text) = ".".join(path[len(parent) :]), shapes[path]
            if len(shape) == 1:
                columns[name] = _Place(path, None, False, is_text)
            else:
                for k in range(shape[0] if across[path] else shape[1]):
                    columns[f"{name}[{k}]"] = _Place(path, k, across[path], is_text)
    return tables


def _parent(paths: Sequence[_Path]) -> _Path:
    """Return the innermost struct that holds all of the arrays."""
    depth = min(map(len, paths)) - 1
    while any(path[:depth] != paths[0][:depth] for path in paths):
        depth -= 1
    return paths[0][:depth]
