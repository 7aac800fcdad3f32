"""Experiments, datasets and estimates from files, sources of data, and the check of arguments by type."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import NamedTuple, ParamSpec, TypeAlias, TypeVar

from pydantic import ConfigDict, ValidationError, validate_call
from pydantic_core import ErrorDetails

from auvid_cli.api import Destination
from auvid_cli.config import loading
from auvid_cli.config.experiment import Experiment, RunSettings
from auvid_cli.config.loading import Override, find_experiment
from auvid_cli.data import dataset_file, estimate_file
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.files import check_no_overlap, folder_of_dataset, folder_of_run, locked, tables_and_figures
from auvid_cli.data.netcdf import digest
from auvid_cli.data.results import put_copy, refuse_other_page
from auvid_cli.errors import ConfigError, DataError, FileError

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
LOADERS = {"Experiment": "load_experiment", "Dataset": "read_dataset", "Estimate": "read_estimate"}


def checked(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Return a function that first checks its arguments by their annotations.

    Raises
    ------
    TypeError
        For an argument of another type; the message names the argument, the expected type and the actual type.
    InvalidDataError
        For an estimate with impossible values; a dataset is checked when it is made.
    """
    names = list(signature(function).parameters)
    validated = validate_call(config=ConfigDict(arbitrary_types_allowed=True, strict=True))(function)

    @wraps(function)
    def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        for value in (*args, *kwargs.values()):
            if isinstance(value, Estimate):
                value.validate()
        try:
            return validated(*args, **kwargs)
        except ValidationError as error:
            if error.title != function.__name__:
                raise
            raise TypeError(f"{function.__name__}: {_description(names, error.errors(include_url=False))}") from None

    return call


def _description(names: list[str], errors: list[ErrorDetails]) -> str:
    """Return one line about the first invalid argument."""
    place, *_ = errors[0]["loc"]
    messages = dict.fromkeys(error["msg"] for error in errors if error["loc"][0] == place)
    expected = " or ".join(messages).replace("Input should be", "must be")
    # All arguments of `*estimates` have the same name.
    name = place if isinstance(place, str) else names[min(place, len(names) - 1)]
    value = errors[0]["input"]
    hint = next((loader for kind, loader in LOADERS.items() if kind in expected), "")
    is_name = hint and isinstance(value, str | Path)
    return f"{name}: {expected}; got {type(value).__name__}" + (f" {str(value)!r}, see {hint}" if is_name else "")


@checked
def load_experiment(source: str | Path | None = None, *overrides: str) -> Experiment:
    """Read the settings of an experiment.

    Parameters
    ----------
    source : str or pathlib.Path, optional
        YAML file, or name of a shipped experiment, such as ``"remus100"``. Default: ``"spiral"``.
    *overrides : str
        ``KEY=VALUE``, with units, or a YAML file of settings, as after ``--set`` on the command line; applied in this
        order.

    Returns
    -------
    Experiment
        Resolved settings, SI.

    Raises
    ------
    ConfigError
        With all mistakes, each with file, line and column.

    Examples
    --------
    >>> experiment = auvid.load_experiment("spiral", "manoeuvre.duration=60 s", "seed=7")
    >>> experiment.manoeuvre.duration
    60.0
    """
    return loading.load_experiment(find_experiment(None if source is None else str(source)), overrides)


@checked
def read_dataset(path: str | Path, *overrides: str) -> Dataset:
    """Read a dataset file.

    Parameters
    ----------
    path : str or pathlib.Path
    *overrides : str
        ``KEY=VALUE``, or a YAML file of settings; only ``identification.*``, ``vehicle.*`` and ``name`` can change.

    Returns
    -------
    Dataset
        Inputs, sensors and, after a simulation, the truth; SI.

    Raises
    ------
    FileError
        If it is missing, damaged, not a file of auvid, of a newer schema, or has impossible values.
    ConfigError
        If its settings are invalid after the overrides, or an override would change recorded data.

    Examples
    --------
    >>> dataset = auvid.read_dataset("dataset.h5", "identification.gate=0.999")
    >>> sorted(dataset.sensors)
    ['accelerometer', 'attitude', 'dvl', 'gyroscope', 'magnetometer']
    """
    for override in overrides:
        for key in Override.parse(override).keys:
            if not f"{key}.".startswith(("identification.", "vehicle.", "name.")):
                place = override if "=" in override else f"{override}: {key}"
                raise ConfigError(
                    f"{place}: has no effect, because the data of {path} are already recorded; "
                    "expected vehicle.*, identification.* or name"
                )
    return dataset_file.read_dataset(Path(path), overrides)


