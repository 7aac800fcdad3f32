"""What is exported: the coefficients that a filter found, with how sure they are and where they come from."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli._version import __version__
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import ERROR_STATES
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.evaluation.accuracy import coefficient_results
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.judgement import Grade, Judgement, judge_one
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

Array = NDArray[np.float64]


class IdentifiedCoefficient(NamedTuple):
    """A coefficient of the identified model.

    Attributes
    ----------
    symbol, unit : str
    value : float
        SI.
    standard_deviation : float or None
        SI, corrected where it is; None of one that was held.
    identified : bool or None
        As the tables of a report mark it; None of one that was held.
    """

    symbol: str
    unit: str
    value: float
    standard_deviation: float | None
    identified: bool | None


class EstimatedState(NamedTuple):
    """A constant or slow state that was estimated beside the coefficients: of a sensor, the current or the thrust.

    Attributes
    ----------
    symbol, unit : str
    value, standard_deviation : float
        At the last time, SI.
    """

    symbol: str
    unit: str
    value: float
    standard_deviation: float


class Origin(NamedTuple):
    """Origin of a model.

    Attributes
    ----------
    dataset_sha256, estimate_sha256 : str
        Of the files, in hexadecimal; empty of what was in no file.
    auvid_version : str
    created : str
        When it was exported, UTC.
    """

    dataset_sha256: str
    estimate_sha256: str
    auvid_version: str
    created: str

    @property
    def dataset(self) -> str:
        """Name the dataset in words."""
        return f"the dataset with SHA-256 {self.dataset_sha256}" if self.dataset_sha256 else "a dataset in memory"

    @property
    def estimate(self) -> str:
        """Name the estimate in words."""
        return f"the estimate with SHA-256 {self.estimate_sha256}" if self.estimate_sha256 else "an estimate in memory"


@dataclass(frozen=True)
class IdentifiedModel:
    """A vehicle with the coefficients that a filter found.

    Attributes
    ----------
    experiment : RunSettings
        With which they were found; its vehicle has the known parameters.
    filter : str
    judgement : Judgement
    coefficients : tuple of IdentifiedCoefficient
        All, in the order of the table.
    states : tuple of EstimatedState
        In the order of the estimate.
    covariance : ndarray, shape (k, k)
        Of the coefficients that were estimated, in that order, and of `states`, SI.
    actuation : Actuation
    term_sizes : tuple of TermSize
        Of all along the estimated motion.
    surface_changes : dict of float
        What would change along it, RMS by row, N or N m, if the fins were lifting surfaces.
    origin : Origin
    """

    experiment: RunSettings
    filter: str
    judgement: Judgement
    coefficients: tuple[IdentifiedCoefficient, ...]
    states: tuple[EstimatedState, ...]
    covariance: Array
    actuation: Actuation
    term_sizes: tuple[TermSize, ...]
    surface_changes: dict[str, float]
    origin: Origin

    @property
    def coefficient_set(self) -> CoefficientSet:
        """Return the coefficients of the vehicle, without values."""
        return self.experiment.vehicle.coefficient_set

    def estimated(self) -> tuple[str, ...]:
        """Return the symbols of the coefficients that were not held."""
        return tuple(
            coefficient.symbol for coefficient in self.coefficients if coefficient.standard_deviation is not None
        )

    def not_identified(self) -> tuple[str, ...]:
        """Return the symbols of those that were estimated in vain."""
        return tuple(coefficient.symbol for coefficient in self.coefficients if coefficient.identified is False)


def model_found_by(
    estimate: Estimate, dataset: Dataset, estimate_sha256: str, reference: Estimate | None = None
) -> IdentifiedModel:
    """Take the model out of an estimate, with the bounds of its data and where it comes from, now.

    Parameters
    ----------
    estimate : Estimate
    dataset : Dataset
        From which it was made.
    estimate_sha256 : str
        Of its file; empty if there is none.
    reference : Estimate, optional
        Of the smoother from the same data, by which it is judged.

    Raises
    ------
    DataError
        As of `identified_model`.
    """
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
    """Take the model out of an estimate.

    Parameters
    ----------
    estimate : Estimate
    dataset : Dataset
        From which it was made: its inputs tell how large each term was, and its truth, where it has one, what counts
        as identified.
    bounds : mapping
        Cramer-Rao's by symbol, as far as they are known.
    origin : Origin
    reference : Estimate, optional
        Of the smoother from the same data, by which it is judged.

    Raises
    ------
    DataError
        If the filter did not end well: its last values are no model of anything.
    """
    if not estimate.completed:
        raise DataError(
            f"the estimate of {estimate.filter} {estimate.status}; that is no model of the vehicle, "
            "so nothing is exported"
        )
    values, deviations = estimate.final_coefficients(), estimate.final_deviations()
    judgement = judge_one(estimate, reference)
    is_sound = judgement.grade is Grade.SOUND
    results = {row.coefficient: row for row in coefficient_results(estimate, dataset.truth, bounds, is_sound)}
    of_vehicle, coefficients = estimate.coefficient_set, []
    for coefficient in of_vehicle:
        result = results.get(coefficient.symbol)
        certainty = (None, None) if result is None else (deviations[coefficient.symbol], result.identified)
        coefficients.append(
            IdentifiedCoefficient(coefficient.symbol, coefficient.unit, values[coefficient.symbol], *certainty)
        )
    errors = {quantity.symbol for quantity in ERROR_STATES}
    others = [i for i, symbol in enumerate(estimate.state) if symbol in errors]
    kept = [
        *(estimate.state.index(symbol) for symbol in of_vehicle.symbols if symbol in results),
        *others,
    ]
    motion = estimate.mean[:, [estimate.state.index(symbol) for symbol in MOTION_SYMBOLS]]
    inputs = acting_inputs(estimate, dataset.inputs)
    return IdentifiedModel(
        experiment=estimate.experiment,
        filter=estimate.filter,
        judgement=judgement,
        coefficients=tuple(coefficients),
        states=tuple(
            EstimatedState(
                estimate.state[i],
                estimate.unit[i],
                float(estimate.mean[-1, i]),
                deviations[estimate.state[i]],
            )
            for i in others
        ),
        covariance=estimate.final_covariance()[np.ix_(kept, kept)],
        actuation=actuation(estimate, dataset.inputs, values, motion),
        term_sizes=tuple(term_sizes(of_vehicle, term_histories(of_vehicle, values, motion, inputs))),
        surface_changes=surface_changes(values, motion, inputs),
        origin=origin,
    )
