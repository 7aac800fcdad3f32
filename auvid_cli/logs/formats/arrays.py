"""Files of named arrays as logs: NumPy archives and MATLAB files.

Arrays of equal length form a table, which has the name of their struct, or no name without a struct. If lengths differ,
each length forms a table with the name of its first array.
"""

import re
from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatlabOpaque, mat_struct

from auvid_cli.child_processes import Workers
from auvid_cli.data.files import damage_as_file_error
from auvid_cli.data.hdf5 import numbers_in, open_hdf5
from auvid_cli.errors import FileError
from auvid_cli.logs.formats.log import ColumnValues, FileLog, LogColumn, Tables

_MAX_COLUMNS = 100  # columns of an array or structs of a list; larger ones, such as images, are left out

_MAX_TOTAL = 10_000  # columns of a file

_OBJECT = "MATLAB_object_decode"  # attribute of an object in a file of version 7.3
_TIME = re.compile(r"(?i)(^t$|^t_|time|stamp|seconds|epoch|utc)")
# Classes of MATLAB that only MATLAB decodes, and its line that exports them.
_EXPORTS = {
    "table": "S = table2struct({0}, 'ToScalar', true); save('{0}.mat', '-struct', 'S')",
    "timetable": "T = timetable2table({0}); T.(1) = seconds(T.(1) - T.(1)(1)); "
    "S = table2struct(T, 'ToScalar', true); save('{0}.mat', '-struct', 'S')",
    "datetime": "{0} = posixtime({0}), and save again",
    "duration": "{0} = seconds({0}), and save again",
    "timeseries": "S = struct('time', {0}.Time, 'data', {0}.Data); save('{0}.mat', '-struct', 'S')",
}
_Path = tuple[str, ...]
# Kinds of dtypes.
_NUMBERS = "biuf"
_TEXT = "UM"


class _Place(NamedTuple):
    """Array of a column, and the index of its row (`across`) or column if it has two dimensions."""

    path: _Path
    number: int | None
    across: bool
    is_text: bool
    is_short: bool = False  # whether the last sample is missing


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
            if place.is_short:
                values[name] = np.append(values[name], "" if place.is_text else np.nan)
        return {name: values[name] for name in places}

    def remarks(self) -> tuple[str, ...]:
        """Return the objects of MATLAB that are left out, and the arrays that are a sample short."""
        short = {place.path for columns in self._places.values() for place in columns.values() if place.is_short}
        names = ", ".join(dict.fromkeys(".".join(path) for path in sorted(short)))
        ends = (f"{names}: one sample shorter than the time; the last sample is taken as missing",) if short else ()
        return (*map(_export, self._objects().items()), *ends)

    def _objects(self) -> Mapping[str, str]:
        """Return the class of each object of MATLAB by its name."""
        return {}

    @cached_property
    def _places(self) -> dict[str, dict[str, _Place]]:
        shapes = {path: (array.shape, array.dtype.kind in _TEXT) for path, array in self._arrays()}
        places = _tabulate(shapes)
        if not places:
            objects = "; ".join(map(_export, self._objects().items()))
            raise FileError(f"{self.path}: {objects or 'no arrays of numbers'}")
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
        own = [name for name in self.content if not name.startswith("__")]
        for variable in own if variables is None else variables:
            yield from _flatten((variable,), self.content[variable])

    def _objects(self) -> dict[str, str]:
        return dict(_opaque(self.content))

    @cached_property
    def content(self) -> dict[str, Any]:
        """Return the variables of the file by name."""
        # In another process, because a damaged file may crash the reader.
        with self._refusing_damage(), Workers(1) as worker:
            return worker.submit(loadmat, self.path, struct_as_record=False, squeeze_me=True).result()


class MatlabHdf5Log(ArrayLog):
    """A MATLAB file of version 7.3: arrays of numbers, and structs of them."""

    def _objects(self) -> dict[str, str]:
        objects: dict[str, str] = {}

        def add(name: str, item: h5py.Dataset | h5py.Group) -> None:
            if _OBJECT in item.attrs and not name.startswith("#"):
                objects[name.replace("/", ".")] = _text(item.attrs.get("MATLAB_class", b"object"))

        with self._refusing_damage(), open_hdf5(self.path, foreign=True) as file:
            file.visititems(add)
        return objects

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