@checked
def write_dataset(path: str | Path, dataset: Dataset) -> Dataset:
    """Write a dataset; an existing file is replaced, and after an error no partial file is left.

    Parameters
    ----------
    path : str or pathlib.Path
        HDF5 file; docs/formats.md lists its groups and units.
    dataset : Dataset

    Returns
    -------
    Dataset
        The dataset with the SHA-256 of the file, which estimates refer to.

    Raises
    ------
    FileError
        If writing fails.

    Examples
    --------
    >>> dataset = auvid.write_dataset("copy.h5", dataset)
    >>> len(dataset.sha256)
    64
    """
    dataset_file.write_dataset(Path(path), dataset)
    return replace(dataset, sha256=digest(Path(path)))


@checked
def read_estimate(path: str | Path) -> Estimate:
    """Read an estimate file; a very long one is thinned out to evenly spaced events.

    Parameters
    ----------
    path : str or pathlib.Path

    Returns
    -------
    Estimate
        Augmented state over time, SI.

    Raises
    ------
    FileError
        If it is missing, damaged, not a file of auvid, of a newer schema, or has impossible values.

    Examples
    --------
    >>> estimate = auvid.read_estimate("tukf.h5")
    >>> estimate.filter, estimate.completed
    ('tukf', True)
    """
    return estimate_file.read_estimate(Path(path))


class RecordedData(NamedTuple):
    """A dataset file, and the dataset with overrides of its settings."""

    path: Path
    dataset: Dataset

    @property
    def experiment(self) -> RunSettings:
        """Return the settings."""
        return self.dataset.experiment

    @property
    def folder(self) -> Path:
        """Return the default results folder."""
        return folder_of_dataset(self.path)

    @property
    def files(self) -> list[Path]:
        """Return the files that must not be overwritten."""
        return [self.path, *self.experiment.data_files()]


class SimulatedData(NamedTuple):
    """An experiment, and the files that it was read from."""

    experiment: Experiment
    files: Sequence[Path]

    @property
    def folder(self) -> Path:
        """Return the default results folder."""
        return folder_of_run(self.experiment.name)


DataSource: TypeAlias = RecordedData | SimulatedData


@contextmanager
def results_folder(
    place: Destination, source: RecordedData, others: Iterable[Path] = (), new: Sequence[str] = (), page: str = ""
) -> Iterator[Path]:
    """Lock a results folder, copy a dataset into it, and yield the folder.

    Parameters
    ----------
    others : iterable of pathlib.Path
        Further files that must not be overwritten.
    new : sequence of str
        Names of files that will be written in addition to tables and figures.
    page : str
        Name of the page that will be written; refused if the file is not a page of auvid.

    Raises
    ------
    FileError
        If the folder has results of other data and may not be overwritten, or a file of the user would be lost.
    """
    folder, inputs = place.folder or source.folder, [*source.files, *others]
    with locked(folder):
        if page:
            refuse_other_page(folder / page)
        put_copy(source.path, source.dataset, folder, inputs, place.overwrite)
        check_no_overlap([*(folder / name for name in new), *tables_and_figures(folder)], inputs)
        yield folder


def estimate_and_file(estimate: Estimate | str | Path) -> tuple[Estimate, Path | None]:
    """Return an estimate, read from a file if necessary, and its file if there is one."""
    if isinstance(estimate, Estimate):
        return estimate, None
    return read_estimate(Path(estimate)), Path(estimate)


def check_same_dataset(dataset: Dataset, estimates: Iterable[Estimate]) -> None:
    """Raise a DataError if an estimate was made from the file of another dataset."""
    for estimate in estimates:
        if estimate.dataset_sha256 and dataset.sha256 and estimate.dataset_sha256 != dataset.sha256:
            raise DataError(f"estimate of {estimate.filter}: was made from another dataset; expected this dataset")


def refuse_to_replace(dataset: Dataset, file: Path) -> None:
    """Raise a FileError if the file to be written is the file of the dataset."""
    if dataset.sha256 and file.is_file() and digest(file) == dataset.sha256:
        raise FileError(f"{file}: is the dataset itself; expected another file name")
