"""Identified model of a vehicle: coefficients with uncertainty, states, sizes of terms, actuation, fins, and origin."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from auvid_cli._version import __version__
from auvid_cli.arrays import Array
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import ERROR_STATES
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.data.acting_inputs import as_acting
from auvid_cli.data.dataset import Dataset, InputRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.evaluation.accuracy import coefficient_results, one_speed_remarks
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.judgement import Judgement, judge_one, with_considered_errors
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, PROPULSION_SIGNALS, CoefficientSet
from auvid_cli.vehicle.parameters import ALL_INPUTS, INPUT_SYMBOLS, MOTION_SYMBOLS

# Input of each factor of a term whose name differs from that of the input.
FACTOR_INPUTS = {"thrust": "surge_force", **PROPULSION_SIGNALS}
_FORCE = INPUT_SYMBOLS.index("surge_force")


class FinSurface(NamedTuple):
    """A pair of fins as one surface."""

    name: str  # "rudder" or "elevator"
    symbols: tuple[str, str]  # coefficients of its force and its moment
    force: float  # coefficient of the force to starboard or down, kg/(m rad)
    place: float  # centre of pressure forward of the origin, m: moment divided by force


def fin_surfaces(coefficients: Mapping[str, float]) -> list[FinSurface]:
    """Return the fin surfaces with a force; without a force there is no centre of pressure."""
    pairs = (("rudder", ("Y_uudr", "N_uudr"), 1.0), ("elevator", ("Z_uude", "M_uude"), -1.0))
    return [
        FinSurface(name, (force, moment), coefficients[force], sign * coefficients[moment] / coefficients[force])
        for name, (force, moment), sign in pairs
        if coefficients[force]
    ]


def surface_changes(coefficients: Mapping[str, float], motion: Array, inputs: Array) -> dict[str, float]:
    """Return the change of forces and moments if the fins are lifting surfaces, RMS by row, N or N m.

    Parameters
    ----------
    coefficients : mapping
        All coefficients by symbol, SI.
    motion : ndarray, shape (n, 9)
    inputs : ndarray, shape (n, 4)
    """
    signals = dict(zip(MOTION_SYMBOLS, motion.T, strict=True)) | dict(zip(INPUT_SYMBOLS, inputs.T, strict=False))
    changes = dict.fromkeys("XYZMN", np.zeros(len(motion)))
    for surface in fin_surfaces(coefficients):
        is_rudder = surface.name == "rudder"
        drift, turning = (signals["v"], signals["r"]) if is_rudder else (signals["w"], -signals["q"])
        across = drift + surface.place * turning
        speed, strength = np.hypot(signals["u"], across), surface.force * signals[surface.name]
        sideways = strength * signals["u"] * (speed - signals["u"])
        changes["X"] = changes["X"] - strength * across * speed
        changes["Y" if is_rudder else "Z"] = sideways
        changes["N" if is_rudder else "M"] = surface.place * sideways
    return {row: float(np.sqrt(np.mean(change**2))) for row, change in changes.items()}


class TermSize(NamedTuple):
    """Size of the term of a coefficient."""

    symbol: str
    row: str  # "X", "Y", "Z", "K", "M" or "N"
    unit: str  # "N" or "N*m"
    rms: float  # RMS of the force or moment
    # RMS in percent of the root of the sum of the mean squares of all terms of the row; not of the sum of the terms,
    # which is small if they balance
    percent: float


def term_histories(
    coefficient_set: CoefficientSet, coefficients: Mapping[str, float], motion: Array, inputs: Array
) -> Array:
    """Return the force or moment of every coefficient, Sabet et al. 2018, eq. (13).

    Parameters
    ----------
    coefficients : mapping
        Values by symbol, SI.
    motion : ndarray, shape (n, 9)
        u, v, w, p, q, r, phi, theta, psi; m/s, rad/s, rad.
    inputs : ndarray, shape (n, 4) or (n, 6)

    Returns
    -------
    ndarray, shape (n, len(coefficient_set))
        N or N m.
    """
    by_symbol = dict(zip((quantity.symbol for quantity in ALL_INPUTS), inputs.T, strict=False))
    signals = dict(zip(MOTION_SYMBOLS, motion.T, strict=True)) | by_symbol
    signals |= {name: by_symbol[symbol] for name, symbol in FACTOR_INPUTS.items() if symbol in by_symbol}
    terms = np.empty((len(motion), len(coefficient_set)))
    for column, coefficient in enumerate(coefficient_set):
        factors = [
            np.abs(signals[name]) if modulus else signals[name]
            for name, modulus in zip(coefficient.signals, coefficient.moduli, strict=True)
        ]
        terms[:, column] = coefficients[coefficient.symbol] * np.prod(factors, axis=0)
    return terms


def term_sizes(coefficient_set: CoefficientSet, terms: Array) -> list[TermSize]:
    """Return the size of every term from `term_histories`."""
    squares = np.mean(terms**2, axis=0)
    rows = np.array([coefficient.row for coefficient in coefficient_set])
    row_sizes = np.sqrt(np.bincount(rows, squares, minlength=len(EQUATION_ROWS)))
    sizes = []
    for coefficient, square in zip(coefficient_set, squares, strict=True):
        rms, whole = float(np.sqrt(square)), float(row_sizes[coefficient.row])
        unit = "N" if coefficient.row < 3 else "N*m"
        percent = 100.0 * rms / whole if whole else 0.0
        sizes.append(TermSize(coefficient.symbol, EQUATION_ROWS[coefficient.row], unit, rms, percent))
    return sizes


def held_inputs(time: Array, input_time: Array, values: Array) -> Array:
    """Return the inputs at given times, shape (n, 4); each holds from its own time to the next.

    Times are compared in whole nanoseconds, to which filters round the times of events.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, not before the first of `input_time`.
    input_time : ndarray, shape (k,)
        s, increasing.
    values : ndarray, shape (k, 4)
    """
    return values[np.searchsorted(input_time.round(9), time.round(9), side="right") - 1]


class Actuation(NamedTuple):
    """Effect of the actuators between the inputs and the forces."""

    thrust: float  # scale of the stated surge force
    thrust_rms: float  # RMS of the change of the surge force by this scale, N
    actuators: ActuatorSettings  # dynamics of fins and propeller
    # RMS change of `surge_force`, and of the force or moment of each coefficient of an input, due to these dynamics,
    # N or N m
    changes: dict[str, float]


def acting_inputs(estimate: Estimate, inputs: InputRecord) -> Array:
    """Return the acting inputs at the times of an estimate, without fin trims and thrust scale."""
    acting = as_acting(inputs, estimate.experiment)
    return held_inputs(estimate.time, acting.time, acting.values)


def actuation(estimate: Estimate, inputs: InputRecord, coefficients: Mapping[str, float], motion: Array) -> Actuation:
    """Return thrust scale and actuators of an estimate, with their effects along its motion.

    Parameters
    ----------
    inputs : InputRecord
        Recorded inputs.
    coefficients : mapping
        All coefficients by symbol, SI.
    motion : ndarray, shape (n, 9)
        Motion at the times of the estimate.
    """
    commanded = held_inputs(estimate.time, inputs.time, inputs.values)
    coefficient_set, acting = estimate.coefficient_set, acting_inputs(estimate, inputs)
    by_command, by_actuator = (term_histories(coefficient_set, coefficients, motion, u) for u in (commanded, acting))
    changes = np.sqrt(np.mean((by_actuator - by_command) ** 2, axis=0))
    thrust, force = estimate.final_actuators().thrust, acting[:, _FORCE]
    input_changes = {c.symbol: float(rms) for c, rms in zip(coefficient_set, changes, strict=True) if c.is_of_inputs}
    return Actuation(
        thrust=thrust,
        thrust_rms=float(abs(thrust - 1.0) * np.sqrt(np.mean(force**2))),
        actuators=estimate.experiment.vehicle.actuators,
        changes=input_changes | {"surge_force": float(np.sqrt(np.mean((force - commanded[:, _FORCE]) ** 2)))},
    )


class IdentifiedCoefficient(NamedTuple):
    """A coefficient of the identified model."""

    symbol: str
    unit: str
    value: float  # SI
    standard_deviation: float | None  # SI, corrected if known; None if held
    identified: bool | None  # as in the tables of a report; None if held


class EstimatedState(NamedTuple):
    """An error of a sensor or actuator, or the current, at the last time, SI."""

    symbol: str
    unit: str
    value: float
    standard_deviation: float


class Origin(NamedTuple):
    """Origin of a model."""

    # dataset_sha256, estimate_sha256: SHA-256 of the files, in hexadecimal; empty if in memory
    dataset_sha256: str
    estimate_sha256: str
    auvid_version: str
    created: str  # time of the export, UTC

    @property
    def dataset(self) -> str:
        """Return the dataset in words."""
        return f"the dataset with SHA-256 {self.dataset_sha256}" if self.dataset_sha256 else "a dataset in memory"

    @property
    def estimate(self) -> str:
        """Return the estimate in words."""
        return f"the estimate with SHA-256 {self.estimate_sha256}" if self.estimate_sha256 else "an estimate in memory"


@dataclass(frozen=True)
class IdentifiedModel:
    """A vehicle with coefficients estimated by a filter."""

    experiment: RunSettings  # settings of the estimate; its vehicle has the known parameters
    filter: str
    judgement: Judgement
    coefficients: tuple[IdentifiedCoefficient, ...]  # all, in the order of the coefficient set
    states: tuple[EstimatedState, ...]  # in the order of the estimate
    covariance: Array  # shape (k, k); covariance of the estimated coefficients, then of `states`, SI
    actuation: Actuation
    term_sizes: tuple[TermSize, ...]  # sizes of all terms along the estimated motion
    # Change along that motion if the fins were lifting surfaces, RMS by row, N or N m
    surface_changes: dict[str, float]
    origin: Origin
    speed_remarks: tuple[str, ...] = ()  # sentences, if drag and thrust are known at one speed only

    @property
    def coefficient_set(self) -> CoefficientSet:
        """Return the coefficient set of the vehicle."""
        return self.experiment.vehicle.coefficient_set

    def estimated(self) -> tuple[str, ...]:
        """Return the symbols of the estimated coefficients."""
        return tuple(each.symbol for each in self.coefficients if each.standard_deviation is not None)

    def not_identified(self) -> tuple[str, ...]:
        """Return the symbols of the coefficients that the data do not identify."""
        return tuple(each.symbol for each in self.coefficients if each.identified is False)


def model_found_by(
    estimate: Estimate, dataset: Dataset, estimate_sha256: str, reference: Estimate | None = None
) -> IdentifiedModel:
    """Return `identified_model` with the bounds of the dataset; the digest of the estimate is empty if in memory."""
    bounds = BoundsOf(prepare(dataset))(estimate).of_data if estimate.completed else {}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    origin = Origin(dataset.sha256, estimate_sha256, __version__, created)
    return identified_model(estimate, dataset, bounds, origin, reference)


def identified_model(
    estimate: Estimate,
    dataset: Dataset,
    bounds: Mapping[str, float],
    origin: Origin,
    reference: Estimate | None = None,
) -> IdentifiedModel:
    """Return the model of an estimate.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the estimate; its inputs are needed for the sizes of the terms.
    bounds : mapping
        Known Cramer-Rao bounds by symbol.
    reference : Estimate, optional
        Smoother's estimate of the same data, for the judgement.

    Raises
    ------
    DataError
        If the filter did not complete.
    """
    if not estimate.completed:
        raise DataError(
            f"the estimate of {estimate.filter} {estimate.status}; that is no model of the vehicle, "
            "so nothing is exported"
        )
    if reference is not None:
        estimate, _ = with_considered_errors([estimate, reference])
    values, deviations = estimate.final_coefficients(), estimate.final_deviations()
    judgement = judge_one(estimate, reference)
    results = {row.coefficient: row for row in coefficient_results(estimate, dataset.truth, bounds, judgement)}
    coefficient_set, coefficients = estimate.coefficient_set, []
    for symbol, unit in coefficient_set.units.items():
        certainty = (deviations[symbol], results[symbol].identified) if symbol in results else (None, None)
        coefficients.append(IdentifiedCoefficient(symbol, unit, values[symbol], *certainty))
    errors = {quantity.symbol for quantity in ERROR_STATES}
    error_rows = [i for i, symbol in enumerate(estimate.state) if symbol in errors]
    rows = [*(estimate.state.index(symbol) for symbol in coefficient_set.symbols if symbol in results), *error_rows]
    motion = estimate.mean[:, [estimate.state.index(symbol) for symbol in MOTION_SYMBOLS]]
    inputs = acting_inputs(estimate, dataset.inputs)
    return IdentifiedModel(
        experiment=estimate.experiment,
        filter=estimate.filter,
        judgement=judgement,
        coefficients=tuple(coefficients),
        states=tuple(
            EstimatedState(symbol, estimate.unit[i], float(estimate.mean[-1, i]), deviations[symbol])
            for i, symbol in ((i, estimate.state[i]) for i in error_rows)
        ),
        covariance=estimate.final_covariance()[np.ix_(rows, rows)],
        actuation=actuation(estimate, dataset.inputs, values, motion),
        term_sizes=tuple(term_sizes(coefficient_set, term_histories(coefficient_set, values, motion, inputs))),
        surface_changes=surface_changes(values, motion, inputs),
        speed_remarks=tuple(one_speed_remarks(estimate)),
        origin=origin,
    )
