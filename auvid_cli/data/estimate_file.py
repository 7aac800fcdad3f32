"""estimates/<filter>.h5: measurement and writing an Estimate."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial, reduce
from pathlib import Path
from typing import Annotated

import h5py
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.data.estimate import Estimate, EstimateChunk, EstimateHeader, Outcome
from auvid_cli.data.faults import Fault, FaultTest
from auvid_cli.data.innovations import Autocorrelation, Innovations, InnovationSums
from auvid_cli.data.netcdf import (
    FileAttributes,
    append,
    count_rows,
    new_file,
    open_file,
    read_array,
    read_attributes,
    read_names,
    read_rows,
    subgroup,
    subgroups,
    write_dimension,
    write_growing,
    write_variable,
)
from auvid_cli.data.validate_records import check_estimated_states, check_innovations
from auvid_cli.vehicle.parameters import SENSORS

# Of more than so many events or measurements of a sensor, every so many are read: evenly spaced, they say the same.
_MOST_ROWS = 50_000
# Of the group of faults, besides their names.
_FAULT_COLUMNS: tuple[tuple[str, type, str], ...] = (
    ("unit", object, "unit of its size"),
    ("size", float, "how large it would be, if nothing else was wrong"),
    ("standard_deviation", float, "of its size"),
    ("coefficient", object, "the one that it moves most"),
    ("susceptibility", float, "standard deviations by which a fault of one of its own moves that"),
)


class EstimateWriter:
    """Writes an estimate chunk by chunk; see `new_estimate`."""

    def __init__(self, file: h5py.File) -> None:
        self._file = file

    def append(self, chunk: EstimateChunk) -> None:
        """Append more of the run."""
        for name in ("time", "mean", "standard_deviation"):
            append(self._file, name, getattr(chunk, name))
        for sensor, innovations in chunk.innovations.items():
            group = self._file.require_group(f"innovations/{sensor}")
            if "time" not in group:
                _prepare_innovations(group, sensor, innovations)
            for name in ("time", "innovation", "variance", "nis"):
                append(group, name, getattr(innovations, name))
            if innovations.weight is not None:
                append(group, "weight", innovations.weight)

    def finish(self, outcome: Outcome) -> None:
        """Write what is known at the end."""
        square = ("state", "state_of_column")
        write_variable(self._file, "covariance", outcome.covariance, square, "posterior covariance at the last time")
        if outcome.corrected:
            _write_corrected(self._file.create_group("corrected"), outcome.corrected)
        if outcome.faults:
            _write_faults(self._file.create_group("faults"), outcome.faults)
        self._file.attrs.update(
            {
                "status": outcome.status,
                "steps": outcome.steps,
                "cpu_time_s": outcome.cpu_time,
                "wall_time_s": outcome.wall_time,
            }
        )


@contextmanager
def new_estimate(path: Path, header: EstimateHeader) -> Iterator[EstimateWriter]:
    """Make a new file for an estimate; it gets its name when the block ends well, with the outcome written.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    experiment = header.experiment
    attributes = {"filter": header.filter, "dataset_sha256": header.dataset_sha256}
    with new_file(path, "estimate", dump_experiment(experiment), experiment.seed, **attributes) as file:
        write_dimension(file, "state", np.array(header.state), "component of the augmented state")
        write_dimension(file, "state_of_column", np.array(header.state), "the same, for the covariance")
        write_variable(file, "unit", np.array(header.unit), ("state",), "unit of each component of the state")
        write_dimension(file, "held", np.array(list(header.held), dtype=object), "coefficients not estimated")
        held = np.array(list(header.held.values()), dtype=np.float64)
        write_variable(file, "held_value", held, ("held",), "value at which each was held, SI")
        n, both = len(header.state), ("time", "state")
        write_growing(file, "time", (), ("time",), "time after each event", "s")
        write_growing(file, "mean", (n,), both, "posterior mean; units in `unit`")
        write_growing(file, "standard_deviation", (n,), both, "posterior standard deviation")
        yield EstimateWriter(file)


def record_estimate(
    path: Path,
    header: EstimateHeader,
    run: Callable[[Callable[[EstimateChunk], None]], Outcome],
    watch: Callable[[EstimateChunk], None] = lambda chunk: None,
) -> Estimate:
    """Write an estimate as it comes, and read it back, as any later step would.

    Parameters
    ----------
    path : pathlib.Path
    header : EstimateHeader
    run : callable
        Hands what comes to its argument, chunk by chunk, and returns how it ended.
    watch : callable
        Called with each chunk when it is written.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    with new_estimate(path, header) as writer:

        def receive(chunk: EstimateChunk) -> None:
            writer.append(chunk)
            watch(chunk)

        writer.finish(run(receive))
    return read_estimate(path)


def write_estimate(path: Path, estimate: Estimate) -> None:
    """Write an estimate that is in memory, whole or not at all.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    with new_estimate(path, estimate) as writer:
        writer.append(estimate)
        writer.finish(estimate)


def _prepare_innovations(group: h5py.Group, sensor: str, innovations: Innovations) -> None:
    unit, symbols = SENSORS[sensor][0].unit, [quantity.symbol for quantity in SENSORS[sensor]]
    write_dimension(group, "component", np.array(symbols), "measured component")
    meaning = "stated standard deviation of the noise"
    write_variable(group, "standard_deviation", innovations.standard_deviation, ("component",), meaning, unit)
    n, both = len(symbols), ("time", "component")
    write_growing(group, "time", (), ("time",), "time of measurement", "s")
    write_growing(group, "innovation", (n,), both, "measured less predicted", unit)
    write_growing(group, "variance", (n,), both, "variance of the innovation", f"({unit})^2")
    write_growing(group, "nis", (), ("time",), "normalised innovation squared", "1")
    if innovations.weight is not None:
        write_growing(group, "weight", (n,), both, "by how much it counts in the fit", "1")


