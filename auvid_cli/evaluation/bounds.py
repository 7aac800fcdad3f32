"""Cramér-Rao bounds about the true or most probable motion, and the score test of the process noise."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag, solve_triangular

from auvid_cli.arrays import Array
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import Cause
from auvid_cli.errors import DataError
from auvid_cli.evaluation.innovations import LARGEST_FAULT, causes_text
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, gauss_newton
from auvid_cli.filters.noise_likelihood import noise_scores_about
from auvid_cli.filters.smoother import follow_measurements
from auvid_cli.identification.delays import delays_about
from auvid_cli.identification.information import information_at
from auvid_cli.identification.noise import process_noises
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem

_NEIGHBOURS = 8  # samples of a spline beyond its span
_FIXED_SPREAD = 1e-4  # standard deviation of a fixed parameter, relative to its prior
_MAX_PASSES = 20
# Smaller shares of information are rounding errors.
_ROUNDING = 1e-9
UNSTABLE = (
    "the motion is unstable in open loop, and after {:.3g} s its sensitivities exceed the range of floating point"
)


class ProbableMotion(NamedTuple):
    """The most probable motion with some parameters fixed, and the linear problem about it."""

    prepared: PreparedData
    augmented: AugmentedProblem
    smoothing: LinearSmoothing
    filtered: Filtered

    def motion(self) -> Callable[[Array], Array]:
        """Return the motion as a function of the times of events, shape (n, 9)."""
        rows = self.augmented.layout.moving_rows_of("motion")
        time = [timeline.time for segment in self.augmented.segments for timeline in segment.timelines]
        motion = [chunk[:, rows] for chunks in self.filtered.trajectory.moving for chunk in chunks]
        return _between(np.concatenate(time), np.concatenate(motion))


def probable_motion(prepared: PreparedData, values: Mapping[str, float]) -> ProbableMotion | None:
    """Return the most probable motion with some parameters fixed; the others, such as a current, are estimated.

    Parameters
    ----------
    values : mapping
        Fixed values of coefficients and other parameters, SI, by symbol.

    Returns
    -------
    ProbableMotion or None
        None if no motion follows the data with these values and the process noise of the settings.
    """
    augmented = augmented_problem(prepared)
    layout, prior = augmented.layout, augmented.prior
    held = [row for row, symbol in enumerate(layout.symbols[: layout.n_parameters]) if symbol in values]
    mean, factor = prior.mean.copy(), prior.factor.copy()
    mean[held] = [values[layout.symbols[row]] / layout.scale[row] for row in held]
    factor[held] *= _FIXED_SPREAD
    known = augmented.joint._replace(prior=prior._replace(mean=mean, factor=factor))
    # Other parameters, such as a current, are estimated: without them, sideslip would absorb their effect.
    if (start := follow_measurements(known)) is None or (
        found := gauss_newton(LinearSmoothing(known), start, _MAX_PASSES)
    ) is None:
        return None
    trajectory, smoothing = found[0].trajectory, LinearSmoothing(known._replace(prior=prior._replace(mean=mean)))
    parameters = trajectory.parameters.copy()
    parameters[held] = mean[held]
    filtered = smoothing.filter(replace(trajectory, parameters=parameters))
    return None if filtered is None else ProbableMotion(prepared, augmented, smoothing, filtered)


def true_motion(prepared: PreparedData) -> Callable[[Array], Array] | None:
    """Return the true motion as a function of times, shape (n, 9); None without truth."""
    truth = prepared.dataset.truth
    return None if truth is None else _between(truth.time, truth.motion)


def true_initial_motions(prepared: PreparedData) -> list[Array] | None:
    """Return the true motion at the tick nearest to the start of each segment, shape (9,); None without truth."""
    truth = prepared.dataset.truth
    if truth is None:
        return None
    starts = [segment.timelines.span[0] for segment in prepared.segments]
    return [truth.motion[np.argmin(np.abs(truth.time - start))] for start in starts]


def _between(time: Array, motion: Array) -> Callable[[Array], Array]:
    def at(times: Array) -> Array:
        # A spline of a run of hours would take more memory than the run.
        first, last = np.searchsorted(time, times[[0, -1]])
        near = slice(max(first - _NEIGHBOURS, 0), last + _NEIGHBOURS)
        return CubicSpline(time[near], motion[near])(times)

    return at


class Bounds(NamedTuple):
    """Cramer-Rao bounds of the coefficients of an estimate, SI, by symbol; empty if they are unknown."""

    of_data: dict[str, float]  # from the data alone; infinite for coefficients that the data do not determine
    # From the data and the prior, which also helps a coefficient through its correlations with others. Empty if the
    # prior is an earlier estimate.
    with_prior: dict[str, float]
    remark: str = ""  # reason if the bounds are unknown


class BoundsOf:
    """Function from an estimate to its bounds, at the true values or, without truth, at the estimated ones.

    The bounds assume white measurement noise of the stated size and no process noise. At the true values they are
    equal for all filters, so they are computed once.

    Parameters
    ----------
    prepared : PreparedData
        Data of the estimates.
    """

    def __init__(self, prepared: PreparedData) -> None:
        self._prepared = prepared
        self._bounds: dict[str, Bounds] = {}

    def __call__(self, estimate: Estimate) -> Bounds:
        """Return the bounds of an estimate, with the settings with which it was made."""
        key = estimate.experiment.model_dump_json()
        if self._prepared.dataset.truth is None:
            key += estimate.filter
        if key not in self._bounds:
            self._bounds[key] = _bounds(self._prepared, estimate)
        bounds = self._bounds[key]
        settings = estimate.experiment.identification.output_error
        if estimate.is_free_run_fit and not settings.use_prior:
            return bounds._replace(with_prior=bounds.of_data)
        return bounds


def _bounds(prepared: PreparedData, estimate: Estimate) -> Bounds:
    # The file of an earlier estimate may be gone.
    prior = estimate.experiment.identification.prior
    experiment = estimate.experiment.with_identification(prior=prior.model_copy(update={"from_estimate": None}))
    truth = prepared.dataset.truth
    known = estimate.coefficient_set.symbols
    values = estimate.final_coefficients() if truth is None else truth.coefficients_of(known)
    bounds = bounds_at(prepared.with_settings(experiment), values)
    return bounds._replace(with_prior={}) if prior.from_estimate else bounds


def bounds_at(prepared: PreparedData, values: Mapping[str, float]) -> Bounds:
    """Return the bounds at given values, with the settings of the prepared data.

    Parameters
    ----------
    values : mapping
        Values of the coefficients, by symbol, SI.
    """
    try:
        if (motion := true_motion(prepared)) is None and (about := probable_motion(prepared, values)) is not None:
            motion = about.motion()
        information = information_at(prepared, values, true_initial_motions(prepared), motion)
    except DataError as error:
        return Bounds({}, {}, str(error))
    if information.lost_after is not None:
        return Bounds({}, {}, UNSTABLE.format(information.lost_after))
    return Bounds(information.bound(), information.bound_with_prior())


class DataInformation(NamedTuple):
    """Information of the data about parameters, without the prior, with process noise."""

    # Coefficients, then constant errors of sensors and actuators, then estimated delays
    symbols: tuple[str, ...]
    matrix: Array  # shape (n, n); in units of the prior's standard deviations
    prior_std: Array  # shape (n,); SI

    def bound(self, held: Collection[str] = ()) -> dict[str, float]:
        """Return the bound of each parameter, SI, with those in `held` known; infinite if the data do not show it."""
        kept = [place for place, symbol in enumerate(self.symbols) if symbol not in held]
        values, directions = np.linalg.eigh(self.matrix[np.ix_(kept, kept)])
        informed, squares = values > _ROUNDING, directions**2
        variance = squares[:, informed] @ (1.0 / values[informed])
        variance[(squares[:, ~informed] > _ROUNDING).any(axis=1)] = np.inf
        deviation = self.prior_std[kept] * np.sqrt(variance)
        return {self.symbols[place]: float(size) for place, size in zip(kept, deviation, strict=True)}


def bounds_with_process_noise(prepared: PreparedData, reference: Estimate) -> dict[str, float]:
    """Return the bound of each coefficient with process noise, by symbol, SI.

    A linear smoother about the most probable trajectory has the smallest covariance ``P`` of all estimators with the
    prior ``P0``. The information of the data alone is ``P^-1 - P0^-1``, which needs no sensitivities of a free motion.
    The bound is infinite for a coefficient that the data do not determine.

    Parameters
    ----------
    prepared : PreparedData
        Data of the estimate.
    reference : Estimate
        Estimate of the smoother.
    """
    problem = augmented_problem(prepared.with_settings(reference.experiment))
    n = problem.layout.n_parameters
    known = problem.layout.symbols[:n], problem.layout.scale[:n, None] * problem.prior.factor[:n, :n]
    bound = _beyond_prior(*known, reference.covariance[:n, :n]).bound()
    return {symbol: size for symbol, size in bound.items() if symbol in reference.coefficient_set.symbols}


def information_with_process_noise(about: ProbableMotion) -> DataInformation:
    """Return the information of the data with process noise, about the most probable motion with fixed coefficients.

    Parameters
    ----------
    about : ProbableMotion
        With all estimated coefficients fixed.
    """
    layout, filtered = about.augmented.layout, about.filtered
    n = layout.n_parameters
    covariance = filtered.final.covariance()[:n, :n] * np.outer(layout.scale[:n], layout.scale[:n])
    symbols, factor = layout.symbols[:n], layout.scale[:n, None] * about.augmented.prior.factor[:n, :n]
    if delays := delays_about(about.prepared, about.augmented, about.smoothing, filtered):
        spread = about.prepared.experiment.identification.estimate.delay.spread
        factor = np.asarray(block_diag(factor, spread * np.eye(len(delays.symbols))), dtype=np.float64)
        symbols, covariance = (*symbols, *delays.symbols), delays.joint(covariance)
    return _beyond_prior(symbols, factor, covariance)


def _beyond_prior(symbols: tuple[str, ...], factor: Array, covariance: Array) -> DataInformation:
    """Return the information of a posterior covariance, SI, minus that of the prior, given as a factor."""
    whitened = solve_triangular(factor, solve_triangular(factor, covariance, lower=True).T, lower=True)
    left, directions = np.linalg.eigh(0.5 * (whitened + whitened.T))
    # Share of the prior's variance that is left in each direction; 1 means no information.
    known = np.where(left < 1.0 - _ROUNDING, 1.0 - left, 0.0)
    prior_std = np.linalg.norm(factor, axis=1)
    rows = solve_triangular(factor, np.diag(prior_std), lower=True).T @ directions
    return DataInformation(symbols, (rows * (known / left)) @ rows.T, prior_std)


def efficiency_warning(prepared: PreparedData, estimate: Estimate, causes: list[Cause]) -> str:
    """Return the likely reason why standard deviations are far above the bound, as a sentence.

    It calls the process noise too large only if a score test shows this.

    Parameters
    ----------
    prepared : PreparedData
        Data of the estimate.
    causes : list of Cause
        Likely causes of the innovations.
    """
    if causes:
        return f"Process noise costs information, and is needed. Likely causes: {causes_text(causes)}."
    score = process_noise_score(prepared, estimate) or 0.0
    by = f"by {abs(score):.0f} sigma (`auvid tune` finds how much)"
    if score < -LARGEST_FAULT:
        return f"The stated process noise is too large {by}: lower it."
    if score > LARGEST_FAULT:
        return f"Process noise costs information, and is needed: the stated one is too small {by}."
    return (
        "Process noise costs information, and its stated size agrees with these data: record more data or stronger "
        "manoeuvres; do not lower the process noise."
    )


def process_noise_score(prepared: PreparedData, estimate: Estimate) -> float | None:
    """Return Rao's score statistic of the logarithm of all process noise, about the trajectory of an estimate.

    Parameters
    ----------
    prepared : PreparedData
        Data of the estimate.

    Returns
    -------
    float or None
        Standard deviations: positive if the noise is too small, negative if too large. None without information.
    """
    own = prepared.with_settings(estimate.experiment)
    if (about := probable_motion(own, dict(zip(estimate.state, estimate.mean[-1], strict=True)))) is None:
        return None
    groups = [noise.group for noise in process_noises(about.augmented, estimate.experiment.identification)]
    scores = noise_scores_about(about.augmented.joint, groups, about.filtered.trajectory)
    if scores is None or (information := float(scores.information.sum())) <= 0.0:
        return None
    return float(scores.slope.sum() / np.sqrt(information))
