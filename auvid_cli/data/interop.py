"""Datasets and estimates as pandas tables and xarray trees, with the names of their files."""

from collections.abc import Sequence
from itertools import chain
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.dataset import VECTORS, Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.innovations import Innovations
from auvid_cli.errors import DataError
from auvid_cli.vehicle.parameters import SENSORS, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


class LabelledSeries(NamedTuple):
    """Quantities over time, s; `values` has shape (n, len(quantities)), SI; `meaning` describes the time."""

    time: Array
    quantities: tuple[Quantity, ...]
    values: Array
    meaning: str = "time"

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a column for each quantity; ``attrs["units"]`` has their units."""
        symbols = [quantity.symbol for quantity in self.quantities]
        return _over_time(self.time, symbols, self.values, {q.symbol: q.unit for q in self.quantities})

    def to_xarray(self) -> "xr.Dataset":
        """Return a variable for each quantity, with unit and meaning as attributes."""
        columns = zip(self.quantities, self.values.T, strict=True)
        variables = {q.symbol: ("time", column, {"long_name": q.meaning, "units": q.unit}) for q, column in columns}
        return import_xarray().Dataset(variables, {"time": _times(self.time, self.meaning)})


def import_xarray() -> ModuleType:
    """Return the module xarray; raise a DataError if it is not installed."""
    try:
        import xarray
    except ModuleNotFoundError as error:
        raise DataError(
            "to_xarray() needs the package xarray: run pip install '.[xarray]' in the clone of auvid"
        ) from error
    return xarray


def dataset_series(dataset: Dataset) -> dict[str, LabelledSeries]:
    """Return the time series of a dataset, by the group of its file."""
    series = {
        "inputs": LabelledSeries(
            dataset.inputs.time,
            dataset.inputs.quantities,
            dataset.inputs.values,
            "start of the interval in which inputs hold",
        )
    }
    for name, record in dataset.sensors.items():
        series[f"sensors/{name}"] = LabelledSeries(record.time, SENSORS[name], record.values, "time of measurement")
    if dataset.truth is not None:
        tables, values = zip(*dataset.truth.tables, strict=True)
        series["truth"] = LabelledSeries(dataset.truth.time, tuple(chain.from_iterable(tables)), np.hstack(values))
    return series


def dataset_tree(dataset: Dataset) -> "xr.DataTree":
    """Return a dataset as a tree with the groups of its file."""
    groups = {name: series.to_xarray() for name, series in dataset_series(dataset).items()}
    for name, record in dataset.sensors.items():
        attributes = {"long_name": "stated standard deviation of the noise", "units": SENSORS[name][0].unit}
        coordinates = {"component": _components(name)}
        variables: dict[str, Any] = {"standard_deviation": ("component", record.standard_deviation, attributes)}
        for vector in VECTORS:
            if any(values := getattr(record, vector.name)):
                axes = vector.dimension, list(vector.axes), {"long_name": vector.axes_meaning}
                attributes = {"long_name": vector.meaning, "units": vector.unit}
                coordinates[vector.dimension] = axes
                variables[vector.name] = vector.dimension, list(values), attributes
        groups[f"sensors/{name}"] = groups[f"sensors/{name}"].assign_coords(coordinates).assign(variables)
    if dataset.truth is not None:
        true, units = [*dataset.truth.coefficients.values()], dataset.units_of_truth()
        symbols = "coefficient", [*dataset.truth.coefficients], {"long_name": "hydrodynamic coefficient"}
        groups["truth"] = (
            groups["truth"]
            .assign_coords(coefficient=symbols, unit=("coefficient", units, {"long_name": "unit of each coefficient"}))
            .assign(true_coefficient=("coefficient", true, {"long_name": "true value, SI; units in `unit`"}))
        )
    return import_xarray().DataTree.from_dict(groups, name=dataset.experiment.name)


def estimate_frames(estimate: Estimate) -> "dict[str, pd.DataFrame]":
    """Return tables of the coefficients at the last time and of the state over time; see `Estimate.to_pandas`."""
    import pandas as pd

    values, symbols = estimate.final_coefficients(), estimate.coefficient_set.symbols
    deviations = dict(zip(estimate.state, estimate.standard_deviation[-1].tolist(), strict=True))
    coefficients = pd.DataFrame(
        {
            "value": [values[symbol] for symbol in symbols],
            "standard_deviation": [deviations.get(symbol, np.nan) for symbol in symbols],
            "corrected_standard_deviation": [estimate.corrected.get(symbol, np.nan) for symbol in symbols],
            "unit": [*estimate.coefficient_set.units.values()],
            "estimated": [symbol in deviations for symbol in symbols],
        },
        index=pd.Index(symbols, name="coefficient"),
    )
    units = dict(zip(estimate.state, estimate.unit, strict=True))
    return {
        "coefficients": coefficients,
        "mean": _over_time(estimate.time, estimate.state, estimate.mean, units),
        "standard_deviation": _over_time(estimate.time, estimate.state, estimate.standard_deviation, units),
    }


def estimate_tree(estimate: Estimate) -> "xr.DataTree":
    """Return an estimate as a tree: the state over time, and the innovations of each sensor."""
    xarray, table, square = import_xarray(), ("time", "state"), ("state", "state_of_column")
    symbols = list(estimate.state)
    state = xarray.Dataset(
        {
            "mean": (table, estimate.mean, {"long_name": "posterior mean; units in `unit`"}),
            "standard_deviation": (table, estimate.standard_deviation, {"long_name": "posterior standard deviation"}),
            "covariance": (square, estimate.covariance, {"long_name": "posterior covariance at the last time"}),
        },
        {
            "time": _times(estimate.time, "time after each event"),
            "state": symbols,
            "state_of_column": symbols,
            "unit": ("state", list(estimate.unit)),
        },
        {"filter": estimate.filter, "status": estimate.status},
    )
    groups = {
        f"innovations/{name}": _innovations(name, innovations) for name, innovations in estimate.innovations.items()
    }
    return xarray.DataTree.from_dict({"state": state, **groups}, name=estimate.filter)


def _innovations(sensor: str, innovations: Innovations) -> "xr.Dataset":
    unit, table = SENSORS[sensor][0].unit, ("time", "component")
    return import_xarray().Dataset(
        {
            "innovation": (table, innovations.innovation, {"long_name": "measured less predicted", "units": unit}),
            "variance": (table, innovations.variance, {"long_name": "its variance", "units": f"({unit})^2"}),
            "nis": ("time", innovations.nis, {"long_name": "normalised innovation squared", "units": "1"}),
        },
        {"time": _times(innovations.time, "time of measurement"), "component": _components(sensor)},
    )


def _over_time(time: Array, symbols: Sequence[str], values: Array, units: dict[str, str]) -> "pd.DataFrame":
    import pandas as pd

    frame = pd.DataFrame(values, pd.Index(time, name="time"), pd.Index(symbols))
    frame.attrs["units"] = units
    return frame


def _times(time: Array, meaning: str) -> tuple[str, Array, dict[str, str]]:
    return "time", time, {"long_name": meaning, "units": "s"}


def _components(sensor: str) -> tuple[str, list[str], dict[str, str]]:
    return "component", [quantity.symbol for quantity in SENSORS[sensor]], {"long_name": "measured component"}
