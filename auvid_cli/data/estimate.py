"""Estimate of a filter: states over time, innovations, outcome."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic_core import core_schema

from auvid_cli.config.enums import FilterName
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import (
    ERROR_STATES,
    EXCESS_BUOYANCY,
    FIN_TRIMS,
    FURTHER_STATES,
    THRUST_SCALE,
    TRIM_MOMENT,
)
from auvid_cli.data.faults import FaultTest
from auvid_cli.vehicle.actuators import ActuatorErrors
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.matrices import Ballast
from auvid_cli.vehicle.parameters import MOTION, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Array = NDArray[np.float64]

_MOVING = *MOTION, *(state.quantity for state in FURTHER_STATES)
# Units of all states except coefficients, by symbol.
STATES = {quantity.symbol: quantity.unit for quantity in (*_MOVING, *ERROR_STATES)}
NIS_WINDOW = 20.0  # s
N_LAGS = 20
_MIN_SAMPLES = 50  # of an autocorrelation


class InnovationSums(NamedTuple):
    """Sums over all innovations of a sensor.

    Attributes
    ----------
    start : float
        Time of the first, s.
    squares, components : ndarray, shape (k,)
        Sum of the NIS, and number of components used, in each `NIS_WINDOW` from `start` on.
    measurements : int
        Number of measurements used.
    rejected : int
        Number of components beyond the gate, or with a weight below 0.5.
    """

    start: float
    squares: Array
    components: Array
    measurements: int
    rejected: int

    @property
    def mean_nis(self) -> float:
        """Return the normalised innovation squared per component; NaN if none was used."""
        components = float(self.components.sum())
        return float(self.squares.sum()) / components if components else float("nan")

    def plus(self, other: "InnovationSums") -> "InnovationSums":
        """Return the sums including later innovations, with windows from the same start."""
        size = max(self.squares.size, other.squares.size)
        squares, components = np.zeros(size), np.zeros(size)
        for part in (self, other):
            squares[: part.squares.size] += part.squares
            components[: part.components.size] += part.components
        measurements, rejected = self.measurements + other.measurements, self.rejected + other.rejected
        return InnovationSums(self.start, squares, components, measurements, rejected)


class Autocorrelation(NamedTuple):
    """Autocorrelation of the normalised innovations of a sensor.

    Attributes
    ----------
    correlation : ndarray, shape (c, N_LAGS)
        By component, at lags of 1 to `N_LAGS` used samples.
    samples : ndarray, shape (c,)
        Number of samples; 0 if there are too few.
    """

    correlation: Array
    samples: Array

    def plus(self, other: "Autocorrelation") -> "Autocorrelation":
        """Return the autocorrelation including later innovations, without products across the boundary."""
        samples = self.samples + other.samples
        total = self.correlation * self.samples[:, None] + other.correlation * other.samples[:, None]
        return Autocorrelation(total / np.maximum(samples, 1.0)[:, None], samples)


@dataclass(frozen=True)
class Innovations:
    """Innovations of one sensor.

    Attributes
    ----------
    time : ndarray, shape (k,)
    innovation, variance : ndarray, shape (k, c)
        SI; NaN where a component is missing or the filter had ended. Where the gate rejected a component, or its
        weight is below 0.5, only the variance is NaN.
    nis : ndarray, shape (k,)
        Normalised innovation squared.
    standard_deviation : ndarray, shape (c,)
        Measurement noise assumed by the filter.
    all_sums : InnovationSums or None
        Over all innovations, if these are thinned.
    all_autocorrelation : Autocorrelation or None
        Of all innovations, if these are thinned.
    weight : ndarray, shape (k, c), or None
        Weight of each component in a robust fit; 1 where missing.
    """

    time: Array
    innovation: Array
    variance: Array
    nis: Array
    standard_deviation: Array
    all_sums: InnovationSums | None = None
    all_autocorrelation: Autocorrelation | None = None
    weight: Array | None = None

    def sums(self, start: float | None = None) -> InnovationSums:
        """Return sums over all innovations, also those that were thinned out."""
        if self.all_sums is not None:
            return self.all_sums
        start = start if start is not None else float(self.time[0]) if self.time.size else 0.0
        used = self.used().sum(axis=1)
        window = ((self.time - start) // NIS_WINDOW).astype(int)
        squares, components = (np.bincount(window, w).astype(np.float64) for w in (np.nan_to_num(self.nis), used))
        rejected = int((np.isfinite(self.innovation) & ~self.used()).sum())
        return InnovationSums(start, squares, components, int(np.isfinite(self.nis).sum()), rejected)

    @cached_property
    def autocorrelation(self) -> Autocorrelation:
        """Return the autocorrelation of all innovations, also those that were thinned out."""
        if self.all_autocorrelation is not None:
            return self.all_autocorrelation
        n_components = self.innovation.shape[1]
        correlation, samples = np.zeros((n_components, N_LAGS)), np.zeros(n_components)
        # The variance of a residual of a fit may be 0.
        for c, used in enumerate((np.isfinite(self.innovation) & (self.variance > 0.0)).T):
            values = self.innovation[used, c] / np.sqrt(self.variance[used, c])
            if values.size >= _MIN_SAMPLES and values.std() > 0.0:
                centred = values - values.mean()
                products = [float(centred[lag:] @ centred[:-lag]) for lag in range(1, N_LAGS + 1)]
                correlation[c], samples[c] = np.array(products) / float(centred @ centred), values.size
        return Autocorrelation(correlation, samples)

    def mean_weight(self) -> float | None:
        """Return the mean weight of the measured components; None without weights."""
        if self.weight is None or not np.isfinite(self.innovation).any():
            return None
        return float(self.weight[np.isfinite(self.innovation)].mean())

    def used(self) -> NDArray[np.bool_]:
        """Whether the filter used each component, shape (k, c)."""
        return np.isfinite(self.variance)

    @classmethod
    def joined(cls, chunks: Sequence["Innovations"]) -> "Innovations":
        """Join chunks in time order."""
        weights = [chunk.weight for chunk in chunks if chunk.weight is not None]
        return cls(
            time=np.concatenate([chunk.time for chunk in chunks]),
            innovation=np.concatenate([chunk.innovation for chunk in chunks]),
            variance=np.concatenate([chunk.variance for chunk in chunks]),
            nis=np.concatenate([chunk.nis for chunk in chunks]),
            standard_deviation=chunks[0].standard_deviation,
            weight=np.concatenate(weights) if weights else None,
        )


@dataclass(frozen=True)
class EstimateHeader:
    """Properties of an estimate that are known before its filter runs; see `Estimate`."""

    filter: str
    experiment: RunSettings
    state: tuple[str, ...]
    unit: tuple[str, ...]
    held: dict[str, float]
    dataset_sha256: str

    @property
    def coefficient_set(self) -> CoefficientSet:
        """Return the coefficients of the vehicle, estimated or held."""
        return self.experiment.vehicle.coefficient_set

    @property
    def coefficient_rows(self) -> list[int]:
        """Return the indices of the coefficients in the state."""
        symbols = self.coefficient_set.symbols
        return [row for row, symbol in enumerate(self.state) if symbol in symbols]

    @property
    def in_one_batch(self) -> bool:
        """Whether all data were fitted at once, instead of sequentially."""
        return FilterName(self.filter).in_one_batch

    @property
    def is_free_run_fit(self) -> bool:
        """Whether it is a fit of a motion without process noise."""
        return FilterName(self.filter).is_free_run_fit


@dataclass(frozen=True)
class EstimateChunk:
    """Consecutive events of a filter's run; every chunk has the innovations of every sensor. See `Estimate`."""

    time: Array
    mean: Array
    standard_deviation: Array
    innovations: dict[str, Innovations]


