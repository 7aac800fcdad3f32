"""Accuracy of coefficients and of estimated sensor errors."""

from collections.abc import Mapping, Sequence
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from auvid_cli.config.extra_states import ErrorBlock
from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.identification.states import coefficient_priors, natural_magnitude

# A standard deviation that is still more than this share of the prior's: what is left is the prior's opinion. A heading
# offset that only its sum with the heading is known of keeps 0.71 of it.
LARGEST_SHARE = 0.5
# The part of the run that counts as steady state.
STEADY_SHARE = 0.1
# A coefficient whose uncertainty is more than this share of its value is not identified.
LARGEST_SHARE_OF_VALUE = 0.2
# Standard deviation of surge, as a share of its mean, below which drag and thrust are known at this speed only.
ONE_SPEED = 0.05


class SensorErrorResult(NamedTuple):
    """Estimate of one sensor error by one filter; a row of ``sensor_errors.csv``."""

    filter: str
    state: str
    segment: int | None  # number of the segment, from 1, for an error that restarts in each segment; else None
    sensor: str
    unit: str
    estimate: float  # at the last time that the filter reached
    standard_deviation: float  # at the same time
    prior_standard_deviation: float  # standard deviation of the prior
    observed: bool  # whether the data narrowed it to less than half


def sensor_error_results(estimate: Estimate, ends: Sequence[float] = ()) -> list[SensorErrorResult]:
    """Return the results of one filter, in the order of the settings.

    Parameters
    ----------
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
    """Return the last row of each segment for a block that restarts in each, else the last row."""
    starts_anew = block.walk > 0.0 and block.time_constant == inf
    if len(ends) < 2 or not starts_anew:
        return [(None, -1)]
    rows = np.searchsorted(estimate.time, ends, side="right") - 1
    reached = np.flatnonzero(np.diff(rows, prepend=-1) > 0)
    return [(int(k) + 1, int(rows[k])) for k in reached]


def is_observed(deviation: float, prior: float) -> bool:
    """Whether the data, not the prior, determine a sensor error."""
    return deviation <= LARGEST_SHARE * prior


class CoefficientResult(NamedTuple):
    """One coefficient by one filter; a row of ``coefficients.csv``."""

    filter: str
    coefficient: str
    unit: str
    true: float | None  # none without truth
    estimate: float  # at the last time that the filter reached
    standard_deviation: float  # nominal, at the same time
    rmse: float | None  # over the whole run from the zero initial value; None without truth or after divergence
    # ``|mean over the last 10 % - true| / |true|`` in percent; None also where the truth is zero
    steady_state_error_percent: float | None
    # Least standard deviation that the data allow, see `auvid_cli.evaluation.bounds`; None where it is not known
    cramer_rao_bound: float | None
    # The corrected standard deviation, or if there is none ``standard_deviation``, over ``cramer_rao_bound``: how much
    # of what the data hold the filter claims to have got. Below one it claims more, or its prior does. None also after
    # divergence, and where the bound is infinite.
    times_bound: float | None
    identified: bool  # whether the relative uncertainty is small, see `shares_of_value`, and the estimate is sound
    # Smallest standard deviation that the data allow with process noise, see `auvid_cli.evaluation.bounds`; None
    # without an estimate of the smoother
    bound_with_process_noise: float | None = None
    # Accounts for the autocorrelation of the residuals; None except for batch estimators
    corrected_standard_deviation: float | None = None
    # Accounts also for errors of known quantities, see `auvid_cli.data.faults`; None without an estimate of the
    # smoother
    total_standard_deviation: float | None = None
    # The known quantities that make the coefficient most uncertain, with their part in percent of the estimate
    contributors: str = ""


def coefficient_results(
    estimate: Estimate, truth: TruthRecord | None, bounds: Mapping[str, float], judgement: Judgement
) -> list[CoefficientResult]:
    """Return the results of one filter, in the order of its state.

    Parameters
    ----------
    bounds : mapping
        Cramer-Rao's by symbol, as far as known.
    judgement : Judgement
    """
    steady, shares = steady_part(estimate), shares_of_value(estimate, truth, bounds)
    total = estimate.final_deviations()
    of_truth = {} if truth is None else truth.coefficients_of(shares)
    results = []
    for i, symbol in enumerate(estimate.state):
        if symbol not in shares:
            continue
        series, true = estimate.mean[:, i], of_truth.get(symbol)
        rmse = error = None
        if true is not None and estimate.completed:
            rmse = float(np.sqrt(np.mean((series - true) ** 2)))
            if true != 0.0:
                error = float(abs(series[steady].mean() - true) / abs(true) * 100.0)
        deviation, bound = float(estimate.standard_deviation[-1, i]), bounds.get(symbol)
        corrected = estimate.corrected.get(symbol)
        claimed = deviation if corrected is None else corrected
        results.append(
            CoefficientResult(
                estimate.filter,
                symbol,
                estimate.unit[i],
                true,
                float(series[-1]),
                deviation,
                rmse,
                error,
                bound,
                claimed / bound if bound is not None and isfinite(bound) and estimate.completed else None,
                judgement.trusts(symbol) and shares[symbol] <= LARGEST_SHARE_OF_VALUE,
                corrected_standard_deviation=corrected,
                total_standard_deviation=None if estimate.considered is None else total[symbol],
                contributors=contributors_text(estimate, symbol),
            )
        )
    return results


def shares_of_value(estimate: Estimate, truth: TruthRecord | None, bounds: Mapping[str, float]) -> dict[str, float]:
    """Return the relative uncertainty of each coefficient, by symbol.

    The larger of the total standard deviation and, where it is known, the Cramer-Rao bound, over the true value, else
    over the estimate. Where the truth is zero: over the natural magnitude of a body of this size.
    """
    shares, total = {}, estimate.final_deviations()
    for coefficient in estimate.coefficient_set:
        symbol = coefficient.symbol
        if symbol not in estimate.state:
            continue
        i = estimate.state.index(symbol)
        value = abs(float(estimate.mean[-1, i]) if truth is None else truth.coefficients_of([symbol])[symbol])
        if truth is not None and value == 0.0:
            value = natural_magnitude(coefficient, estimate.experiment.vehicle.size)
        uncertainty = max(total[symbol], bounds.get(symbol, 0.0))
        shares[symbol] = uncertainty / value if value else np.inf
    return shares


def contributors_text(estimate: Estimate, symbol: str) -> str:
    """Return the two errors that make a coefficient most uncertain, with their part in percent of it.

    Each is the noise or an error of a known quantity; no text if the known quantities add nothing.
    """
    value, noise = abs(float(estimate.mean[-1, estimate.state.index(symbol)])), estimate.data_deviations()[symbol]
    known = [(str(each.fault), each.deviation) for each in estimate.contributors(symbol)]
    if not known or not value:
        return ""
    largest = sorted([("noise", noise), *known], key=lambda part: part[1], reverse=True)[:2]
    return "; ".join(f"{error} {100.0 * part / value:.2g} %" for error, part in largest)


def one_speed_remarks(estimate: Estimate) -> list[str]:
    """Return a sentence on drag and thrust if surge hardly varies, so that they are known at one speed only."""
    if not estimate.completed or "X_u|u|" not in estimate.state:
        return []
    surge = estimate.mean[:, estimate.state.index("u")]
    speed = float(abs(surge.mean()))
    if surge.std() > ONE_SPEED * speed:
        return []
    return [
        f"X_u|u| and thrust are effective at U = {speed:.3g} m/s, because surge varies by less than {ONE_SPEED:.0%}. "
        "At other speeds the linear share of the drag matters, which only runs at several speeds show."
    ]


def shares_of_prior(estimate: Estimate) -> dict[str, float]:
    """Return the standard deviation of each coefficient relative to its prior, by symbol."""
    settings = estimate.experiment.identification
    priors = coefficient_priors(estimate.experiment.vehicle, settings.prior)
    left = {}
    for i, symbol in enumerate(estimate.state):
        if symbol in priors:
            before = priors[symbol].standard_deviation
            if settings.prior.from_estimate is not None:
                # The filter started from the earlier estimate.
                before = estimate.standard_deviation[0, i]
            left[symbol] = float(estimate.standard_deviation[-1, i] / before)
    return left


def normalised_estimation_error(estimate: Estimate, truth: TruthRecord) -> float:
    """Return the normalised estimation error squared (NEES) of all coefficients at the last time.

    Chi-squared with as many degrees of freedom as there are coefficients, if the covariance is honest; infinite if it
    claims to know a combination of them exactly.
    """
    rows = estimate.coefficient_rows
    true = truth.coefficients_of(estimate.state[i] for i in rows)
    error = estimate.mean[-1, rows] - np.array([*true.values()])
    deviation = estimate.standard_deviation[-1, rows]
    correlation = estimate.covariance[np.ix_(rows, rows)] / np.outer(deviation, deviation)
    try:
        return float((error / deviation) @ np.linalg.solve(correlation, error / deviation))
    except np.linalg.LinAlgError:
        return float("inf")


def steady_part(estimate: Estimate) -> slice:
    """Return the events of the last 10 % of the time."""
    begin = estimate.time[-1] - STEADY_SHARE * (estimate.time[-1] - estimate.time[0])
    return slice(int(np.searchsorted(estimate.time, begin)), None)


def average_steady_state_error(results: list[CoefficientResult]) -> float | None:
    """Return the mean over the coefficients that have one, percent; None if none has."""
    errors = [r.steady_state_error_percent for r in results if r.steady_state_error_percent is not None]
    return float(np.mean(errors)) if errors else None


def relative_rmse(results: list[CoefficientResult]) -> list[float]:
    """Return RMSE / |true value| of each coefficient that has both; comparable over coefficients and vehicles."""
    return [row.rmse / abs(row.true) for row in results if row.rmse is not None and row.true]
