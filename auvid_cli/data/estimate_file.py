"""estimates/<filter>.h5: reading and writing an Estimate."""

from pathlib import Path

import h5py
import numpy as np

from auvid_cli.config.load import dump_experiment, parse_experiment
from auvid_cli.data.dataset import SENSORS
from auvid_cli.data.estimate import Estimate, Innovations
from auvid_cli.data.netcdf import (
    new_file,
    open_file,
    read_array,
    read_attribute,
    read_names,
    subgroups,
    write_dimension,
    write_variable,
)


def write_estimate(path: Path, estimate: Estimate) -> None:
    """Write an estimate whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    experiment = estimate.experiment
    attributes = {
        "filter": estimate.filter,
        "status": estimate.status,
        "cpu_time_s": estimate.cpu_time,
        "wall_time_s": estimate.wall_time,
        "dataset_sha256": estimate.dataset_sha256,
    }
    with new_file(path, "estimate", dump_experiment(experiment), experiment.seed, **attributes) as file:
        write_dimension(file, "time", estimate.time, "time after each event", "s")
        write_dimension(file, "state", np.array(estimate.state), "component of the augmented state")
        write_dimension(file, "state_of_column", np.array(estimate.state), "the same, for the covariance")
        write_variable(file, "unit", np.array(estimate.unit), ("state",), "unit of each component of the state")
        both = ("time", "state")
        write_variable(file, "mean", estimate.mean, both, "posterior mean; units in `unit`")
        write_variable(file, "standard_deviation", estimate.standard_deviation, both, "posterior standard deviation")
        square = ("state", "state_of_column")
        write_variable(file, "covariance", estimate.covariance, square, "posterior covariance at the last time")
        write_dimension(file, "held", np.array(list(estimate.held), dtype=object), "coefficients not estimated")
        held = np.array(list(estimate.held.values()), dtype=np.float64)
        write_variable(file, "held_value", held, ("held",), "value at which each was held, SI")
        for name, innovations in estimate.innovations.items():
            _write_innovations(file.create_group(f"innovations/{name}"), name, innovations)


def _write_innovations(group: h5py.Group, name: str, innovations: Innovations) -> None:
    unit = SENSORS[name][0].unit
    symbols = np.array([quantity.symbol for quantity in SENSORS[name]])
    write_dimension(group, "time", innovations.time, "time of measurement", "s")
    write_dimension(group, "component", symbols, "measured component")
    both = ("time", "component")
    write_variable(group, "innovation", innovations.innovation, both, "measured less predicted", unit)
    write_variable(group, "variance", innovations.variance, both, "variance of the innovation", f"({unit})^2")
    stated = "stated standard deviation of the noise"
    write_variable(group, "standard_deviation", innovations.standard_deviation, ("component",), stated, unit)
    write_variable(group, "nis", innovations.nis, ("time",), "normalised innovation squared", "1")


def read_estimate(path: Path) -> Estimate:
    """Read an estimate.

    Raises
    ------
    FileError
        If it is missing, damaged, foreign or of a newer schema.
    """
    with open_file(path, "estimate") as file:
        return Estimate(
            filter=read_attribute(file, "filter"),
            experiment=parse_experiment(read_attribute(file, "settings"), f"{path} (settings)"),
            state=read_names(file, "state"),
            unit=read_names(file, "unit"),
            time=read_array(file, "time"),
            mean=read_array(file, "mean"),
            standard_deviation=read_array(file, "standard_deviation"),
            covariance=read_array(file, "covariance"),
            innovations={name: _read_innovations(group) for name, group in subgroups(file, "innovations").items()},
            held=dict(zip(read_names(file, "held"), read_array(file, "held_value").tolist(), strict=True)),
            status=read_attribute(file, "status"),
            cpu_time=float(read_attribute(file, "cpu_time_s")),
            wall_time=float(read_attribute(file, "wall_time_s")),
            dataset_sha256=read_attribute(file, "dataset_sha256"),
        )


def _read_innovations(group: h5py.Group) -> Innovations:
    return Innovations(
        read_array(group, "time"),
        read_array(group, "innovation"),
        read_array(group, "variance"),
        read_array(group, "nis"),
        read_array(group, "standard_deviation"),
    )
