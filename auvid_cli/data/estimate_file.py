"""Write, read and check ``estimates/<filter>.h5``."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Annotated

import h5py
import numpy as np
from pydantic import Field

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.data import netcdf
from auvid_cli.data.array_checks import check_finite, check_sensor, check_shapes
from auvid_cli.data.estimate import Array, Estimate, EstimateChunk, EstimateHeader, Outcome
from auvid_cli.data.faults import ConsideredErrors, Fault, FaultTest
from auvid_cli.data.files import replacing
from auvid_cli.data.hdf5 import READ_ERRORS, trust
from auvid_cli.data.innovations import (
    N_LAGS,
    NIS_WINDOW,
    Autocorrelation,
    Innovations,
    InnovationStatistics,
    InnovationSums,
)
from auvid_cli.errors import InvalidDataError
from auvid_cli.text import one_line
from auvid_cli.vehicle.parameters import SENSORS

# Longer estimates, and innovations of a sensor, are thinned to about this many rows.
MAX_ROWS = 50_000
# Columns of the group of faults.
_FAULT_COLUMNS: tuple[tuple[str, type, str], ...] = (
    ("unit", object, "unit of the size"),
    ("size", float, "most likely size if there is no other fault"),
    ("standard_deviation", float, "standard deviation of the size"),
    ("coefficient", object, "coefficient that the fault biases most"),
    ("susceptibility", float, "bias of that coefficient by a fault of one standard deviation, in its own"),
    ("tolerance", float, "standard deviation of the size before any data; 0 without one"),
    ("significance", float, "size in the standard deviation that data and tolerances allow"),
    ("rank", int, "place among the faults that are needed to explain the data; 0 for the others"),
    ("alternatives", object, "other faults that these data cannot tell from it"),
    ("moved", object, "coefficients that it moves by more than their total standard deviation"),
)


class EstimateWriter:
    """Writes an estimate chunk by chunk; see `new_estimate`."""

    def __init__(self, file: h5py.File) -> None:
        self._file = file

    def append(self, chunk: EstimateChunk) -> None:
        """Append events."""
        for name in ("time", "mean", "standard_deviation"):
            netcdf.append(self._file, name, getattr(chunk, name))
        for sensor, innovations in chunk.innovations.items():
            group = self._file.require_group(f"innovations/{sensor}")
            if "time" not in group:
                _prepare_innovations(group, sensor, innovations)
            for name in ("time", "innovation", "variance", "nis"):
                netcdf.append(group, name, getattr(innovations, name))
            if innovations.weight is not None:
                netcdf.append(group, "weight", innovations.weight)

    def finish(self, outcome: Outcome) -> None:
        """Write the outcome of the run."""
        square = ("state", "state_of_column")
        netcdf.write_variable(
            self._file, "covariance", outcome.covariance, square, "posterior covariance at the last time"
        )
        if outcome.corrected:
            _write_corrected(self._file.create_group("corrected"), outcome.corrected)
        if outcome.considered is not None:
            _write_considered(self._file.create_group("considered"), outcome.considered)
        for sensor, statistics in outcome.explained.items():
            _write_statistics(self._file.create_group(f"explained/{sensor}"), statistics)
        if outcome.faults:
            _write_faults(self._file.create_group("faults"), outcome.faults)
        times = {"cpu_time_s": outcome.cpu_time, "wall_time_s": outcome.wall_time}
        self._file.attrs.update({"status": outcome.status, "steps": outcome.steps} | times)
        if outcome.note:
            self._file.attrs["note"] = outcome.note

    def read_back(self) -> Estimate:
        """Return the estimate as `read_estimate` will; raise an InvalidDataError if that would refuse it."""
        self._file.flush()
        try:
            return _read(self._file, "settings", MAX_ROWS)
        except READ_ERRORS as error:
            raise InvalidDataError(one_line(str(error))) from error


@contextmanager
def new_estimate(path: Path, header: EstimateHeader) -> Iterator[EstimateWriter]:
    """Create the file of an estimate, see `netcdf.new_file`; raise a FileError if it cannot be written."""
    experiment = header.experiment
    attributes = {"filter": header.filter, "dataset_sha256": header.dataset_sha256}
    with netcdf.new_file(path, "estimate", dump_experiment(experiment), experiment.seed, **attributes) as file:
        netcdf.write_dimension(file, "state", np.array(header.state), "component of the augmented state")
        netcdf.write_dimension(
            file, "state_of_column", np.array(header.state), "component of the augmented state, for the covariance"
        )
        netcdf.write_variable(file, "unit", np.array(header.unit), ("state",), "unit of each component of the state")
        netcdf.write_dimension(file, "held", np.array(list(header.held), dtype=object), "coefficients not estimated")
        held = np.array(list(header.held.values()), dtype=np.float64)
        netcdf.write_variable(file, "held_value", held, ("held",), "value at which each was held, SI")
        n, both = len(header.state), ("time", "state")
        netcdf.write_growing(file, "time", (), ("time",), "time after each event", "s")
        netcdf.write_growing(file, "mean", (n,), both, "posterior mean; units in `unit`")
        netcdf.write_growing(file, "standard_deviation", (n,), both, "posterior standard deviation")
        yield EstimateWriter(file)


def record_estimate(
    path: Path,
    header: EstimateHeader,
    run: Callable[[Callable[[EstimateChunk], None]], Outcome],
    watch: Callable[[EstimateChunk], None] = lambda chunk: None,
) -> Estimate:
    """Write an estimate while its filter runs, and read it back.

    Parameters
    ----------
    path : pathlib.Path
    header : EstimateHeader
    run : callable
        Runs the filter, calls its argument with each chunk, and returns the outcome.
    watch : callable
        Called with each chunk after it is written.
    """
    with new_estimate(path, header) as writer:

        def receive(chunk: EstimateChunk) -> None:
            writer.append(chunk)
            watch(chunk)

        writer.finish(run(receive))
        return writer.read_back()


def write_estimate(path: Path, estimate: Estimate) -> None:
    """Write an estimate completely or not at all; raise a FileError if the file cannot be written."""
    with new_estimate(path, estimate) as writer:
        writer.append(estimate)
        writer.finish(estimate)
        writer.read_back()


def _prepare_innovations(group: h5py.Group, sensor: str, innovations: Innovations) -> None:
    unit, symbols = SENSORS[sensor][0].unit, [quantity.symbol for quantity in SENSORS[sensor]]
    netcdf.write_dimension(group, "component", np.array(symbols), "measured component")
    meaning = "stated standard deviation of the noise"
    netcdf.write_variable(group, "standard_deviation", innovations.standard_deviation, ("component",), meaning, unit)
    n, both = len(symbols), ("time", "component")
    netcdf.write_growing(group, "time", (), ("time",), "time of measurement", "s")
    netcdf.write_growing(group, "innovation", (n,), both, "measured less predicted", unit)
    netcdf.write_growing(group, "variance", (n,), both, "variance of the innovation", f"({unit})^2")
    netcdf.write_growing(group, "nis", (), ("time",), "normalised innovation squared", "1")
    if innovations.weight is not None:
        netcdf.write_growing(group, "weight", (n,), both, "weight in the fit", "1")


def _write_corrected(group: h5py.Group, corrected: dict[str, float]) -> None:
    netcdf.write_dimension(
        group, "constant_state", np.array(list(corrected), dtype=object), "component that does not move"
    )
    meaning = "standard deviation corrected for autocorrelated residuals, SI"
    values = np.array(list(corrected.values()), dtype=np.float64)
    netcdf.write_variable(group, "standard_deviation", values, ("constant_state",), meaning)


def _read_corrected(group: h5py.Group) -> dict[str, float]:
    symbols, values = netcdf.read_names(group, "constant_state"), netcdf.read_array(group, "standard_deviation")
    check_shapes("/corrected", (values, (len(symbols),)))
    return dict(zip(symbols, values.tolist(), strict=True))


def _write_considered(group: h5py.Group, considered: ConsideredErrors) -> None:
    texts = np.array([str(fault) for fault in considered.faults], dtype=object)
    netcdf.write_dimension(group, "error", texts, "known quantity that is not estimated")
    netcdf.write_dimension(group, "error_of_column", texts, "known quantity, for the covariance")
    rows = np.arange(len(considered.inflation))
    netcdf.write_dimension(group, "constant_state", rows, "row of the augmented state")
    netcdf.write_variable(group, "unit", np.array(considered.units, dtype=object), ("error",), "unit, SI")
    meaning = "second moments of the errors, SI"
    netcdf.write_variable(group, "covariance", considered.covariance, ("error", "error_of_column"), meaning)
    meaning = "error of the state, true less estimated, per unit of each"
    netcdf.write_variable(group, "effect", considered.effect, ("constant_state", "error"), meaning)
    meaning = "factor of the standard deviation by autocorrelated residuals"
    netcdf.write_variable(group, "inflation", considered.inflation, ("constant_state",), meaning)


def _read_considered(group: h5py.Group) -> ConsideredErrors:
    texts, units = netcdf.read_names(group, "error"), netcdf.read_names(group, "unit")
    covariance, effect = (netcdf.read_array(group, name, ndim=2) for name in ("covariance", "effect"))
    inflation = netcdf.read_array(group, "inflation")
    return ConsideredErrors(tuple(map(Fault.parse, texts)), units, covariance, effect, inflation)


def add_considered(path: Path, estimate: Estimate) -> None:
    """Add the considered errors of an estimate to its file, completely or not at all."""
    if estimate.considered is None:
        return
    with replacing(path) as temporary:
        shutil.copyfile(path, temporary)
        with h5py.File(temporary, "r+") as file:
            _write_considered(file.create_group("considered"), estimate.considered)
    trust(path)


# Fields of `InnovationSums` that are arrays by window, and those that are numbers.
_OF_WINDOWS = {"squares": "sum of the NIS", "components": "number of components used"}
_OF_ALL = "start", "measurements", "rejected"


def _write_statistics(group: h5py.Group, statistics: InnovationStatistics) -> None:
    sums, (correlation, samples) = statistics
    netcdf.write_dimension(group, "window", np.arange(sums.squares.size), f"window of {NIS_WINDOW:g} s")
    netcdf.write_dimension(group, "component", np.arange(samples.size), "measured component")
    netcdf.write_dimension(group, "lag", 1 + np.arange(correlation.shape[1]), "lag in used samples")
    for name, meaning in _OF_WINDOWS.items():
        netcdf.write_variable(group, name, getattr(sums, name), ("window",), meaning)
    netcdf.write_variable(group, "correlation", correlation, ("component", "lag"), "autocorrelation")
    netcdf.write_variable(group, "samples", samples, ("component",), "number of samples; 0 if there are too few")
    netcdf.write_dimension(group, "sum", np.array(_OF_ALL, dtype=object), "of all windows")
    of_all = np.array([getattr(sums, name) for name in _OF_ALL], dtype=np.float64)
    netcdf.write_variable(group, "value", of_all, ("sum",), "start of the first window in s, or a number")


def _read_statistics(sensor: str, group: h5py.Group) -> InnovationStatistics:
    squares, components, samples, of_all = (
        netcdf.read_array(group, name) for name in (*_OF_WINDOWS, "samples", "value")
    )
    correlation = netcdf.read_array(group, "correlation", ndim=2)
    where = f"/explained/{sensor}"
    check_shapes(where, (components, squares.shape), (correlation, (samples.size, N_LAGS)), (of_all, (len(_OF_ALL),)))
    check_finite(where, squares, components, correlation, samples, of_all)
    start, measurements, rejected = of_all.tolist()
    sums = InnovationSums(start, squares, components, int(measurements), int(rejected))
    return InnovationStatistics(sums, Autocorrelation(correlation, samples))


def _write_faults(group: h5py.Group, faults: tuple[FaultTest, ...]) -> None:
    rows = [test.row() for test in faults]
    texts = np.array([row[0] for row in rows], dtype=object)
    netcdf.write_dimension(group, "fault", texts, "possible fault of the data or the model")
    for column, (name, kind, meaning) in enumerate(_FAULT_COLUMNS, 1):
        values = np.array([row[column] for row in rows], dtype=kind)
        netcdf.write_variable(group, name, values, ("fault",), meaning)


def _read_faults(group: h5py.Group) -> tuple[FaultTest, ...]:
    columns = [
        netcdf.read_names(group, name) if kind is object else map(kind, netcdf.read_array(group, name).tolist())
        for name, kind, _ in _FAULT_COLUMNS
        if name in group
    ]
    try:
        rows = zip(netcdf.read_names(group, "fault"), *columns, strict=True)
        return tuple(FaultTest.from_row(*row) for row in rows)
    except ValueError:
        raise ValueError("/faults has columns of different lengths") from None


class _Attributes(netcdf.FileAttributes):
    filter: FilterName
    settings: str
    status: Annotated[str, Field(pattern=r"^(completed|(diverged at t = \S+ s|unconverged): [ -~]+)$", max_length=1000)]
    note: Annotated[str, Field(pattern=r"^[ -~]*$", max_length=1000)] = ""
    steps: Annotated[int, Field(ge=0)]
    cpu_time_s: Annotated[float, Field(ge=0)]
    wall_time_s: Annotated[float, Field(ge=0)]
    dataset_sha256: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")]


def read_estimate(path: Path, max_rows: int = MAX_ROWS) -> Estimate:
    """Read an estimate, thinned to about `max_rows` events and innovations of each sensor.

    Raises
    ------
    FileError
        If the file is missing, damaged, of another program or a newer schema, or has impossible values.
    """
    with netcdf.open_file(path, "estimate") as file:
        return _read(file, f"{path} (settings)", max_rows)


def _read(file: h5py.File, settings_name: str, max_rows: int) -> Estimate:
    attributes = netcdf.read_attributes(file, _Attributes)
    every = 1 + netcdf.count_rows(file, "time") // max_rows
    estimate = Estimate(
        filter=attributes.filter.value,
        experiment=parse_run(attributes.settings, settings_name),
        state=netcdf.read_names(file, "state"),
        unit=netcdf.read_names(file, "unit"),
        time=netcdf.read_array(file, "time", every),
        mean=netcdf.read_array(file, "mean", every, ndim=2),
        standard_deviation=netcdf.read_array(file, "standard_deviation", every, ndim=2),
        covariance=netcdf.read_array(file, "covariance", ndim=2),
        innovations={
            name: _read_innovations(group, name, attributes.filter, max_rows)
            for name, group in netcdf.subgroups(file, "innovations").items()
        },
        held=dict(zip(netcdf.read_names(file, "held"), netcdf.read_array(file, "held_value").tolist(), strict=True)),
        status=attributes.status,
        note=attributes.note,
        steps=attributes.steps,
        cpu_time=attributes.cpu_time_s,
        wall_time=attributes.wall_time_s,
        dataset_sha256=attributes.dataset_sha256,
        faults=_read_faults(netcdf.subgroup(file, "faults")) if "faults" in file else (),
        considered=_read_considered(netcdf.subgroup(file, "considered")) if "considered" in file else None,
        corrected=_read_corrected(netcdf.subgroup(file, "corrected")) if "corrected" in file else {},
        explained={name: _read_statistics(name, group) for name, group in netcdf.subgroups(file, "explained").items()}
        if "explained" in file
        else {},
    )
    estimate.validate()
    return estimate


def read_reference(path: Path, estimate: Estimate) -> Estimate | None:
    """Read the smoother's estimate of the same data from the folder of another estimate; None if there is none."""
    judge = path.with_name(f"{JUDGE.value}.h5")
    if judge == path or not os.path.lexists(judge):
        return None
    reference = read_estimate(judge)
    return reference if reference.dataset_sha256 == estimate.dataset_sha256 else None


def _read_innovations(group: h5py.Group, sensor: str, filter_name: FilterName, max_rows: int) -> Innovations:
    check_sensor(sensor)
    n_rows, deviation = netcdf.count_rows(group, "time"), netcdf.read_array(group, "standard_deviation")
    every = 1 + n_rows // max_rows

    def innovations(read: Callable[[str, int], Array]) -> Innovations:
        weight = read("weight", 2) if "weight" in group else None
        rows = read("time", 1), read("innovation", 2), read("variance", 2), read("nis", 1)
        innovations = Innovations(*rows, deviation, weight=weight)
        innovations.check(sensor, filter_name.is_free_run_fit)
        return innovations

    def block(first: int) -> Innovations:
        return innovations(lambda name, ndim: netcdf.read_rows(group, name, first, first + max_rows, ndim))

    thinned = innovations(lambda name, ndim: netcdf.read_array(group, name, every, ndim))
    if every == 1:
        return thinned
    start = float(netcdf.read_rows(group, "time", 0, 1)[0])
    of_blocks = (block(first).statistics(start) for first in range(0, n_rows, max_rows))
    return replace(thinned, all_statistics=reduce(InnovationStatistics.plus, of_blocks))
