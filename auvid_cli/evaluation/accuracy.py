"""How far each coefficient came from the truth."""

from typing import NamedTuple

import numpy as np

from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.vehicle.coefficients import SYMBOLS

# The part of the run that counts as steady state.
STEADY_SHARE = 0.1


class CoefficientResult(NamedTuple):
    """One coefficient by one filter; a row of ``coefficients.csv``.

    Attributes
    ----------
    filter, coefficient, unit : str
    true : float or None
        None without truth.
    estimate, standard_deviation : float
        At the last time the filter reached.
    rmse : float or None
        Over the whole run from the zero initial value; None without truth or after divergence.
    steady_state_error_percent : float or None
        ``|mean over the last 10 % - true| / |true|`` in percent; None also where the truth is zero.
    """

    filter: str
    coefficient: str
    unit: str
    true: float | None
    estimate: float
    standard_deviation: float
    rmse: float | None
    steady_state_error_percent: float | None


def coefficient_results(estimate: Estimate, truth: TruthRecord | None) -> list[CoefficientResult]:
    """Results of one filter, in the order of its state."""
    steady = steady_part(estimate)
    results = []
    for i, symbol in enumerate(estimate.state):
        if symbol not in SYMBOLS:
            continue
        series = estimate.mean[:, i]
        true = truth.coefficients[symbol] if truth is not None else None
        rmse = error = None
        if true is not None and estimate.completed:
            rmse = float(np.sqrt(np.mean((series - true) ** 2)))
            if true != 0.0:
                error = float(abs(series[steady].mean() - true) / abs(true) * 100.0)
        results.append(
            CoefficientResult(
                estimate.filter,
                symbol,
                estimate.unit[i],
                true,
                float(series[-1]),
                float(estimate.standard_deviation[-1, i]),
                rmse,
                error,
            )
        )
    return results


def steady_part(estimate: Estimate) -> slice:
    """The events of the last 10 % of the time."""
    begin = estimate.time[-1] - STEADY_SHARE * (estimate.time[-1] - estimate.time[0])
    return slice(int(np.searchsorted(estimate.time, begin)), None)


def average_steady_state_error(results: list[CoefficientResult]) -> float | None:
    """Mean over the coefficients that have one, percent; None if none has."""
    errors = [r.steady_state_error_percent for r in results if r.steady_state_error_percent is not None]
    return float(np.mean(errors)) if errors else None
