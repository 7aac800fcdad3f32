"""Checks of an estimate against data, geometry and other estimates."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import chdtri

from auvid_cli.data.checks import Check, Checks
from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import Cause
from auvid_cli.evaluation.accuracy import (
    LARGEST_SHARE_OF_VALUE,
    normalised_estimation_error,
    sensor_error_results,
    shares_of_prior,
    shares_of_value,
)
from auvid_cli.evaluation.bounds import Bounds, efficiency_warning
from auvid_cli.evaluation.innovations import causes_text, innovation_checks, likely_causes
from auvid_cli.evaluation.judgement import Grade, Judgement, judge, reference_among, reversed_fins, wrong_drag_signs
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.states import natural_magnitude
from auvid_cli.inspection.inspection import data_checks

_GEOMETRY_SIGMAS = 4.0
_LARGEST_SHARE = 0.5  # share of the prior's standard deviation that may be left
# Ratio of a standard deviation to the bound. Below 1 is possible, because the bound holds at the true values and a
# filter linearises.
_MIN_OF_BOUND = 0.8
_MAX_OF_BOUND = 3.0
_AT_LIMIT = 0.01  # standard deviations; a fit this close to a limit ended there
_LARGEST_SIZE = 30.0  # largest coefficient, in natural magnitudes of a body of this size
_SIGNIFICANT = 3.0
# Name of the check that repeats the judgement.
JUDGED = "sound"
_CONFIDENCE = 0.99
_OTHER_BOUND = "The bound holds at the true values, and the fit is far from them."


def near_its_geometry(estimate: Estimate) -> list[Check]:
    """Compare the estimated coefficients with values derived from hull and fins, if the vehicle file states these.

    A difference of more than four standard deviations (of both together) is a note: the drawing may be wrong too.
    """
    derived = {each.name: each for each in estimate.experiment.vehicle.derived_values()}
    distances = {
        symbol: float(
            abs(estimate.mean[-1, i] - derived[symbol].mean)
            / np.hypot(derived[symbol].standard_deviation, estimate.standard_deviation[-1, i])
        )
        for i, symbol in enumerate(estimate.state)
        if symbol in derived
    }
    if not distances:
        return []
    return [
        Check.of_values(
            estimate.filter,
            "coefficients",
            "plausible size",
            distances,
            limit=_GEOMETRY_SIGMAS,
            unit="sd",
            meaning="from the value derived from hull and fins",
            advice="Check the geometry in the vehicle file, units and signs, and the other marked checks; if all "
            "are right, the drawing is wrong: keep the estimate.",
            fails=False,
        )
    ]


def check_estimates(
    prepared: PreparedData, estimates: Sequence[Estimate], bounds_of: Callable[[Estimate], Bounds]
) -> Checks:
    """Return all checks of estimates of the same data, which are judged against each other."""
    judgements, reference = judge(estimates), reference_among(estimates)
    causes_of_all = None if reference is None else likely_causes(reference)
    return Checks(
        verdict
        for estimate in estimates
        for verdict in check_estimate(
            prepared,
            estimate,
            bounds_of(estimate),
            judgements[estimate.filter],
            likely_causes(estimate) if causes_of_all is None else causes_of_all,
        )
    )


def check_estimate(
    prepared: PreparedData, estimate: Estimate, bounds: Bounds, judgement: Judgement, causes: list[Cause]
) -> list[Check]:
    """Return all checks of an estimate; if it was not completed, only those of data and innovations.

    Parameters
    ----------
    bounds : Bounds
        Bounds of its coefficients.
    causes : list of Cause
        Likely causes of the innovations, from the smoother if there is one.
    """
    dataset = prepared.dataset
    used = [segment.dataset for segment in prepared.with_settings(estimate.experiment).segments]
    checks = [
        _finished(estimate),
        _sound(estimate, judgement),
        *data_checks(used, estimate.filter, list(estimate.innovations)),
    ]
    checks += [*innovation_checks(dataset, estimate), _unexplained(estimate, causes)]
    if not estimate.completed:
        return checks
    checks += [*_information(estimate, dataset.truth, bounds), *_against_bounds(prepared, estimate, bounds, causes)]
    checks += [*_at_limits(estimate), *_plausibility(estimate)]
    checks += _sensor_errors(estimate)
    # The true values show more than values derived from a drawing.
    checks += near_its_geometry(estimate) if dataset.truth is None else _against_truth(estimate, dataset.truth)
    return checks


def _finished(estimate: Estimate) -> Check:
    advice = "Narrow the prior, start with a gentler manoeuvre, or check that sensor at that time."
    if estimate.is_free_run_fit:
        advice = "The data do not determine the model, or it is unstable in open loop: use a filter, or a prior."
    return Check.of(
        estimate.filter,
        "run",
        "finished",
        statistic=f"{estimate.time[-1]:.6g} s",
        threshold="to the end of the data",
        passed=None if estimate.note else estimate.completed,
        advice=f"It {estimate.note}." if estimate.note else f"{estimate.status}. {advice}",
    )


def _sound(estimate: Estimate, judgement: Judgement) -> Check:
    """Return the judgement as a check: a note if the estimate is unjudged."""
    return Check.of(
        estimate.filter,
        "coefficients",
        JUDGED,
        statistic=str(judgement.grade),
        threshold=str(Grade.SOUND),
        passed=None if judgement.grade is Grade.UNJUDGED else judgement.grade is Grade.SOUND,
        advice=f"{judgement.advice}.",
    )


def _unexplained(estimate: Estimate, causes: list[Cause]) -> Check:
    """Check whether another cause explains the innovations better than the stated noise."""
    return Check.of(
        estimate.filter,
        "innovations",
        "explained by noise",
        statistic=f"{causes[0].name}, +{causes[0].gain:.0f} in log-likelihood" if causes else "no more likely cause",
        threshold="no more likely cause",
        passed=None if causes else True,
        advice=f"Likely causes: {causes_text(causes)}.",
    )


def _against_bounds(prepared: PreparedData, estimate: Estimate, bounds: Bounds, causes: list[Cause]) -> list[Check]:
    """Check the standard deviations against the bounds."""
    if bounds.remark:
        return [
            Check.of(
                estimate.filter,
                "coefficients",
                "bound",
                statistic="none",
                threshold="known",
                passed=None,
                advice=f"{bounds.remark}.",
            )
        ]
    ratio, known = {}, estimate.coefficient_set.symbols
    for symbol, least in bounds.with_prior.items():
        if symbol in known:
            deviation = float(estimate.standard_deviation[-1, estimate.state.index(symbol)])
            ratio[symbol] = 1.0 if deviation == least == np.inf else deviation / least
    if not ratio:
        return []
    meaning = "the least standard deviation that data and prior allow"
    above = ""
    if max(ratio.values()) > _MAX_OF_BOUND:
        above = _OTHER_BOUND if estimate.is_free_run_fit else efficiency_warning(prepared, estimate, causes)
    below = (
        "The standard deviations are smaller than the data allow: do not use them. The linearisation of the filter "
        "fails; narrow the prior, or use a sigma-point filter or output_error."
    )
    if estimate.is_free_run_fit:
        below = _OTHER_BOUND
    return [
        Check.of_values(
            estimate.filter,
            "coefficients",
            "near the bound",
            ratio,
            limit=_MAX_OF_BOUND,
            unit="times",
            meaning=meaning,
            advice=above,
            fails=False,
        ),
        Check.of_values(
            estimate.filter,
            "coefficients",
            "not below the bound",
            ratio,
            limit=_MIN_OF_BOUND,
            unit="times",
            meaning=meaning,
            advice=below,
            is_least=True,
        ),
    ]


def _at_limits(estimate: Estimate) -> list[Check]:
    """Check that no coefficient of a free-run fit is at a limit of `identification.output_error.bounds`."""
    limits = estimate.experiment.identification.output_error.bounds
    if not estimate.is_free_run_fit or not limits:
        return []
    held = []
    for symbol, interval in limits.items():
        i = estimate.state.index(symbol)
        distance = np.abs(estimate.mean[-1, i] - np.array(interval)).min()
        if distance < _AT_LIMIT * estimate.standard_deviation[-1, i]:
            held.append(symbol)
    advice = (
        "These values are limits in `identification.output_error.bounds`, not estimates, and their standard "
        "deviations ignore the limits. Widen the limits, or find out why the data exceed them."
    )
    return [Check.of_names(estimate.filter, "within its limits", held, threshold="none at a limit", advice=advice)]


def _information(estimate: Estimate, truth: TruthRecord | None, bounds: Bounds) -> list[Check]:
    """Check the information gained over the prior, and the relative uncertainty."""
    return [
        Check.of_values(
            estimate.filter,
            "coefficients",
            "information",
            shares_of_prior(estimate),
            limit=_LARGEST_SHARE,
            meaning="of the prior's standard deviation is left",
            advice="The data add little to the prior: excite these coefficients, fix them at known values "
            "(`identification.coefficients`), or report them as unknown or as known from the earlier estimate.",
        ),
        Check.of_values(
            estimate.filter,
            "coefficients",
            "identified",
            shares_of_value(estimate, truth, bounds.of_data),
            limit=LARGEST_SHARE_OF_VALUE,
            meaning="of the value",
            advice="The data do not determine these; do not use the values. Try a longer or stronger manoeuvre.",
        ),
    ]


def _plausibility(estimate: Estimate) -> list[Check]:
    """Check the signs of drag and fin coefficients, and all sizes against the natural magnitude."""
    final = {s: v for s, v in estimate.final_coefficients().items() if s in estimate.state}
    size = estimate.experiment.vehicle.size
    magnitudes = {
        c.symbol: abs(final[c.symbol]) / natural_magnitude(c, size)
        for c in estimate.coefficient_set
        if c.symbol in final
    }
    return [
        Check.of_names(
            estimate.filter,
            "sign of drag",
            wrong_drag_signs(estimate, _SIGNIFICANT),
            threshold="negative",
            advice="Drag coefficients have the wrong sign: a sign in the data is wrong, or these replace a term that "
            "the model lacks.",
        ),
        Check.of_names(
            estimate.filter,
            "sign of fins",
            reversed_fins(estimate, _SIGNIFICANT),
            threshold="Y_uudr > 0 > N_uudr, Z_uude < 0, M_uude < 0",
            advice="The sign convention of the fins is opposite to the shipped vehicles (positive rudder: force to "
            "starboard at the stern): change the sign of rudder or elevator, or use the same convention wherever you "
            "use these coefficients.",
        ),
        Check.of_values(
            estimate.filter,
            "coefficients",
            "size",
            magnitudes,
            limit=_LARGEST_SIZE,
            unit="times",
            meaning="the natural magnitude of a body of this size",
            advice="Too large for the vehicle: check units, mass, length, and the other marked checks.",
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
            threshold="at most half of the prior standard deviation",
            advice="These errors are not observable in this manoeuvre: do not use their values.",
            fails=False,
        )
    ]


def _against_truth(estimate: Estimate, truth: TruthRecord) -> list[Check]:
    """Check the standard deviations against the true errors of simulated data."""
    rows = estimate.coefficient_rows
    true = np.array([*truth.coefficients_of(estimate.state[i] for i in rows).values()])
    error, deviation = estimate.mean[-1, rows] - true, estimate.standard_deviation[-1, rows]
    sigmas = {estimate.state[i]: e for i, e in zip(rows, np.abs(error) / deviation, strict=True)}
    nees = normalised_estimation_error(estimate, truth)
    limit = float(chdtri(len(rows), 1.0 - _CONFIDENCE))
    return [
        Check.of_values(
            estimate.filter,
            "coefficients",
            "within 3 sigma of truth",
            sigmas,
            limit=_SIGNIFICANT,
            unit="sd",
            meaning="from the truth",
            advice="The standard deviations are too small: sensor errors are correlated in time (AHRS, bias), or the "
            "prior is too wide.",
        ),
        Check.of(
            estimate.filter,
            "coefficients",
            "NEES",
            statistic=f"{nees:.3g}",
            threshold=f"<= {limit:.3g} (chi-squared, {len(rows)} components, {_CONFIDENCE:.0%})",
            passed=nees <= limit,
            advice="The covariance of the coefficients as a whole is too small: do not trust the intervals of this "
            "run.",
        ),
    ]
