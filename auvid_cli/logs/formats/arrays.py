"""Logs that are files of named arrays: NumPy archives and MATLAB files.

Arrays of one length make a table. Those of the file itself are the table without a name, those of a struct are a table
that is called as the struct is; where lengths differ, each length is a table called by its first array.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import mat_struct

from auvid_cli.child_processes import WorkerPool
from auvid_cli.data.files import damage_as_file_error
from auvid_cli.data.hdf5 import numbers_in, open_hdf5
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import ColumnValues, Log, LogColumn, look_up

# Wider arrays and longer lists of structs are pictures and the like, no columns.
_MOST_COLUMNS = 100

_Path = tuple[str, ...]
_NUMBERS, _TEXT = "biuf", "UM"


class _Shape(NamedTuple):
    shape: tuple[int, ...]
    is_text: bool


class _Place(NamedTuple):
    """Where the values of a column are: an array, and one of its rows or columns if it has two dimensions."""

    path: _Path
    number: int | None
    across: bool
    is_text: bool


class ArrayLog(Log):
    """A file of named arrays."""

    def tables(self) -> dict[str, tuple[LogColumn, ...]]:
        """List the columns by the names of their arrays, ``name[0]``, ``name[1]`` of an array with two dimensions."""
        return {
            table: tuple(LogColumn(name, is_text=place.is_text) for name, place in columns.items())
            for table, columns in self._places.items()
        }

    def read(self, table: str, columns: Sequence[str]) -> dict[str, ColumnValues]:
        """Read columns by name; of the file's variables only those are loaded that hold them."""
        places = {column.name: self._places[table][column.name] for column in look_up(self, table, columns)}
        values: dict[str, ColumnValues] = {}
        for variable in dict.fromkeys(place.path[0] for place in places.values()):
            arrays = dict(self._arrays(variable))
            for name, place in places.items():
                if place.path[0] == variable:
                    array = arrays[place.path]
                    if place.number is not None:
                        array = array[place.number] if place.across else array[:, place.number]
                    values[name] = array.astype(str if place.is_text else np.float64)
        return {name: values[name] for name in columns}

    @cached_property
    def _places(self) -> dict[str, dict[str, _Place]]:
        shapes = {
            path: _Shape(array.shape, array.dtype.kind in _TEXT)
            for variable in self._variables()
            for path, array in self._arrays(variable)
        }
        places = _tabulate(shapes)
        if not places:
            raise FileError(f"{self.path}: holds no arrays of numbers")
        return places

    def _refusing_damage(self) -> AbstractContextManager[None]:
        return damage_as_file_error(lambda reason: f"{self.path}: is damaged or not what it is called: {reason}")

    @abstractmethod
    def _variables(self) -> Sequence[str]:
        """Return the names of what the file holds."""

    @abstractmethod
    def _arrays(self, variable: str) -> Iterator[tuple[_Path, Any]]:
        """Find the arrays of numbers or text that a variable holds, each with its path, vectors with one dimension."""


class NumpyLog(ArrayLog):
    """A NumPy archive."""

    def _variables(self) -> Sequence[str]:
        with self._refusing_damage(), np.load(self.path) as archive:
            return archive.files

    def _arrays(self, variable: str) -> Iterator[tuple[_Path, NDArray[Any]]]:
        with self._refusing_damage(), np.load(self.path) as archive:
            # What is no array in it comes as bytes.
            array = np.asarray(archive[variable])
        if array.dtype.names is None:
            yield from _if_usable((variable,), np.squeeze(array))
        for field in array.dtype.names or ():
            yield from _if_usable((variable, field), np.squeeze(array[field]))


class MatlabLog(ArrayLog):
    """A MATLAB file up to version 7."""

    def _variables(self) -> Sequence[str]:
        return [name for name in self._content if not name.startswith("__")]

    def _arrays(self, variable: str) -> Iterator[tuple[_Path, NDArray[Any]]]:
        yield from _flatten((variable,), self._content[variable])

    @cached_property
    def _content(self) -> dict[str, Any]:
        # A damaged file may bring down the process that reads it.
        with self._refusing_damage(), WorkerPool(1, "spawn") as worker:
            return worker.submit(loadmat, self.path, struct_as_record=False, squeeze_me=True).result()


class MatlabHdf5Log(ArrayLog):
    """A MATLAB file of version 7.3: its arrays of numbers and structs of such."""

    def _variables(self) -> Sequence[str]:
        with self._refusing_damage(), open_hdf5(self.path, foreign=True) as file:
            return [str(name) for name in file if not str(name).startswith("#")]

    def _arrays(self, variable: str) -> Iterator[tuple[_Path, NDArray[Any]]]:
        with self._refusing_damage(), open_hdf5(self.path, foreign=True) as file:
            item = file[variable]
            datasets = {(variable,): item}
            if isinstance(item, h5py.Group):
                names: list[str] = []
                item.visit(names.append)
                datasets = {(variable, *name.split("/")): item[name] for name in names}
            arrays = {path: _values(dataset) for path, dataset in datasets.items() if numbers_in(dataset)}
        for path, array in arrays.items():
            yield from _if_usable(path, array)


def _values(dataset: h5py.Dataset) -> NDArray[Any]:
    """Read a dataset as MATLAB shows it; empty if it is text or cells, which are stored elsewhere."""
    kind = dataset.attrs.get("MATLAB_class", b"double")
    return np.empty(0) if kind in (b"char", b"cell") else np.squeeze(dataset[()].T)


def _flatten(path: _Path, content: Any) -> Iterator[tuple[_Path, NDArray[Any]]]:
    """Return the arrays of a MATLAB variable, those of structs by their fields."""
    if isinstance(content, mat_struct):
        for field in vars(content)["_fieldnames"]:
            yield from _flatten((*path, field), getattr(content, field))
    elif isinstance(content, np.ndarray) and content.dtype == object:
        if content.size and all(isinstance(element, str) for element in content.flat):
            yield from _if_usable(path, content.astype(str))
        elif content.size <= _MOST_COLUMNS:
            for k, element in enumerate(content.flat):
                yield from _flatten((*path[:-1], f"{path[-1]}[{k}]"), element)
    elif isinstance(content, np.ndarray):
        yield from _if_usable(path, content)


def _if_usable(path: _Path, array: NDArray[Any]) -> Iterator[tuple[_Path, NDArray[Any]]]:
    """Return an array if it is one of numbers or text with more than one row and few columns."""
    few = array.ndim == 1 or (array.ndim == 2 and min(array.shape) <= _MOST_COLUMNS)
    if array.size > 1 and few and array.dtype.kind in _NUMBERS + _TEXT:
        yield path, array


def _tabulate(shapes: Mapping[_Path, _Shape]) -> dict[str, dict[str, _Place]]:
    """Return the columns of each table."""
    vectors = {shape.shape[0] for shape in shapes.values() if len(shape.shape) == 1}
    groups: dict[tuple[str, int], list[_Path]] = {}
    across = {}
    for path, (shape, _) in shapes.items():
        # Time may run along the rows; the vectors beside an array tell.
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
