"""What a filter found: the value objects between identification and evaluation."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydantic_core import core_schema

from auvid_cli.config.enums import FilterName
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import ERROR_STATES, EXCESS_BUOYANCY, FIN_TRIMS, THRUST_SCALE, TRIM_MOMENT
from auvid_cli.config.moving_states import FURTHER_STATES
from auvid_cli.data.faults import FaultTest
from auvid_cli.data.innovations import Innovations
from auvid_cli.vehicle.actuators import ActuatorErrors
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.matrices import Ballast
from auvid_cli.vehicle.parameters import MOTION, Quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Array = NDArray[np.float64]

# Unit of everything that an augmented state may be made of beside coefficients: motion, depth, errors of sensors and
# actuators.
_MOVING = *MOTION, *(state.quantity for state in FURTHER_STATES)
STATES = {quantity.symbol: quantity.unit for quantity in (*_MOVING, *ERROR_STATES)}


@dataclass(frozen=True)
class EstimateHeader:
    """What is known of an estimate before its filter runs.

    Attributes
    ----------
    filter : str
        "ekf", "ckf", "tukf", "ukf", "smoother" or "output_error".
    experiment : RunSettings
        Settings it is made with.
    state : tuple of str
        Symbols: estimated coefficients, constant sensor errors, the nine motion states, walking sensor errors.
    unit : tuple of str
    held : dict
        Coefficients that are not estimated, SI.
    dataset_sha256 : str
        Of the dataset it comes from.
    """

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
        """Return the rows of the state that are coefficients."""
        symbols = self.coefficient_set.symbols
        return [row for row, symbol in enumerate(self.state) if symbol in symbols]

    @property
    def in_one_batch(self) -> bool:
        """Say whether all data were fitted at once, instead of filtered from measurement to measurement."""
        return FilterName(self.filter).in_one_batch

    @property
    def is_free_run_fit(self) -> bool:
        """Say whether it comes of a fit of the motion left to itself, without process noise."""
        return FilterName(self.filter).is_free_run_fit


@dataclass(frozen=True)
class EstimateChunk:
    """Consecutive events of a filter's run, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, after each event.
    mean, standard_deviation : ndarray, shape (n, len(state))
    innovations : dict of Innovations
        By sensor; every chunk has every sensor.
    """

    time: Array
    mean: Array
    standard_deviation: Array
    innovations: dict[str, Innovations]


@dataclass(frozen=True)
class EstimateHistory(EstimateChunk):
    """As much of an estimate as a figure shows; no more, because it may travel to another process.

    Attributes
    ----------
    filter : str
    state : tuple of str
        Symbols of the components that are there.
    completed : bool
        Whether the filter reached the end of the data.
    """

    filter: str
    state: tuple[str, ...]
    completed: bool


@dataclass(frozen=True)
class Outcome:
    """What is known of an estimate after its filter has run.

    Attributes
    ----------
    status : str
        "completed", "diverged at t = ...: why", or "unconverged: why".
    covariance : ndarray, shape (len(state), len(state))
        At the last time, SI.
    steps : int
        Events that went well.
    cpu_time, wall_time : float
        Of the filter alone, s.
    faults : tuple of FaultTest
        Of an estimator that tests for faults.
    corrected : dict of float
        Of a batch estimate that completed: by the symbol of each constant state the standard deviation that allows for
        the autocorrelation of what the fit leaves unexplained, SI; no less than the nominal one.
    """

    status: str
    covariance: Array
    steps: int
    cpu_time: float
    wall_time: float
    faults: tuple[FaultTest, ...] = field(default=(), kw_only=True)
    corrected: dict[str, float] = field(default_factory=dict, kw_only=True)


@dataclass(frozen=True)
class Estimate(EstimateHeader, EstimateChunk, Outcome):
    """Augmented state over time, of one filter; ends early where it diverged.

    Attributes
    ----------
    filter : str
        "ekf", "ckf", "tukf", "ukf", "smoother" or "output_error".
    status : str
        "completed", "diverged at t = ...: why", or "unconverged: why".
    state, unit : tuple of str
        Symbols of the augmented state, and their units.
    time : ndarray, shape (n,)
        s, after each event.
    mean, standard_deviation : ndarray, shape (n, len(state))
        SI; nominal, as if what is left unexplained was white noise.
    covariance : ndarray, shape (len(state), len(state))
        At the last time, SI; nominal.
    corrected : dict of float
        Of a batch estimate that completed, by symbol of each constant state: its standard deviation with allowance for
        the autocorrelation of what is left unexplained, SI.
    innovations : dict of Innovations
        By sensor.
    held : dict of float
        Coefficients that are not estimated, SI.
    experiment : RunSettings
        Settings it is made with.
    steps, cpu_time, wall_time
        Events that went well, and what the filter took, s.
    faults : tuple of FaultTest
        Of an estimator that tests for faults.
    dataset_sha256 : str
        Of the file of the dataset that it comes from; empty if there is none.
    """

    @classmethod
    def __get_pydantic_core_schema__(cls, source: object, handler: object) -> core_schema.CoreSchema:
        """Return the schema that takes any instance as it is."""
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
        """Say whether the filter reached the end of the data."""
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
        """Return what lies between the inputs as they are stated and those that act, at the last time."""
        return ActuatorErrors(1.0 + self._final(THRUST_SCALE), *map(self._final, FIN_TRIMS))

    def final_ballast(self) -> Ballast:
        """Return what lies between weight and buoyancy as they are stated and those that act, at the last time."""
        return Ballast(self._final(EXCESS_BUOYANCY), self._final(TRIM_MOMENT))

    def _final(self, error: Quantity) -> float:
        """Return an error at the last time, 0 where it is not estimated."""
        return float(self.mean[-1, self.state.index(error.symbol)]) if error.symbol in self.state else 0.0

    def final_coefficients(self) -> dict[str, float]:
        """Return the coefficients at the last time, the 22 and those of own terms, estimated or held, SI."""
        return self.held | {self.state[row]: float(self.mean[-1, row]) for row in self.coefficient_rows}

    def final_deviations(self) -> dict[str, float]:
        """Return the standard deviation of each state at the last time, SI: corrected where it is, else nominal."""
        return dict(zip(self.state, self.standard_deviation[-1].tolist(), strict=True)) | self.corrected

    def final_covariance(self) -> Array:
        """Return the covariance at the last time, SI, with the corrected standard deviations where there are any."""
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
            ``coefficients``: all of the vehicle at the last time, SI, with a row for each symbol and the columns
            ``value``, ``standard_deviation`` (NaN of one that was held), ``corrected_standard_deviation`` (NaN where
            there is none), ``unit`` and ``estimated``. ``mean`` and ``standard_deviation``: the state over time, s,
            with a column for each symbol; ``attrs["units"]`` has their units.
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
