"""Write, read and check ``dataset.h5``."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from auvid_cli.arrays import release_memory
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.data import netcdf
from auvid_cli.data.array_checks import check_sensor
from auvid_cli.data.dataset import VECTORS, Array, Dataset, InputRecord, SensorRecord, TruthRecord, shared_clock
from auvid_cli.vehicle.parameters import (
    ALL_INPUTS,
    DISTURBANCE,
    INPUTS,
    MOTION,
    POSITION,
    PROPULSION,
    SENSORS,
    Quantity,
)

# Longer true motions are thinned to about this many samples, enough to compare and to plot.
_MAX_TRUTH = 100_000


def write_dataset(path: Path, dataset: Dataset) -> None:
    """Write a dataset completely or not at all; raise a FileError also if `read_dataset` would refuse it."""
    experiment = dataset.experiment
    with netcdf.new_file(path, "dataset", dump_experiment(experiment), experiment.seed) as file:
        # The arrays of the dataset may have changed since it was made.
        dataset.validate()
        inputs = file.create_group("inputs")
        netcdf.write_dimension(inputs, "time", dataset.inputs.time, "start of the interval in which inputs hold", "s")
        _write_table(inputs, dataset.inputs.quantities, dataset.inputs.values)
        for name, record in dataset.sensors.items():
            _write_sensor(file.create_group(f"sensors/{name}"), name, record)
        if dataset.truth is not None:
            _write_truth(file.create_group("truth"), dataset.truth, dataset.units_of_truth())


def _write_table(group: h5py.Group, quantities: Iterable[Quantity], values: Array) -> None:
    for quantity, column in zip(quantities, values.T, strict=True):
        netcdf.write_variable(group, quantity.symbol, column, ("time",), quantity.meaning, quantity.unit)
    release_memory()


def _write_sensor(group: h5py.Group, name: str, record: SensorRecord) -> None:
    quantities = SENSORS[name]
    netcdf.write_dimension(group, "time", record.time, "time of measurement", "s")
    netcdf.write_dimension(group, "component", np.array([q.symbol for q in quantities]), "measured component")
    _write_table(group, quantities, record.values)
    meaning = "stated standard deviation of the noise"
    netcdf.write_variable(
        group, "standard_deviation", record.standard_deviation, ("component",), meaning, quantities[0].unit
    )
    for vector in VECTORS:
        if any(values := getattr(record, vector.name)):
            netcdf.write_dimension(group, vector.dimension, np.array(vector.axes), vector.axes_meaning)
            netcdf.write_variable(
                group, vector.name, np.array(values), (vector.dimension,), vector.meaning, vector.unit
            )
    valid = np.isfinite(record.values).view(np.int8)
    netcdf.write_variable(group, "valid", valid, ("time", "component"), "1 where the component was measured")


def _write_truth(group: h5py.Group, truth: TruthRecord, units: list[str]) -> None:
    netcdf.write_dimension(group, "time", truth.time, "time", "s")
    for quantities, values in truth.tables:
        _write_table(group, quantities, values)
    netcdf.write_dimension(group, "coefficient", np.array([*truth.coefficients]), "hydrodynamic coefficient")
    true = np.array([*truth.coefficients.values()])
    netcdf.write_variable(group, "true_coefficient", true, ("coefficient",), "true value, SI; units in `unit`")
    netcdf.write_variable(group, "unit", np.array(units), ("coefficient",), "unit of each coefficient")


class _Attributes(netcdf.FileAttributes):
    settings: str


def read_dataset(path: Path, overrides: tuple[str, ...] = ()) -> Dataset:
    """Read a dataset; `overrides` change its settings like ``--set``.

    Raises
    ------
    FileError
        If the file is missing, damaged, of another program or a newer schema, or has impossible values.
    ConfigError
        If its settings, with the overrides, are not valid.
    """
    with netcdf.open_file(path, "dataset") as file:
        settings = netcdf.read_attributes(file, _Attributes).settings
        group = netcdf.subgroup(file, "inputs")
        # Older files have no revolutions and voltage.
        inputs = ALL_INPUTS if all(quantity.symbol in group for quantity in PROPULSION) else INPUTS
        netcdf.check_units(group, inputs)
        times = netcdf.read_array(group, "time")
        sensors: dict[str, SensorRecord] = {}
        for name, sensor_group in netcdf.subgroups(file, "sensors").items():
            clocks = times, *(record.time for record in sensors.values())
            sensors[name] = _read_sensor(sensor_group, name, clocks)
        return Dataset(
            InputRecord(times, netcdf.read_table(group, [quantity.symbol for quantity in inputs])),
            sensors,
            parse_run(settings, f"{path} (settings)", overrides),
            _read_truth(netcdf.subgroup(file, "truth")) if "truth" in file else None,
            netcdf.digest(path),
        )


def _read_sensor(group: h5py.Group, name: str, clocks: Iterable[Array]) -> SensorRecord:
    check_sensor(name)
    values = netcdf.read_table(group, [quantity.symbol for quantity in SENSORS[name]])
    netcdf.mark_missing(group, "valid", values)
    netcdf.check_units(group, SENSORS[name])
    values[~np.isfinite(values)] = np.nan
    times = shared_clock(netcdf.read_array(group, "time"), clocks)
    record = SensorRecord(times, values, netcdf.read_array(group, "standard_deviation"))
    return replace(record, **{v.name: tuple(netcdf.read_array(group, v.name)) for v in VECTORS if v.name in group})


def _read_truth(group: h5py.Group) -> TruthRecord:
    every = 1 + netcdf.count_rows(group, "time") // _MAX_TRUTH
    disturbance = [quantity.symbol for quantity in DISTURBANCE]
    return TruthRecord(
        netcdf.read_array(group, "time", every),
        netcdf.read_table(group, [quantity.symbol for quantity in MOTION], every),
        netcdf.read_table(group, [quantity.symbol for quantity in POSITION], every),
        dict(
            zip(
                netcdf.read_names(group, "coefficient"),
                netcdf.read_array(group, "true_coefficient").tolist(),
                strict=True,
            )
        ),
        netcdf.read_table(group, disturbance, every) if disturbance[0] in group else None,
    )


def holds_data(path: Path, dataset: Dataset) -> bool:
    """Whether a file has the same numbers as a dataset, whatever its settings; errors are those of `read_dataset`."""
    with netcdf.open_file(path, "dataset") as file:
        # One variable at a time, so that hours of data are not in memory twice.
        return all(
            np.array_equal(netcdf.read_array(file, name), values, equal_nan=True)
            for name, values in _variables(dataset)
        )


def _variables(dataset: Dataset) -> Iterator[tuple[str, Array]]:
    """Yield the path in the file and the values of each variable that `write_dataset` writes."""
    inputs, truth = dataset.inputs, dataset.truth
    tables = [("inputs", inputs.time, inputs.quantities, inputs.values)]
    for name, record in dataset.sensors.items():
        tables.append((f"sensors/{name}", record.time, SENSORS[name], record.values))
        yield f"sensors/{name}/standard_deviation", record.standard_deviation
    if truth is not None:
        tables += [("truth", truth.time, table, values) for table, values in truth.tables]
        yield "truth/true_coefficient", np.array([*truth.coefficients.values()])
    for group, time, quantities, values in tables:
        yield f"{group}/time", time
        for column, quantity in enumerate(quantities):
            yield f"{group}/{quantity.symbol}", values[:, column]
        release_memory()
