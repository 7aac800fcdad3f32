"""Identified model of a vehicle: coefficients with uncertainty, states, sizes of terms, and origin."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from auvid_cli._version import __version__
from auvid_cli.arrays import Array
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import ERROR_STATES
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.evaluation.accuracy import coefficient_results, one_speed_remarks
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.judgement import Judgement, judge_one, with_considered_errors
from auvid_cli.export.model_parts import (
    Actuation,
    TermSize,
    acting_inputs,
    actuation,
    surface_changes,
    term_histories,
    term_sizes,
)
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS


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
