"""Delays of inputs and sensors, estimated together with the coefficients by maximum likelihood.

A delay shifts times and is therefore not a state of a filter. The score test of a late sensor or input gives the
gradient and the information of the profile likelihood, with coefficients and motion at their optimum. Gauss-Newton
steps, each with a new fit of the smoother, lead to the zero of the score.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import sqrt
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import DELAYS
from auvid_cli.config.identification import INPUTS_DELAY
from auvid_cli.data.dataset import InputRecord
from auvid_cli.errors import DataError
from auvid_cli.filters.fault_scores import score_faults
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing
from auvid_cli.filters.problem import FaultScores
from auvid_cli.filters.signatures import Signatures
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.prepared_data import FoundDelays, PreparedData
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem

# Rudder and elevator are the first inputs.
_N_FINS = 2
_MAX_STEPS = 15
# Converged when the Newton step is below this share of the standard deviation.
_TOLERANCE = 0.1
_MAX_HALVINGS = 4
# Allowed increase of the cost per event in a step, because shifted data begin and end elsewhere.
_COST_TOLERANCE = 1e-3
# Largest factor on a Newton step. Far from the optimum coefficients compensate for a delay, and Newton steps are short.
_MAX_STEP_FACTOR = 3.0
_RESOLUTION = 1e-7  # s, rounding of delays in the settings


class _Fit(NamedTuple):
    """Fit of the smoother with given delays."""

    cost: float  # twice the negative log-likelihood per event, up to a constant
    scores: FaultScores
    scale: Array  # shape (n_parameters,); SI value of one unit of each parameter


def estimate_delays(prepared: PreparedData) -> PreparedData:
    """Return the data with settings that state the estimated delays.

    Parameters
    ----------
    prepared : PreparedData
        Delays in the settings are prior means, with the standard deviation `identification.estimate.delay.spread`.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If a sensor is missing, or the delays do not converge.
    """
    settings = prepared.experiment.identification
    names, symbols = _estimated(prepared)
    if not names:
        return prepared
    spread = settings.estimate.delay.spread
    stated = np.array([settings.delays.get(name, 0.0) for name in names])

    def fit(delays: Array) -> _Fit | None:
        return _fit(_with_delays(prepared, names, delays), symbols)

    of_inputs = unrecorded_time(prepared.dataset.inputs)
    unrecorded = np.array([of_inputs if name == INPUTS_DELAY else 0.0 for name in names])
    optimum = _gauss_newton(fit, stated, spread, unrecorded)
    if optimum is None:
        raise DataError(
            f"the delay of {', '.join(names)} did not converge: interpolate inputs "
            "(identification.inputs.between=linear), estimate fewer (identification.estimate.delay.of; a common delay "
            "of all is not observable), check signs and gaps (auvid inspect), or state it (identification.delays)"
        )
    delays, at_optimum = optimum
    return replace(_with_delays(prepared, names, delays), delays=_found(prepared, delays, at_optimum))


def delays_about(
    prepared: PreparedData, problem: AugmentedProblem, smoothing: LinearSmoothing, filtered: Filtered
) -> FoundDelays | None:
    """Return the delays with their covariance about a trajectory; None if settings estimate none."""
    names, symbols = _estimated(prepared)
    if not names:
        return None
    scores = score_faults(Signatures(problem.joint, smoothing, filtered, VehicleFaults(problem, symbols, tested=())))
    fit = _Fit(filtered.cost, scores, problem.layout.scale[: problem.layout.n_parameters])
    return _found(prepared, np.array([prepared.experiment.identification.delays.get(name, 0.0) for name in names]), fit)


def _estimated(prepared: PreparedData) -> tuple[list[str], tuple[str, ...]]:
    """Return the keys and the symbols of the delays to estimate."""
    blocks = prepared.experiment.identification.estimate.blocks()
    symbols = tuple(block.name for block in blocks if block.is_delay)
    names = [name for name, delay in DELAYS.items() if delay.symbol in symbols]
    if missing := [name for name in names if name not in (INPUTS_DELAY, *prepared.measuring)]:
        raise DataError(
            f"identification.estimate.delay.of: {missing[0]} is not used with these data; expected "
            f"{', '.join((INPUTS_DELAY, *prepared.measuring))}"
        )
    return names, symbols


def _found(prepared: PreparedData, delays: Array, fit: _Fit) -> FoundDelays:
    names, symbols = _estimated(prepared)
    covariance = _covariance(fit, prepared.experiment.identification.estimate.delay.spread)
    if INPUTS_DELAY in names:
        place = names.index(INPUTS_DELAY)
        covariance[place, place] += unrecorded_time(prepared.dataset.inputs) ** 2
    return FoundDelays(symbols, delays, covariance, fit.scale[:, None] * fit.scores.effect)


def unrecorded_time(inputs: InputRecord) -> float:
    """Return the standard deviation of the time at which fins moved, s: they may move at any time between two samples.

    One change within an interval T has the standard deviation ``T / sqrt(12)``; for the mean of many it falls with the
    effective number of changes, weighted by their squares.
    """
    changes = np.square(np.diff(inputs.values[:, :_N_FINS], axis=0)).sum(axis=1)
    if not changes.any():
        return 0.0
    effective_number = float(changes.sum()) ** 2 / float(np.square(changes).sum())
    return float(np.median(np.diff(inputs.time))) / sqrt(12.0 * effective_number)


def _gauss_newton(
    fit: Callable[[Array], _Fit | None], stated: Array, spread: float, unrecorded: Array
) -> tuple[Array, _Fit] | None:
    """Return the most probable delays and their fit; None without convergence."""
    delays, current = _start(fit, stated, spread)
    previous_newton, step = np.zeros(stated.size), np.zeros(stated.size)
    for _ in range(_MAX_STEPS):
        if current is None:
            return None
        covariance = _covariance(current, spread)
        newton = covariance @ (current.scores.score - (delays - stated) / spread**2)
        if (np.abs(newton) <= _TOLERANCE * np.hypot(unrecorded, np.sqrt(np.diagonal(covariance)))).all():
            return delays, current
        # Secant: the last step divided by the decrease of the Newton step that it caused.
        decrease = previous_newton - newton
        factor = np.divide(step, decrease, out=np.ones(step.size), where=decrease != 0.0)
        step = np.clip(newton * np.clip(factor, 1.0, _MAX_STEP_FACTOR), -spread, spread)
        previous_newton, trial = newton, fit(delays + step)
        for _ in range(_MAX_HALVINGS):
            if trial is not None and trial.cost < current.cost + _COST_TOLERANCE:
                break
            step = 0.5 * step
            trial = fit(delays + step)
        delays, current = delays + step, trial
    return None


def _start(fit: Callable[[Array], _Fit | None], stated: Array, spread: float) -> tuple[Array, _Fit | None]:
    """Return the most likely of the stated delays and those one `spread` away, one delay after the other."""
    best, best_fit = stated, fit(stated)
    for row in np.eye(stated.size):
        for delays in (best - spread * row, best + spread * row):
            other = fit(delays)
            if other is not None and (best_fit is None or other.cost < best_fit.cost):
                best, best_fit = delays, other
    return best, best_fit


def _covariance(fit: _Fit, spread: float) -> Array:
    information = fit.scores.information + np.eye(fit.scores.score.size) / spread**2
    return np.asarray(np.linalg.inv(information), dtype=np.float64)


def _with_delays(prepared: PreparedData, names: Sequence[str], delays: Array) -> PreparedData:
    stated = dict(zip(names, (np.rint(delays / _RESOLUTION) * _RESOLUTION).tolist(), strict=True))
    return prepared.with_identification(delays={**prepared.experiment.identification.delays, **stated})


def _fit(prepared: PreparedData, symbols: Sequence[str]) -> _Fit | None:
    """Run the smoother with the delays of the settings; None if no trajectory follows the data."""
    settings = prepared.experiment.identification
    max_passes, augmented = settings.smoother.max_passes, augmented_problem(prepared)
    problem = augmented.joint
    smoothing, faults = LinearSmoothing(problem), VehicleFaults(augmented, symbols, tested=())
    optima = most_probable(problem, smoothing, max_passes)
    if not optima:
        return None
    (filtered, _), score = optima[0], score_faults
    if settings.is_marginal:
        # Imported here because only the marginal estimate needs this compiled code.
        from auvid_cli.filters.marginal import marginal_estimate
        from auvid_cli.filters.marginal_gradient import marginal_scores

        marginal = marginal_estimate(problem, smoothing, filtered, max_passes)
        if marginal is None:
            return None
        problem, filtered, _ = marginal
        score = marginal_scores
    scores = score(Signatures(problem, smoothing, filtered, faults))
    events = sum(len(chunk) for segment in filtered.trajectory.moving for chunk in segment)
    cost = (filtered.least + filtered.log_determinant) / events
    return _Fit(cost, scores, augmented.layout.scale[: problem.n_parameters])
