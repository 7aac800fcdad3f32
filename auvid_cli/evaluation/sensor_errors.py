"""What was found of the sensors' own errors, and whether the data could tell."""

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from auvid_cli.config.extra_states import ErrorBlock
from auvid_cli.data.estimate import Estimate

# A standard deviation that is still more than this share of the prior's: what is left is the prior's opinion. A heading
# offset that only its sum with the heading is known of keeps 0.71 of it.
LARGEST_SHARE = 0.5


class SensorErrorResult(NamedTuple):
    """One state that stands for a sensor's error, by one filter; a row of ``sensor_errors.csv``.

    Attributes
    ----------
    filter, state : str
    segment : int or None
        Which of several segments of the data, from 1, a value is of that walks and starts anew in each; None of one
        that holds for all data.
    sensor, unit : str
    estimate, standard_deviation : float
        At the last time of that which the filter reached.
    prior_standard_deviation : float
        What the settings said before any data.
    observed : bool
        Whether the data narrowed it to less than half.
    """

    filter: str
    state: str
    segment: int | None
    sensor: str
    unit: str
    estimate: float
    standard_deviation: float
    prior_standard_deviation: float
    observed: bool


def sensor_error_results(estimate: Estimate, ends: Sequence[float] = ()) -> list[SensorErrorResult]:
    """Return the results of one filter, in the order of the settings.

    Parameters
    ----------
    estimate : Estimate
    ends : sequence of float
        s, last times of the segments of its data; without them only what it found last is returned.
    """
    return [
        SensorErrorResult(
            estimate.filter,
            quantity.symbol,
            segment,
            block.sensor or block.name,
            quantity.unit,
            float(estimate.mean[row, i]),
            deviation,
            block.prior_std,
            is_observed(deviation, block.prior_std),
        )
        for block in estimate.experiment.identification.estimate.blocks()
        for i, quantity in ((estimate.state.index(quantity.symbol), quantity) for quantity in block.quantities)
        for segment, row in _rows(estimate, block, ends)
        for deviation in (float(estimate.standard_deviation[row, i]),)
    ]


def _rows(estimate: Estimate, block: ErrorBlock, ends: Sequence[float]) -> list[tuple[int | None, int]]:
    """Return the last row of each segment in which a block starts anew, as far as the filter went; else the last."""
    starts_anew = block.walk > 0.0 and block.time_constant == inf
    if len(ends) < 2 or not starts_anew:
        return [(None, -1)]
    rows = np.searchsorted(estimate.time, ends, side="right") - 1
    reached = np.flatnonzero(np.diff(rows, prepend=-1) > 0)
    return [(int(k) + 1, int(rows[k])) for k in reached]


def is_observed(deviation: float, prior: float) -> bool:
    """Say whether the data, and not the prior, determine a sensor's error."""
    return deviation <= LARGEST_SHARE * prior