@dataclass(frozen=True)
class EstimateHistory(EstimateChunk):
    """Part of an estimate that a figure shows; small, because it may be sent to another process."""

    filter: str
    state: tuple[str, ...]
    completed: bool


@dataclass(frozen=True)
class Outcome:
    """Properties of an estimate that are known after its filter has run; see `Estimate`."""

    status: str
    covariance: Array
    steps: int
    cpu_time: float
    wall_time: float
    faults: tuple[FaultTest, ...] = field(default=(), kw_only=True)
    corrected: dict[str, float] = field(default_factory=dict, kw_only=True)


@dataclass(frozen=True)
class Estimate(EstimateHeader, EstimateChunk, Outcome):
    """Augmented state over time of one filter; ends early if the filter diverged.

    Attributes
    ----------
    filter : str
        "ekf", "ckf", "tukf", "ukf", "smoother" or "output_error".
    status : str
        "completed", "diverged at t = ...: REASON", or "unconverged: REASON".
    state, unit : tuple of str
        Symbols and units of the augmented state: estimated coefficients, constant sensor errors, the nine motion
        states, varying sensor errors.
    time : ndarray, shape (n,)
        s, after each event.
    mean, standard_deviation : ndarray, shape (n, len(state))
        SI; the standard deviation is nominal, for white residuals.
    covariance : ndarray, shape (len(state), len(state))
        At the last time, SI; nominal.
    corrected : dict of float
        Standard deviation of each constant state of a completed batch estimate, corrected for autocorrelated
        residuals, SI; at least the nominal one.
    innovations : dict of Innovations
        By sensor.
    held : dict of float
        Coefficients that are not estimated, SI.
    experiment : RunSettings
        Settings of the run.
    steps : int
        Number of events without an error.
    cpu_time, wall_time : float
        Of the filter alone, s.
    faults : tuple of FaultTest
        Of an estimator that tests for faults.
    dataset_sha256 : str
        Of the file of its dataset; empty if the dataset was in memory.
    """

    @classmethod
    def __get_pydantic_core_schema__(cls, source: object, handler: object) -> core_schema.CoreSchema:
        """Return the schema that accepts any instance."""
        return core_schema.is_instance_schema(cls)

    def __repr__(self) -> str:
        states, end = len(self.state), f"t = {self.time[-1]:g} s" if self.time.size else "no event"
        return f"<Estimate of {self.experiment.name!r} by {self.filter!r}: {states} states to {end}, {self.status}>"

    @classmethod
    def of(cls, header: EstimateHeader, chunks: Sequence[EstimateChunk], outcome: Outcome) -> "Estimate":
        """Join the chunks of a run."""
        innovations = {
            sensor: Innovations.joined([chunk.innovations[sensor] for chunk in chunks])
            for sensor in chunks[0].innovations
        }
        return cls(
            **vars(outcome),
            time=np.concatenate([chunk.time for chunk in chunks]),
            mean=np.concatenate([chunk.mean for chunk in chunks]),
            standard_deviation=np.concatenate([chunk.standard_deviation for chunk in chunks]),
            innovations=innovations,
            **vars(header),
        )

    @property
    def completed(self) -> bool:
        """Whether the filter reached the end of the data."""
        return self.status == "completed"

    def history(self, symbols: Sequence[str], with_innovations: bool = False) -> "EstimateHistory":
        """Return some components of the state over time, with or without the innovations."""
        kept = [i for i, symbol in enumerate(self.state) if symbol in symbols]
        return EstimateHistory(
            self.time,
            self.mean[:, kept],
            self.standard_deviation[:, kept],
            self.innovations if with_innovations else {},
            self.filter,
            tuple(self.state[i] for i in kept),
            self.completed,
        )

    def final_actuators(self) -> ActuatorErrors:
        """Return the actuator errors at the last time; none where they are not estimated."""
        return ActuatorErrors(1.0 + self._final(THRUST_SCALE), *map(self._final, FIN_TRIMS))

    def final_ballast(self) -> Ballast:
        """Return the excess buoyancy and trim moment at the last time; 0 where they are not estimated."""
        return Ballast(self._final(EXCESS_BUOYANCY), self._final(TRIM_MOMENT))

    def _final(self, error: Quantity) -> float:
        return float(self.mean[-1, self.state.index(error.symbol)]) if error.symbol in self.state else 0.0

    def final_coefficients(self) -> dict[str, float]:
        """Return all coefficients at the last time, estimated or held, SI."""
        return self.held | {self.state[row]: float(self.mean[-1, row]) for row in self.coefficient_rows}

    def final_deviations(self) -> dict[str, float]:
        """Return the standard deviation of each state at the last time, SI: corrected if known, otherwise nominal."""
        return dict(zip(self.state, self.standard_deviation[-1].tolist(), strict=True)) | self.corrected

    def final_covariance(self) -> Array:
        """Return the covariance at the last time, SI, scaled to the corrected standard deviations."""
        ratio = np.ones(len(self.state))
        for symbol, corrected in self.corrected.items():
            row = self.state.index(symbol)
            if np.isfinite(corrected):
                ratio[row] = corrected / float(self.standard_deviation[-1, row])
        return self.covariance * np.outer(ratio, ratio)

    def to_pandas(self) -> "dict[str, pd.DataFrame]":
        """Return tables.

        Returns
        -------
        dict of pandas.DataFrame
            ``coefficients``: all coefficients at the last time, SI, with a row for each symbol and the columns
            ``value``, ``standard_deviation`` (NaN if held), ``corrected_standard_deviation`` (NaN if unknown),
            ``unit`` and ``estimated``. ``mean`` and ``standard_deviation``: the state over time, s, with a column for
            each symbol; ``attrs["units"]`` has their units.
        """
        from auvid_cli.data.interop import estimate_frames

        return estimate_frames(self)

    def to_xarray(self) -> "xr.DataTree":
        """Return a tree of the state over time and the innovations.

        Returns
        -------
        xarray.DataTree
            ``state`` has ``mean`` and ``standard_deviation`` by time and state, ``covariance`` at the last time, and
            the ``unit`` of each state; ``innovations/SENSOR`` has ``innovation`` and ``variance`` by time and
            component, and ``nis`` by time.

        Raises
        ------
        DataError
            If xarray is not installed.
        """
        from auvid_cli.data.interop import estimate_tree

        return estimate_tree(self)
