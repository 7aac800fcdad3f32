"""What estimates are held against: the least standard deviation that their data allow."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.identification.fisher import information_at
from auvid_cli.identification.timeline import initial_motion, measuring_sensors

Array = NDArray[np.float64]


class Bounds(NamedTuple):
    """Cramer-Rao bounds of the coefficients of an estimate.

    Attributes
    ----------
    by_symbol : dict of float
        Standard deviations, SI; infinite where the data say nothing, empty if there are none.
    remark : str
        Why there are none.
    """

    by_symbol: dict[str, float]
    remark: str = ""


def cramer_rao_bounds(dataset: Dataset, estimates: Sequence[Estimate]) -> dict[str, Bounds]:
    """Bounds by filter: at the truth where there is one, else at the values that the filter came to.

    White noise as large as the sensors state is presumed, no process noise, and no prior.
    """
    found: dict[str, Bounds] = {}
    at_truth: dict[str, Bounds] = {}
    for estimate in estimates:
        if dataset.truth is None:
            found[estimate.filter] = _bounds(dataset, estimate)
            continue
        settings = estimate.experiment.model_dump_json()
        if settings not in at_truth:
            at_truth[settings] = _bounds(dataset, estimate)
        found[estimate.filter] = at_truth[settings]
    return found


def _bounds(dataset: Dataset, estimate: Estimate) -> Bounds:
    # As it was identified; an earlier estimate would only be looked up for its prior, which has no part in this.
    settings = estimate.experiment.identification
    prior = settings.prior.model_copy(update={"from_estimate": None})
    identification = settings.model_copy(update={"prior": prior})
    experiment = estimate.experiment.model_copy(update={"identification": identification})
    values = dataset.truth.coefficients if dataset.truth is not None else estimate.final_coefficients()
    try:
        information = information_at(replace(dataset, experiment=experiment), values, true_start(dataset))
    except DataError as error:
        return Bounds({}, str(error))
    return Bounds(information.bound())


def joint_deviation(bound: float, prior: float) -> float:
    """Standard deviation where a prior is added to what the data say; infinite where neither says anything."""
    precision = float(np.hypot(1.0 / bound, 1.0 / prior))
    return 1.0 / precision if precision else np.inf


def true_start(dataset: Dataset) -> Array | None:
    """The true motion where filters start, shape (9,); None without truth."""
    if dataset.truth is None:
        return None
    start, _ = initial_motion(dataset, measuring_sensors(dataset))
    return dataset.truth.motion[np.searchsorted(dataset.truth.time, start - 1e-9)]
