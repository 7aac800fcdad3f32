"""Delays of inputs and sensors, as they make the data most probable with all else that is estimated.

A delay moves times, of which no filter can make a state. But the score test of a late sensor or input says how much
later it is than stated, and with what information, coefficients and motion having taken up what they can. That is a
Gauss-Newton step on the profile of the likelihood: the delay is stated anew, the smoother fits anew, until the score is
none.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import DELAYS
from auvid_cli.config.identification import INPUTS_DELAY
from auvid_cli.data.dataset import InputRecord
from auvid_cli.errors import DataError
from auvid_cli.filters.fault_scores import score_faults
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing
from auvid_cli.filters.problem import FaultScores
from auvid_cli.filters.smoother import most_probable
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.prepared_data import FoundDelays, PreparedData
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem

Array = NDArray[np.float64]

# Rudder and elevator are the first of the inputs.
_FINS = 2
# Steps at most, the share of its standard deviation that is no step any more, and how often one is halved that goes too
# far: the cost may be so much higher, for the data have other ends.
_ROUNDS, _SMALL, _HALVINGS, _HIGHER = 15, 0.1, 4, 1e-3
# Times as far as the linear problem has it a step may go: far from the answer coefficients make up for a delay.
_LONGEST = 3.0
# s; in which delays are stated.
_RESOLUTION = 1e-7


class _Fit(NamedTuple):
    """What the smoother makes of the data with some delays.

    Attributes
    ----------
    cost : float
        Twice the negative log-likelihood of the data, per event, but for a constant.
    scores : FaultScores
    scale : ndarray, shape (n_parameters,)
        SI value of one unit of each parameter.
    """

    cost: float
    scores: FaultScores
    scale: Array


def estimate_delays(prepared: PreparedData) -> PreparedData:
    """Find the delays that settings ask for, and return the data with settings that state them.

    Parameters
    ----------
    prepared : PreparedData
        Settings may state delays to begin with, about which those that are sought are known by their `spread`.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If a sensor is missing, or no delay is found.
    """
    settings = prepared.experiment.identification
    names, symbols = _sought(prepared)
    if not names:
        return prepared
    spread = settings.estimate.delay.spread
    stated = np.array([settings.delays.get(name, 0.0) for name in names])

    def fit(delays: Array) -> _Fit | None:
        return _fit(_with_delays(prepared, names, delays), symbols)

    of_inputs = unrecorded_time(prepared.dataset.inputs)
    answer = _settled(fit, stated, spread, np.array([of_inputs if name == INPUTS_DELAY else 0.0 for name in names]))
    if answer is None:
        raise DataError(
            f"no delay of {', '.join(names)} explains these data best: join inputs by straight lines "
            "(identification.inputs.between=linear), seek fewer (identification.estimate.delay.of; one of all together "
            "nothing tells), look at signs and gaps (auvid inspect), or state it (identification.delays)"
        )
    delays, found = answer
    settled = _with_delays(prepared, names, delays)
    return replace(settled, delays=_found(prepared, delays, found))


def delays_about(
    prepared: PreparedData, problem: AugmentedProblem, smoothing: LinearSmoothing, filtered: Filtered
) -> FoundDelays | None:
    """Say how well data can tell the delays that settings ask for, about a trajectory; None if they ask for none."""
    names, symbols = _sought(prepared)
    if not names:
        return None
    scores = score_faults(smoothing, filtered, VehicleFaults(problem, symbols, tested=()))
    fit = _Fit(filtered.cost, scores, problem.layout.scale[: problem.layout.n_parameters])
    return _found(prepared, np.array([prepared.experiment.identification.delays.get(name, 0.0) for name in names]), fit)


def _sought(prepared: PreparedData) -> tuple[list[str], tuple[str, ...]]:
    """Return the keys and the symbols of delays that settings ask for.

    Raises
    ------
    DataError
        If one is that of a sensor that is not there.
    """
    blocks = prepared.experiment.identification.estimate.blocks()
    symbols = tuple(block.name for block in blocks if block.shifts)
    names = [name for name, delay in DELAYS.items() if delay.symbol in symbols]
    if missing := [name for name in names if name not in (INPUTS_DELAY, *prepared.measuring)]:
        raise DataError(
            f"identification.estimate.delay.of has {missing[0]}, of which estimators hear nothing in these data"
        )
    return names, symbols


def _found(prepared: PreparedData, delays: Array, fit: _Fit) -> FoundDelays:
    names, symbols = _sought(prepared)
    covariance = _covariance(fit, prepared.experiment.identification.estimate.delay.spread)
    if INPUTS_DELAY in names:
        place = names.index(INPUTS_DELAY)
        covariance[place, place] += unrecorded_time(prepared.dataset.inputs) ** 2
    return FoundDelays(symbols, delays, covariance, fit.scale[:, None] * fit.scores.effect)


def unrecorded_time(inputs: InputRecord) -> float:
    """Return how unsure the time is at which fins moved, for they may have done so at any time between two samples, s.

    A change is known to have come within an interval T, which is a standard deviation of ``T / sqrt(12)``; of many
    changes the mean counts, as many as make up most of all the movement.
    """
    changes = np.square(np.diff(inputs.values[:, :_FINS], axis=0)).sum(axis=1)
    if not changes.any():
        return 0.0
    many = float(changes.sum()) ** 2 / float(np.square(changes).sum())
    return float(np.median(np.diff(inputs.time))) / sqrt(12.0 * many)


def _settled(
    fit: Callable[[Array], _Fit | None], stated: Array, spread: float, unrecorded: Array
) -> tuple[Array, _Fit] | None:
    """Go to where nothing speaks for another delay, and what is known beforehand counts; None if nowhere is."""
    delays, found = _start(fit, stated, spread)
    newton_before, step = np.zeros(stated.size), np.zeros(stated.size)
    for _ in range(_ROUNDS):
        if found is None:
            return None
        covariance = _covariance(found, spread)
        newton = covariance @ (found.scores.score - (delays - stated) / spread**2)
        if (np.abs(newton) <= _SMALL * np.hypot(unrecorded, np.sqrt(np.diagonal(covariance)))).all():
            return delays, found
        step = np.clip(newton * _lengthening(newton_before, newton, step), -spread, spread)
        newton_before, ahead = newton, fit(delays + step)
        for _ in range(_HALVINGS):
            if ahead is not None and ahead.cost < found.cost + _HIGHER:
                break
            step = 0.5 * step
            ahead = fit(delays + step)
        delays, found = delays + step, ahead
    return None


def _start(fit: Callable[[Array], _Fit | None], stated: Array, spread: float) -> tuple[Array, _Fit | None]:
    """Choose what the data are likeliest with of the stated delays and others that may well be, one after the other."""
    best, found = stated, fit(stated)
    for row in np.eye(stated.size):
        for delays in (best - spread * row, best + spread * row):
            other = fit(delays)
            if other is not None and (found is None or other.cost < found.cost):
                best, found = delays, other
    return best, found


def _lengthening(newton_before: Array, newton: Array, step: Array) -> Array:
    """Find how many times as far as the last two Newton steps, and what was gone between, let the next one go."""
    nearer = newton_before - newton
    secant = np.divide(step, nearer, out=np.ones(step.size), where=nearer != 0.0)
    return np.asarray(np.clip(secant, 1.0, _LONGEST), dtype=np.float64)


def _covariance(found: _Fit, spread: float) -> Array:
    information = found.scores.information + np.eye(found.scores.score.size) / spread**2
    return np.asarray(np.linalg.inv(information), dtype=np.float64)


def _with_delays(prepared: PreparedData, names: Sequence[str], delays: Array) -> PreparedData:
    experiment = prepared.experiment
    stated = dict(zip(names, (np.rint(delays / _RESOLUTION) * _RESOLUTION).tolist(), strict=True))
    identification = experiment.identification.model_copy(
        update={"delays": {**experiment.identification.delays, **stated}}
    )
    return prepared.with_settings(experiment.model_copy(update={"identification": identification}))


def _fit(prepared: PreparedData, symbols: Sequence[str]) -> _Fit | None:
    """Fit all but the delays; None where nothing follows the data with these."""
    settings = prepared.experiment.identification
    max_passes, augmented = settings.smoother.max_passes, augmented_problem(prepared)
    problem = augmented.joint
    smoothing, faults = LinearSmoothing(problem), VehicleFaults(augmented, symbols, tested=())
    answers = most_probable(problem, smoothing, max_passes)
    if not answers:
        return None
    (answer, _), score = answers[0], score_faults
    if settings.is_marginal:
        # Its compiled code serves no other estimate.
        from auvid_cli.filters.marginal import marginal_estimate, marginal_scores

        found = marginal_estimate(problem, smoothing, answer, max_passes)
        if found is None:
            return None
        problem, answer, _ = found
        score = partial(marginal_scores, problem)
    scores = score(smoothing, answer, faults)
    events = sum(len(chunk) for segment in answer.trajectory.moving for chunk in segment)
    cost = (answer.least + answer.log_determinant) / events
    return _Fit(cost, scores, augmented.layout.scale[: problem.n_parameters])
