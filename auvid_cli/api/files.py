"""Experiments, datasets and estimates from files."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from auvid_cli.api.arguments import checked
from auvid_cli.config import loading
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import Override, find_experiment
from auvid_cli.data import dataset_file, estimate_file
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.netcdf import digest
from auvid_cli.errors import ConfigError, DataError, FileError


@checked
def load_experiment(source: str | Path | None = None, *overrides: str) -> Experiment:
    """Read the settings of an experiment.

    Parameters
    ----------
    source : str or pathlib.Path, optional
        A YAML file, or the name of an experiment that ships with auvid, such as ``"remus100"``. Default: the spiral.
    *overrides : str
        ``KEY=VALUE`` each, with units, or a YAML file of settings, as behind ``--set`` on the command line; applied in
        turn.

    Returns
    -------
    Experiment
        Resolved settings in SI.

    Raises
    ------
    ConfigError
        With every mistake at once, each at its file, line and column.

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
        ``KEY=VALUE`` each, or a YAML file of settings: changes of ``identification.*``, ``vehicle.*`` or ``name``
        in the settings inside.

    Returns
    -------
    Dataset
        Inputs, sensors and, where a simulation made it, the truth; SI.

    Raises
    ------
    FileError
        If it is missing, damaged, foreign, of a newer schema, or has impossible values.
    ConfigError
        If the settings inside, with the overrides, are not valid, or an override changes recorded data.

    Examples
    --------
    >>> dataset = auvid.read_dataset("dataset.h5", "identification.gate=0.999")
    >>> sorted(dataset.sensors)
    ['accelerometer', 'attitude', 'dvl', 'gyroscope', 'magnetometer']
    """
    for override in overrides:
        for key in Override.parse(override).keys:
            if not f"{key}.".startswith(("identification.", "vehicle.", "name.")):
                what = override if "=" in override else f"{override}: {key}"
                raise ConfigError(
                    f"{what}: would change nothing, the data of {path} are already recorded; "
                    "only vehicle.*, identification.* and name can be set for a dataset"
                )
    return dataset_file.read_dataset(Path(path), overrides)


@checked
def write_dataset(path: str | Path, dataset: Dataset) -> Dataset:
    """Write a dataset, whole or not at all; an existing file is replaced.

    Parameters
    ----------
    path : str or pathlib.Path
        HDF5, see docs/formats.md for its groups and units.
    dataset : Dataset

    Returns
    -------
    Dataset
        The same with the SHA-256 of the file, by which estimates name the data that they are made from.

    Raises
    ------
    FileError
        If the file cannot be written.

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
    """Read an estimate file; of a very long one evenly spaced events, as many as an evaluation needs.

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
        If it is missing, damaged, foreign, of a newer schema, or has impossible values.

    Examples
    --------
    >>> estimate = auvid.read_estimate("tukf.h5")
    >>> estimate.filter, estimate.completed
    ('tukf', True)
    """
    return estimate_file.read_estimate(Path(path))


def estimate_and_file(estimate: Estimate | str | Path) -> tuple[Estimate, Path | None]:
    """Return an estimate, read if it is a file, and its file if there is one."""
    if isinstance(estimate, Estimate):
        return estimate, None
    return read_estimate(Path(estimate)), Path(estimate)


def refuse_estimates_of_others(dataset: Dataset, estimates: Iterable[Estimate]) -> None:
    """Refuse estimates that were made from the file of another dataset.

    Raises
    ------
    DataError
        If an estimate was made from another dataset.
    """
    for estimate in estimates:
        if estimate.dataset_sha256 and dataset.sha256 and estimate.dataset_sha256 != dataset.sha256:
            raise DataError(f"the estimate of {estimate.filter} was made from another dataset than this one")


def refuse_to_replace(dataset: Dataset, file: Path) -> None:
    """Refuse to replace the dataset: recorded data are lost for good.

    Raises
    ------
    FileError
        If the file is that of the dataset.
    """
    if dataset.sha256 and file.is_file() and digest(file) == dataset.sha256:
        raise FileError(f"{file}: is the dataset itself, and would be lost; name another file")
