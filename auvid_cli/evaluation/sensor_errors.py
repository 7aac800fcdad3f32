"""What was found of the sensors' own errors, and whether the data could tell."""

from typing import NamedTuple

from auvid_cli.data.estimate import Estimate

# A standard deviation that is still more than this share of the prior's: what is left is the prior's opinion. A heading
# offset that only its sum with the heading is known of keeps 0.71 of it.
LARGEST_SHARE = 0.5


class SensorErrorResult(NamedTuple):
    """One state that stands for a sensor's error, by one filter; a row of ``sensor_errors.csv``.

    Attributes
    ----------
    filter, state, sensor, unit : str
    estimate, standard_deviation : float
        At the last time the filter reached.
    prior_standard_deviation : float
        What the settings said before any data.
    observed : bool
        Whether the data narrowed it to less than half.
    """

    filter: str
    state: str
    sensor: str
    unit: str
    estimate: float
    standard_deviation: float
    prior_standard_deviation: float
    observed: bool


def sensor_error_results(estimate: Estimate) -> list[SensorErrorResult]:
    """Return the results of one filter, in the order of the settings."""
    results = []
    for block in estimate.experiment.identification.estimate.blocks():
        for quantity in block.quantities:
            i = estimate.state.index(quantity.symbol)
            deviation = float(estimate.standard_deviation[-1, i])
            results.append(
                SensorErrorResult(
                    estimate.filter,
                    quantity.symbol,
                    block.sensor or block.name,
                    quantity.unit,
                    float(estimate.mean[-1, i]),
                    deviation,
                    block.prior_std,
                    is_observed(deviation, block.prior_std),
                )
            )
    return results


def is_observed(deviation: float, prior: float) -> bool:
    """Say whether the data, and not the prior, determine a sensor's error."""
    return deviation <= LARGEST_SHARE * prior
