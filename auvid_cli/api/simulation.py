"""Simulation of an experiment, first folders, and vehicles from their geometry."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from auvid_cli.api import Progress
from auvid_cli.api.files import SimulatedData, checked
from auvid_cli.config.enums import FilterName
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import parse_drawing
from auvid_cli.config.outline import derived_vehicle_yaml, outline_of_options
from auvid_cli.config.units import parse_quantity
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.files import check_no_overlap, dataset_in, estimates_in, locked, write_folder, write_text
from auvid_cli.data.hdf5 import scan
from auvid_cli.data.netcdf import digest
from auvid_cli.data.results import other_estimates, other_run, put_dataset, refuse_unless
from auvid_cli.errors import ConfigError
from auvid_cli.simulation import simulate as simulation
from auvid_cli.simulation.field_log import field_log
from auvid_cli.simulation.first_folder import (
    FirstFolder,
    SanityRow,
    folder_like,
    folder_of_outline,
    sanity_notes,
    sanity_rows,
)


@checked
def simulate(experiment: Experiment) -> Dataset:
    """Simulate the vehicle and the sensors of an experiment.

    Parameters
    ----------
    experiment : Experiment
        See `load_experiment`. The same seed gives the same data.

    Returns
    -------
    Dataset
        Inputs, sensors and truth; SI.

    Raises
    ------
    SimulationError
        If the vehicle leaves the range in which the model is valid.
    ConfigError
        If parameters of the vehicle are impossible, or reading a recorded manoeuvre fails.

    Examples
    --------
    >>> dataset = auvid.simulate(auvid.load_experiment("spiral", "manoeuvre.duration=10 s"))
    >>> dataset.sensors["dvl"].values.shape
    (71, 3)
    """
    return simulation.simulate(experiment)


def simulate_into(
    folder: Path, source: SimulatedData, overwrite: bool, progress: Progress, filters: Collection[FilterName] = ()
) -> Dataset:
    """Simulate an experiment, write ``folder/dataset.h5``, and read it back.

    The caller holds the lock of the folder. If the data are the same as before, existing results are kept.

    Parameters
    ----------
    overwrite : bool
        Whether results of another run may be replaced.
    filters : collection of FilterName
        Filters that will run on the data.
    """
    path, experiment = dataset_in(folder), source.experiment
    # One child process scans all files.
    scan([path, *estimates_in(folder).values()])
    objection = other_run(path, experiment)
    if not objection and filters and path.exists():
        objection = next(iter(other_estimates(folder, experiment, digest(path), filters).values()), "")
    refuse_unless(overwrite, objection)
    with progress.stage("simulate"):
        simulated = simulation.simulate(experiment)
    put_dataset(path, simulated, source.files, overwrite, objection)
    # Free the memory before the data are read again.
    del simulated
    with progress.stage("read the dataset"):
        dataset = read_dataset(path)
    sensors = ", ".join(f"{name} {record.time.size}" for name, record in dataset.sensors.items())
    progress.message(f"{path}: {dataset.inputs.time[-1]:g} s of {experiment.manoeuvre.type}; samples: {sensors}")
    return dataset


def simulate_log_into(folder: Path, source: SimulatedData, overwrite: bool, progress: Progress) -> list[Path]:
    """Simulate an experiment, write CSV logs like those of a real vehicle into a folder, and return their paths."""
    with locked(folder):
        with progress.stage("simulate"):
            logs = field_log(simulation.simulate(source.experiment))
        texts = {folder / name: text for name, text in logs.items()}
        refuse_unless(overwrite, next((f"{path}: exists already" for path in texts if path.exists()), ""))
        check_no_overlap(texts, source.files)
        for path, text in texts.items():
            write_text(path, text)
        return [*texts]


def new_folder(folder: Path, options: Mapping[str, str | int], like: str | None) -> FirstFolder:
    """Write a first folder.

    Parameters
    ----------
    folder : pathlib.Path
        New or empty.
    options : mapping
        Keys of an outline; only ``speed`` with `like`.
    like : str or None
        Name of a shipped vehicle to start with.
    """
    if like is None:
        first = folder_of_outline(folder, outline_of_options(options))
    else:
        first = folder_like(folder, like, _speed(options))
    write_folder(folder, first.texts)
    return first


def _speed(options: Mapping[str, str | int]) -> float | None:
    """Return the speed among the options, m/s."""
    try:
        speed = parse_quantity(options["speed"], "m/s") if "speed" in options else None
    except ValueError as error:
        raise ConfigError(f"--speed: {error}") from None
    if speed is not None and not 0.05 <= speed <= 50.0:
        raise ConfigError(f"--speed: must be from 0.05 to 50 m/s, got {options['speed']!r}")
    return speed


def sanity(first: FirstFolder) -> tuple[list[SanityRow], list[str]]:
    """Return the properties of the vehicle with usual values, and notes on implausible ones."""
    return [*sanity_rows(first.vehicle, first.spiral)], [*sanity_notes(first.vehicle, first.spiral)]


@checked
def vehicle_from_geometry(
    name: str,
    mass: float | str,
    size: Mapping[str, Any],
    geometry: Mapping[str, Any],
    file: str | Path | None = None,
) -> str:
    """Return a vehicle file from a drawing: inertia, added mass and 22 coefficients, with their uncertainties.

    Parameters
    ----------
    name : str
    mass : float or str
        Mass with all water inside, kg or with a unit.
    size : mapping
        Keys of `vehicle.size`: ``length``, ``diameter``, optionally ``density``; m and kg/m^3, or with units.
    geometry : mapping
        Keys of `vehicle.geometry`.
    file : str or pathlib.Path, optional
        File to write; an existing file is replaced. Default: none.

    Returns
    -------
    str
        Text of the vehicle file. Each derived value has its standard deviation, the number of its equation in the
        theory, and a source.

    Raises
    ------
    ConfigError
        With all mistakes.
    FileError
        If writing fails.

    Examples
    --------
    >>> hull = {"type": "nose_cylinder_tail", "nose": "0.25 m", "tail": "0.5 m"}
    >>> fins = {"position": "1.9 m", "span": "0.1 m", "area": "80 cm^2"}
    >>> size = {"length": "2 m", "diameter": "0.2 m"}
    >>> text = auvid.vehicle_from_geometry("mine", "53 kg", size, {"hull": hull, "fins": fins}, "mine.yaml")
    >>> auvid.load_experiment("spiral", "vehicle=mine.yaml", "identification.prior=geometry").vehicle.name
    'mine'
    """
    text = derived_vehicle_yaml(parse_drawing({"name": name, "mass": mass, "size": size, "geometry": geometry}))
    if file is not None:
        write_text(Path(file), text)
    return text
