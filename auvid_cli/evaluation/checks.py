"""The list of verdicts on an estimate: each a number, what it may be, and what to do where it is not."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from auvid_cli.config.filter_name import FilterName
from auvid_cli.data.dataset import Dataset, TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import LARGEST_RELATIVE_DEVIATION
from auvid_cli.evaluation.bounds import Bounds, joint_deviation
from auvid_cli.evaluation.check import Check
from auvid_cli.evaluation.data_checks import data_checks
from auvid_cli.evaluation.innovation_checks import innovation_checks
from auvid_cli.evaluation.sensor_errors import sensor_error_results
from auvid_cli.identification.prior import natural_magnitude, prior_standard_deviations
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS

# Share of the prior's standard deviation that may be left.
_LARGEST_SHARE = 0.5
# Standard deviation of an estimate in terms of the least that data and prior allow: the bound is that of the true
# values, and a filter linearises, hence some room below.
_LEAST_OF_BOUND, _LARGEST_OF_BOUND = 0.8, 3.0
# Times the natural magnitude of a plain body of that size.
_LARGEST_SIZE = 30.0
_SIGMAS = 3.0
# Drag along each axis takes energy. Positive rudder pushes the stern to starboard, a positive stern plane pushes it up.
_SIGNS = {"X_u|u|": -1, "Y_v|v|": -1, "Z_w|w|": -1, "K_p|p|": -1, "M_q|q|": -1, "N_r|r|": -1}
_FIN_SIGNS = {"Y_uudr": 1, "N_uudr": -1, "Z_uude": -1, "M_uude": -1}
_CONFIDENCE = 0.99


def check_estimate(dataset: Dataset, estimate: Estimate, bounds: Bounds) -> list[Check]:
    """All verdicts on one estimate, those that need the truth only where there is one."""
    checks = [_finished(estimate), *data_checks(dataset, estimate.filter, list(estimate.innovations))]
    checks += [*innovation_checks(dataset, estimate), *_information(estimate)]
    checks += _against_bounds(estimate, bounds)
    checks += [*_plausibility(estimate), *_sensor_errors(estimate)]
    if dataset.truth is not None and estimate.completed:
        checks += _against_truth(estimate, dataset.truth)
    return checks


def _finished(estimate: Estimate) -> Check:
    return Check.of(
        estimate.filter,
        "run",
        "finished",
        f"{estimate.time[-1]:.6g} s",
        "to the end of the data",
        estimate.completed,
        f"{estimate.status}. Narrow the prior, start more gently, or look at that sensor at that time.",
    )


def _priors(estimate: Estimate) -> dict[str, float]:
    settings = estimate.experiment.identification
    return prior_standard_deviations(
        estimate.experiment.vehicle.size, settings.prior.factor, settings.prior.standard_deviation
    )


def _against_bounds(estimate: Estimate, bounds: Bounds) -> list[Check]:
    """Whether the filter claims more than the data hold, or got much less."""
    if not estimate.completed:
        return []
    if bounds.remark:
        advice = f"No Cramer-Rao bound: {bounds.remark}. The coefficients do not make a model of this vehicle."
        return [Check.of(estimate.filter, "coefficients", "bound", "none", "known", False, advice)]
    settings = estimate.experiment.identification
    # An earlier estimate as the prior says more than the prior that is looked at here.
    priors = _priors(estimate) if settings.prior.from_estimate is None else {}
    if estimate.filter == FilterName.OUTPUT_ERROR and not settings.output_error.use_prior:
        priors = {}
    ratio = {}
    for symbol, bound in bounds.by_symbol.items():
        if symbol in SYMBOLS:
            least = joint_deviation(bound, priors.get(symbol, np.inf))
            deviation = float(estimate.standard_deviation[-1, estimate.state.index(symbol)])
            ratio[symbol] = 1.0 if deviation == least == np.inf else deviation / least
    own = estimate.filter, "coefficients"
    checks = [
        Check.of_largest(
            *own,
            "near the bound",
            ratio,
            _LARGEST_OF_BOUND,
            "times the least standard deviation that data and prior allow",
            "The data hold more than this filter got out of them: lower the process noise, or use output_error.",
            fails=False,
        )
    ]
    if settings.prior.from_estimate is None:
        checks.append(
            Check.of_smallest(
                *own,
                "not below the bound",
                ratio,
                _LEAST_OF_BOUND,
                "times the least standard deviation that data and prior allow",
                "The filter claims more than the data hold: do not use its standard deviations. Its linearisation "
                "fails; narrow the prior, or use a sigma-point filter or output_error.",
            )
        )
    return checks


def _information(estimate: Estimate) -> list[Check]:
    """What the data added to the prior, and how much of each value is known."""
    priors = _priors(estimate)
    left, vague = {}, {}
    for i, symbol in enumerate(estimate.state):
        if symbol in SYMBOLS:
            deviation = estimate.standard_deviation[-1, i]
            left[symbol] = deviation / priors[symbol]
            vague[symbol] = deviation / abs(estimate.mean[-1, i])
    return [
        Check.of_largest(
            estimate.filter,
            "coefficients",
            "information",
            left,
            _LARGEST_SHARE,
            "of the prior's standard deviation is left",
            "The data hardly moved these: excite them, hold them at known values (`identification.coefficients`), or "
            "report them as unknown.",
        ),
        Check.of_largest(
            estimate.filter,
            "coefficients",
            "identified",
            vague,
            LARGEST_RELATIVE_DEVIATION,
            "of the value is its standard deviation",
            "The data do not determine these; do not use the numbers. A longer or livelier manoeuvre may.",
        ),
    ]


def _plausibility(estimate: Estimate) -> list[Check]:
    """Signs that physics or the convention of fin angles demands, and sizes that a body of that size can have."""
    final = {s: v for s, v in estimate.final_coefficients().items() if s in estimate.state}
    known = {
        symbol: abs(final[symbol]) > _SIGMAS * estimate.standard_deviation[-1, estimate.state.index(symbol)]
        for symbol in final
    }
    gaining = [s for s, sign in _SIGNS.items() if s in final and known[s] and final[s] * sign < 0.0]
    reversed_fins = [s for s, sign in _FIN_SIGNS.items() if s in final and known[s] and final[s] * sign < 0.0]
    size = estimate.experiment.vehicle.size
    magnitudes = {
        c.symbol: abs(final[c.symbol]) / natural_magnitude(c, size) for c in COEFFICIENTS if c.symbol in final
    }
    return [
        Check.of_names(
            estimate.filter,
            "sign of drag",
            gaining,
            "negative",
            "Drag that pushes: a sign is turned in the data or the model lacks something that these make up for.",
        ),
        Check.of_names(
            estimate.filter,
            "sign of fins",
            reversed_fins,
            "Y_uudr > 0 > N_uudr, Z_uude < 0, M_uude < 0",
            "The fin angles are counted the other way round than in the shipped vehicles (positive rudder: force to "
            "starboard at the stern): turn the sign of rudder or elevator, or keep it so wherever these are used.",
        ),
        Check.of_largest(
            estimate.filter,
            "coefficients",
            "size",
            magnitudes,
            _LARGEST_SIZE,
            "times the natural magnitude of a body of this size",
            "Too large for the vehicle: look at units, mass, length, and at what else is marked here.",
        ),
    ]


def _sensor_errors(estimate: Estimate) -> list[Check]:
    results = sensor_error_results(estimate)
    if not results:
        return []
    names = [row.state for row in results if not row.observed]
    return [
        Check.of_names(
            estimate.filter,
            "sensor errors observed",
            names,
            "less than half of the prior left",
            "This manoeuvre does not show these errors: their values are the prior's. The rest is not harmed by it.",
            fails=False,
        )
    ]


def _against_truth(estimate: Estimate, truth: TruthRecord) -> list[Check]:
    """Simulated data only: are the standard deviations honest?"""
    rows = [i for i, symbol in enumerate(estimate.state) if symbol in SYMBOLS]
    true = np.array([truth.coefficients[estimate.state[i]] for i in rows])
    error, deviation = estimate.mean[-1, rows] - true, estimate.standard_deviation[-1, rows]
    sigmas = {estimate.state[i]: e for i, e in zip(rows, np.abs(error) / deviation, strict=True)}
    covariance = estimate.covariance[np.ix_(rows, rows)] / np.outer(deviation, deviation)
    nees = float((error / deviation) @ np.linalg.solve(covariance, error / deviation))
    limit = float(chi2.ppf(_CONFIDENCE, len(rows)))
    return [
        Check.of_largest(
            estimate.filter,
            "coefficients",
            "within 3 sigma of truth",
            sigmas,
            _SIGMAS,
            "standard deviations from the truth",
            "The filter is surer of these than it should be: sensor errors that last (AHRS, bias), or wide priors.",
        ),
        Check.of(
            estimate.filter,
            "coefficients",
            "NEES",
            f"{nees:.3g}",
            f"<= {limit:.3g} (chi-squared, {len(rows)} components, {_CONFIDENCE:.0%})",
            nees <= limit,
            "The covariance of the coefficients as a whole is too small: do not trust the intervals of this run.",
        ),
    ]


def failed(checks: Sequence[Check]) -> list[Check]:
    """Those that did not pass."""
    return [check for check in checks if check.passed is False]