def _export(item: tuple[str, str]) -> str:
    """Return how to export an object of MATLAB, given its name and class."""
    name, kind = item
    line = _EXPORTS.get(kind, "S = struct({0}); save('{0}.mat', '-struct', 'S')").format(name)
    return f"{name} is a {kind} of MATLAB, which only MATLAB reads; export it there: {line}"


def _opaque(content: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield name and class of the objects of a MATLAB file up to version 7."""
    for variable, value in content.items():
        if isinstance(value, MatlabOpaque) and not variable.startswith("__"):
            fields = {str(name): np.ravel(value[name])[0] for name in value.dtype.names or ()}
            name, kind = (fields.get(new, fields.get(old, b"")) for new, old in (("_Name", "s0"), ("_Class", "s2")))
            yield (_text(name) or variable, _text(kind))
        elif isinstance(value, mat_struct):
            yield from _opaque({f"{variable}.{field}": getattr(value, field) for field in vars(value)["_fieldnames"]})


def _text(value: Any) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)


def _values(dataset: h5py.Dataset) -> NDArray[Any]:
    """Return a dataset as MATLAB shows it; empty for text and cells, which are stored elsewhere."""
    kind = dataset.attrs.get("MATLAB_class", b"double")
    return np.empty(0) if kind in (b"char", b"cell") or _OBJECT in dataset.attrs else np.squeeze(dataset[()].T)


def _flatten(path: _Path, content: Any) -> Iterator[tuple[_Path, NDArray[Any]]]:
    """Yield path and array for a MATLAB variable and the fields of its structs."""
    if isinstance(content, mat_struct):
        for field in vars(content)["_fieldnames"]:
            yield from _flatten((*path, field), getattr(content, field))
    elif isinstance(content, MatlabOpaque):
        return
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


def _tabulate(shapes: Mapping[_Path, tuple[tuple[int, ...], bool]]) -> dict[str, dict[str, _Place]]:
    """Return the places of columns by table, from the shape of each array and whether it is text."""
    vectors = {shape[0] for shape, _ in shapes.values() if len(shape) == 1}
    groups: dict[tuple[_Path, int], list[_Path]] = {}
    # Time may run along the rows: then a vector has the length of a row, or there are more columns than signals.
    across = {
        path: len(shape) == 2 and shape[0] not in vectors and (shape[1] in vectors or shape[1] > _MAX_COLUMNS)
        for path, (shape, _) in shapes.items()
    }
    lengths = {path: shape[1] if across[path] else shape[0] for path, (shape, _) in shapes.items()}
    timed = {(path[:-1], length) for path, length in lengths.items() if _TIME.search(path[-1])}
    # Arrays without a time of their length next to them, but with one that is a sample longer.
    short = {
        path
        for path, length in lengths.items()
        if length > 1 and (path[:-1], length) not in timed and (path[:-1], length + 1) in timed
    }
    for path, length in lengths.items():
        rows = length + (path in short)
        # A struct with its own time is a table of its own.
        struct = path[:-1] if (path[:-1], rows) in timed else path[:1] if len(path) > 1 else ()
        groups.setdefault((struct, rows), []).append(path)
    parents = [_parent(paths) for paths in groups.values()]
    tables: dict[str, dict[str, _Place]] = {}
    for parent, paths in zip(parents, groups.values(), strict=True):
        table = ".".join(parent if parents.count(parent) == 1 else paths[0])
        columns = tables[table] = {}
        for path in paths:
            name, (shape, is_text) = ".".join(path[len(parent) :]), shapes[path]
            if len(shape) == 1:
                columns[name] = _Place(path, None, False, is_text, path in short)
            else:
                for k in range(shape[0] if across[path] else shape[1]):
                    columns[f"{name}[{k}]"] = _Place(path, k, across[path], is_text, path in short)
    return tables


def _parent(paths: Sequence[_Path]) -> _Path:
    """Return the innermost struct that holds all of the arrays."""
    depth = min(map(len, paths)) - 1
    while any(path[:depth] != paths[0][:depth] for path in paths):
        depth -= 1
    return paths[0][:depth]