def _write_corrected(group: h5py.Group, corrected: dict[str, float]) -> None:
    write_dimension(group, "constant_state", np.array(list(corrected), dtype=object), "component that does not move")
    meaning = "its standard deviation, with allowance for the autocorrelation of what is left unexplained, SI"
    values = np.array(list(corrected.values()), dtype=np.float64)
    write_variable(group, "standard_deviation", values, ("constant_state",), meaning)


def _read_corrected(group: h5py.Group) -> dict[str, float]:
    symbols, values = read_names(group, "constant_state"), read_array(group, "standard_deviation").tolist()
    if len(symbols) != len(values):
        raise ValueError("/corrected has columns of different lengths")
    return dict(zip(symbols, values, strict=True))


def _write_faults(group: h5py.Group, faults: tuple[FaultTest, ...]) -> None:
    def column(name: str, kind: type) -> NDArray:
        return np.array([getattr(fault, name) for fault in faults], dtype=kind)

    texts = np.array([str(test.fault) for test in faults], dtype=object)
    write_dimension(group, "fault", texts, "what may be wrong with the data or the model")
    for name, kind, meaning in _FAULT_COLUMNS:
        write_variable(group, name, column(name, kind), ("fault",), meaning)


def _read_faults(group: h5py.Group) -> tuple[FaultTest, ...]:
    columns = [
        read_names(group, name) if kind is object else read_array(group, name).tolist()
        for name, kind, _ in _FAULT_COLUMNS
    ]
    try:
        rows = zip(read_names(group, "fault"), *columns, strict=True)
        return tuple(FaultTest(Fault.parse(text), *of_test) for text, *of_test in rows)
    except ValueError:
        raise ValueError("/faults has columns of different lengths") from None


class _Attributes(FileAttributes):
    """What the root of an estimate file says of it."""

    filter: FilterName
    settings: str
    status: Annotated[str, Field(pattern=r"^(completed|(diverged at t = \S+ s|unconverged): [ -~]+)$", max_length=1000)]
    steps: Annotated[int, Field(ge=0)]
    cpu_time_s: Annotated[float, Field(ge=0)]
    wall_time_s: Annotated[float, Field(ge=0)]
    dataset_sha256: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")]


def read_estimate(path: Path) -> Estimate:
    """Read an estimate; of a very long one every k-th event and measurement, as many as an evaluation needs.

    Raises
    ------
    FileError
        If it is missing, damaged, foreign, of a newer schema, or holds what no filter can have found.
    """
    with open_file(path, "estimate") as file:
        known = read_attributes(file, _Attributes)
        every = 1 + count_rows(file, "time") // _MOST_ROWS
        estimate = Estimate(
            filter=known.filter.value,
            experiment=parse_run(known.settings, f"{path} (settings)"),
            state=read_names(file, "state"),
            unit=read_names(file, "unit"),
            time=read_array(file, "time", every),
            mean=read_array(file, "mean", every, ndim=2),
            standard_deviation=read_array(file, "standard_deviation", every, ndim=2),
            covariance=read_array(file, "covariance", ndim=2),
            innovations={
                name: _read_innovations(group, name, known.filter)
                for name, group in subgroups(file, "innovations").items()
            },
            held=dict(zip(read_names(file, "held"), read_array(file, "held_value").tolist(), strict=True)),
            status=known.status,
            steps=known.steps,
            cpu_time=known.cpu_time_s,
            wall_time=known.wall_time_s,
            dataset_sha256=known.dataset_sha256,
            faults=_read_faults(subgroup(file, "faults")) if "faults" in file else (),
            corrected=_read_corrected(subgroup(file, "corrected")) if "corrected" in file else {},
        )
        check_estimated_states(estimate)
    return estimate


def read_reference(path: Path, estimate: Estimate) -> Estimate | None:
    """Read the smoother's estimate of the same data that stands beside another one; None if there is none.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    beside = path.with_name(f"{JUDGE.value}.h5")
    if beside == path or not beside.is_file():
        return None
    reference = read_estimate(beside)
    return reference if reference.dataset_sha256 == estimate.dataset_sha256 else None


def _read_innovations(group: h5py.Group, sensor: str, filter_name: FilterName) -> Innovations:
    rows = count_rows(group, "time")
    every, deviation = 1 + rows // _MOST_ROWS, read_array(group, "standard_deviation")

    def innovations(read: Callable[[str, int], NDArray[np.float64]]) -> Innovations:
        weight = read("weight", 2) if "weight" in group else None
        rows = read("time", 1), read("innovation", 2), read("variance", 2), read("nis", 1)
        innovations = Innovations(*rows, deviation, weight=weight)
        check_innovations(sensor, innovations, filter_name)
        return innovations

    thinned = innovations(lambda name, ndim: read_array(group, name, every, ndim))
    if every == 1:
        return thinned
    start = float(read_rows(group, "time", 0, 1)[0])
    blocks = (innovations(partial(_rows_of, group, first)) for first in range(0, rows, _MOST_ROWS))
    tallies, memories = zip(*((block.sums(start), block.autocorrelation) for block in blocks), strict=True)
    return replace(
        thinned,
        all_sums=reduce(InnovationSums.plus, tallies),
        all_autocorrelation=reduce(Autocorrelation.plus, memories),
    )


def _rows_of(group: h5py.Group, first: int, name: str, ndim: int) -> NDArray[np.float64]:
    return read_rows(group, name, first, first + _MOST_ROWS, ndim)
