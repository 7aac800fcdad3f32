"""Estimate of a filter: states over time, innovations, outcome."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from pydantic_core import core_schema

from auvid_cli.arrays import Array
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
from auvid_cli.data.array_checks import (
    check_deviations,
    check_finite,
    check_magnitude,
    check_noise,
    check_range,
    check_shapes,
    check_times,
    check_type,
    put_arrays,
    real_array,
)
from auvid_cli.data.faults import ConsideredErrors, Contributor, FaultTest
from auvid_cli.data.innovations import Innovations, InnovationStatistics
from auvid_cli.errors import InvalidDataError
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.parameters import MOTION, MOTION_SYMBOLS, ActuatorErrors, Quantity
from auvid_cli.vehicle.rigid_body import Ballast

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_MOVING = *MOTION, *(state.quantity for state in FURTHER_STATES)
_ROUNDING = 1e-6  # of a standard deviation
_MAX_ASYMMETRY = 1e-6  # of a covariance, as a share of the standard deviations
_TYPES = {
    "filter": str,
    "experiment": RunSettings,
    "state": tuple,
    "unit": tuple,
    "held": dict,
    "dataset_sha256": str,
    "innovations": dict,
    "status": str,
    "faults": tuple,
    "corrected": dict,
    "explained": dict,
}
# Units of all states except coefficients, by symbol.
STATES = {quantity.symbol: quantity.unit for quantity in (*_MOVING, *ERROR_STATES)}


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
    considered: ConsideredErrors | None = field(default=None, kw_only=True)
    explained: dict[str, InnovationStatistics] = field(default_factory=dict, kw_only=True)
    note: str = field(default="", kw_only=True)


@dataclass(frozen=True)
class Estimate(EstimateHeader, EstimateChunk, Outcome):
    """Augmented state over time of one filter; ends early if the filter diverged.

    Attributes
    ----------
    filter : str
        "ekf", "ckf", "tukf", "ukf", "smoother" or "output_error".
    status : str
        "completed", "diverged at t = ...: REASON", or "unconverged: REASON".
    note : str
        How far an iteration was from convergence that ended where the rest no longer matters; empty otherwise.
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
        Time that the filter alone took, s.
    faults : tuple of FaultTest
        Tests for faults; empty if the estimator has none.
    considered : ConsideredErrors or None
        Errors of known quantities that are not estimated; those of the smoother for other estimators.
    explained : dict of InnovationStatistics
        Statistics, by sensor, of the innovations without the effects of the most likely errors of known quantities
        within their tolerances; empty if these explain hardly anything, or the estimator does not know them.
    dataset_sha256 : str
        Digest of the file of its dataset; empty if the dataset was in memory.
    """

    def __post_init__(self) -> None:
        put_arrays(self, "", time=1, mean=2, standard_deviation=2, covariance=2)
        for name, expected in _TYPES.items():
            check_type(name, getattr(self, name), expected)

    def validate(self) -> None:
        """Raise an InvalidDataError if states, covariance, innovations or faults are impossible.

        Called when an estimate is read, before it is written, and by the functions of the Python interface.
        """
        n, k = self.time.size, len(self.state)
        if self.considered is not None:
            check_type("/considered", self.considered, ConsideredErrors)
            self.considered.check(k)
        self._check_state()
        check_times("/time", self.time)
        if not n:
            raise InvalidDataError("/time is empty")
        shapes = (self.mean, (n, k)), (self.standard_deviation, (n, k)), (self.covariance, (k, k))
        check_shapes("/mean, /standard_deviation, /covariance", *shapes)
        check_finite("/mean", self.mean)
        check_finite("/held_value", real_array("/held_value", [*self.held.values()], 1))
        # The output-error method has infinite deviations of coefficients without information.
        is_fit = self.is_free_run_fit
        check_deviations("/standard_deviation", self.standard_deviation, is_fit)
        self._check_covariance(is_fit)
        self._check_corrected()
        if self.completed:
            check_range("/standard_deviation", self.standard_deviation)
            self._check_coefficients()
        for sensor, innovations in self.innovations.items():
            check_type(f"innovations of {sensor!r}", innovations, Innovations)
            innovations.check(sensor, is_fit)
        for sensor, statistics in self.explained.items():
            check_type(f"/explained/{sensor}", statistics, InnovationStatistics)
            if sensor not in self.innovations:
                raise InvalidDataError(f"/explained has the sensor {sensor!r} without innovations")
        for test in self.faults:
            check_type("/faults", test, FaultTest)
            where = f"/faults, {test.fault},"
            check_finite(
                where, real_array(where, [test.tolerance, test.size, test.standard_deviation, test.susceptibility], 1)
            )
            if test.standard_deviation <= 0.0 or test.susceptibility < 0.0:
                raise InvalidDataError(
                    f"{where} has a standard deviation that is not positive, or a negative susceptibility"
                )
            if test.coefficient not in self.coefficient_set.symbols:
                raise InvalidDataError(f"{where} has the unknown coefficient {test.coefficient!r}")

    def _check_state(self) -> None:
        if self.filter not in {name.value for name in FilterName}:
            raise InvalidDataError(f"unknown filter {self.filter!r}")
        state, symbols = self.state, self.coefficient_set.symbols
        units = STATES | self.coefficient_set.units
        if len(state) != len(self.unit):
            raise InvalidDataError("/state and /unit differ in length")
        for symbol, unit in zip(state, self.unit, strict=True):
            if symbol not in units:
                raise InvalidDataError(f"unknown component {symbol!r} of the state")
            if unit != units[symbol]:
                raise InvalidDataError(f"{symbol} is in {unit!r}; expected {units[symbol]}")
        if len(set(state)) < len(state) or not set(MOTION_SYMBOLS) <= set(state):
            raise InvalidDataError("/state has a component twice, or lacks a motion state")
        if Counter([*self.held, *(symbol for symbol in state if symbol in symbols)]) != Counter(symbols):
            raise InvalidDataError(f"each of the {len(symbols)} coefficients must be either estimated or held")

    def _check_covariance(self, may_be_infinite: bool) -> None:
        variance = np.diagonal(self.covariance)
        finite = variance < np.inf
        scale = np.sqrt(np.abs(variance[finite]))
        part = self.covariance[np.ix_(finite, finite)]
        if np.isnan(self.covariance).any() or not (may_be_infinite or finite.all()) or not (variance > 0.0).all():
            raise InvalidDataError("/covariance has NaN or infinite values, or variances that are not positive")
        if not np.isfinite(part).all() or (np.abs(part - part.T) > _MAX_ASYMMETRY * np.outer(scale, scale)).any():
            raise InvalidDataError("/covariance is not symmetric")

    def _check_corrected(self) -> None:
        nominal = dict(zip(self.state, self.standard_deviation[-1].tolist(), strict=True))
        real_array("/corrected", [*self.corrected.values()], 1)
        for symbol, deviation in self.corrected.items():
            if symbol not in nominal:
                raise InvalidDataError(f"/corrected has the unknown state {symbol!r}")
            if not deviation >= nominal[symbol] * (1.0 - _ROUNDING) or np.isinf(deviation) != np.isinf(nominal[symbol]):
                raise InvalidDataError(
                    f"/corrected has {deviation:g} for {symbol}, less than the nominal {nominal[symbol]:g}"
                )

    def _check_coefficients(self) -> None:
        """Raise an InvalidDataError if settings would refuse a coefficient that is exported."""
        units, deviations = self.coefficient_set.units, self.final_deviations()
        for symbol, value in self.final_coefficients().items():
            check_magnitude(f"coefficient {symbol}", np.array([value]), units[symbol])
            if np.isfinite(deviation := deviations.get(symbol, 0.0)):
                check_noise(f"coefficient {symbol}", np.array([deviation]), units[symbol])

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

    @property
    def unconverged(self) -> bool:
        """Whether an iteration ended before it converged."""
        return self.status.startswith("unconverged")

    @property
    def failure(self) -> str:
        """When and why it ended early; empty if it did not."""
        return "" if self.completed else self.status.removeprefix("diverged ")

    def statistics(self, sensor: str) -> InnovationStatistics:
        """Return the statistics by which a sensor is judged: less what errors within the tolerances explain."""
        return self.explained[sensor] if sensor in self.explained else self.innovations[sensor].statistics()

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

    def data_deviations(self) -> dict[str, float]:
        """Return the standard deviation by the data of each state at the last time, SI: corrected if known."""
        return dict(zip(self.state, self.standard_deviation[-1].tolist(), strict=True)) | self.corrected

    def final_deviations(self) -> dict[str, float]:
        """Return the total standard deviation of each state at the last time, SI, as far as it is known."""
        if self.considered is None:
            return self.data_deviations()
        return dict(zip(self.state, np.sqrt(np.diagonal(self.final_covariance())).tolist(), strict=True))

    def final_covariance(self) -> Array:
        """Return the total covariance at the last time, SI, which allows for the errors of known quantities."""
        covariance = self.data_covariance()
        if self.considered is not None:
            added = self.considered.added
            covariance[: len(added), : len(added)] += added
        return covariance

    def data_covariance(self) -> Array:
        """Return the covariance by the data at the last time, SI, which allows for autocorrelated residuals."""
        ratio = np.ones(len(self.state))
        if self.considered is not None:
            ratio[: self.considered.inflation.size] = self.considered.inflation
        for symbol, corrected in self.corrected.items():
            row = self.state.index(symbol)
            if np.isfinite(corrected):
                ratio[row] = corrected / float(self.standard_deviation[-1, row])
        return self.covariance * np.outer(ratio, ratio)

    def contributors(self, symbol: str) -> list[Contributor]:
        """Return the known quantities that make a coefficient most uncertain, the largest first."""
        return [] if self.considered is None else self.considered.contributors(self.state.index(symbol))

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

        self.validate()
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

        self.validate()
        return estimate_tree(self)
