"""Search for the most likely process and measurement noise.

Noise and trajectory are improved in turn. The likelihood about a trajectory is maximised over the logarithms of noise
factors by scoring, with the derivatives from `auvid_cli.filters.noise_scores`. Then the trajectory takes a step towards
the marginal estimate. The parameters of the most probable trajectory are biased, because its cost lacks ``log S``.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.filters.linear_smoother import Filtered, Trajectory
from auvid_cli.filters.noise_likelihood import NoiseLikelihood, NoiseProgress, OnPass, log_likelihood
from auvid_cli.filters.noise_scores import NoiseGroup
from auvid_cli.filters.problem import JointProblem

# Largest change of log factors between two trajectories at convergence, in standard deviations: a tenth of the width of
# a 95 % interval.
_MAX_CHANGE = 0.4
# Approximate maximum step of log factors.
_MAX_STEP = 2.0
# Largest log factor.
_MAX_LOG_FACTOR = 14.0
# Relative tolerance with which the log-likelihood decreases by `_INTERVAL_DECREASE` at the end of an interval.
_DECREASE_TOLERANCE = 0.1
# Maximum number of evaluations to find that end.
_MAX_EVALUATIONS = 16
# Smallest share of that decrease in one extrapolation; the added variance then grows at most 1000 times.
_MIN_SHARE = 1e-6
# Maximum number of trajectories of one search.
MAX_TRAJECTORIES = 15
# Approximate share of the whole search that precedes the intervals.
_SEARCH_SHARE = 0.75
# Ratio of the remaining shares after and before a trajectory.
_REMAINING = 0.5
# Maximum number of steps of one climb.
_MAX_STEPS = 40
# Negligible information, which keeps matrices invertible.
_MIN_INFORMATION = 1e-9
# Smallest product of slope and step that is worth another step; the log-likelihood increases by about half of it.
_MIN_INCREASE = 0.01
# Smallest such product in a coarse search.
_COARSE_INCREASE = 0.3
# Largest gain in the log of the marginal posterior by the last step of the trajectory at convergence, and largest last
# change of the log-likelihood of a coarse search.
_MAX_GAIN = 1.0
# Largest increase of minus twice the log of the marginal posterior between two trajectories. Incomplete convergence of
# the motion causes smaller increases.
_MAX_INCREASE = 30.0
# Number of rejections of new noise at which a search ends.
_MAX_REJECTIONS = 2
# Number of trajectories without a larger likelihood after which a coarse search ends.
_PATIENCE = 2
# Decrease of the log-likelihood at the ends of a 95 % interval.
_INTERVAL_DECREASE = 1.92
# Half width of a 95 % interval, in standard deviations.
_INTERVAL_DEVIATIONS = 1.96
# Half width, in log factors, from which on an interval may reach zero noise.
_WIDE = 0.5
# Increase of the log of a time constant that makes it practically infinite.
_LONG = 5.0


class NoiseFactors(NamedTuple):
    """Maximum-likelihood factors of groups of noise."""

    factor: Array  # shape (k,)
    # Ends of the 95 % intervals; NaN if they were not computed
    low: Array  # shape (k,); 0 if the interval includes no noise
    high: Array  # shape (k,); infinite if the data give no upper limit
    log_likelihood: float  # up to a constant of the data
    gain: float  # increase of the log-likelihood over that of factors of 1
    converged: bool
    trajectory: Trajectory  # about which the likelihood is computed


class _Optimum(NamedTuple):
    """Log factors at the end of a search."""

    log_factor: Array  # shape (k,)
    trajectory: Trajectory
    information: Array  # shape (k, k)
    level: float  # log-likelihood
    stated: float  # log-likelihood of factors of 1
    converged: bool
    has_intervals: bool


def most_likely_noise(
    problem: JointProblem,
    groups: Sequence[NoiseGroup],
    max_passes: int,
    on_pass: OnPass = lambda progress: None,
    is_coarse: bool = False,
    start: Trajectory | None = None,
    first: NoiseFactors | None = None,
) -> NoiseFactors | None:
    """Estimate the factors of groups of noise; None if no trajectory has a finite cost.

    Parameters
    ----------
    problem : JointProblem
    groups : sequence of NoiseGroup
    max_passes : int
        Maximum number of forward passes for the first trajectory.
    on_pass : callable
        Receives a `NoiseProgress` before each likelihood and before its slopes. An exception from it ends the search.
    is_coarse : bool
        Whether to end where the log-likelihood hardly changes, and to leave out the intervals, which are then NaN.
        This serves to compare models, and to find a start for a long search.
    start : Trajectory, optional
        First trajectory, near that of the marginal estimate; by default the most probable one.
    first : NoiseFactors, optional
        Result of a search on a part of the data. This search begins with its factors and parameters.
    """
    likelihood, x, trajectory = NoiseLikelihood(problem, groups, on_pass), np.zeros(len(groups)), start
    if first is not None:
        x = np.log(first.factor)
        trajectory = likelihood.motion_given(x, first.trajectory.parameters)
    if trajectory is None or likelihood.filter(x, trajectory) is None:
        trajectory = likelihood.most_probable(x, max_passes)
    # With the motion of a similar model the search begins near its end.
    if start is None and first is None and any(group.sensor >= 0 for group in groups):
        x = None
    found = None if trajectory is None else _search(likelihood, x, trajectory, is_coarse)
    if found is None:
        return None
    x, trajectory, information, level, stated, converged, has_intervals = found
    if not has_intervals:
        unknown = np.full(x.size, np.nan)
        return NoiseFactors(np.exp(x), unknown, unknown, level, level - stated, converged, trajectory)

    def decrease(logarithms: Array) -> float:
        return level - likelihood.at(logarithms, trajectory)

    def profile(i: int, value: float | None = None) -> float:
        # The decrease with one log factor fixed, by default to its minimum, and all others optimised.
        likelihood.set_share(_SEARCH_SHARE + (1.0 - _SEARCH_SHARE) * i / x.size)
        others = np.arange(x.size) != i
        start = np.where(others, x, groups[i].min_log_factor if value is None else value)
        highest = _climb(likelihood, start, trajectory, others, enough=level - _INTERVAL_DECREASE)
        return np.inf if highest is None else level - log_likelihood(highest.filtered)

    low, high = _intervals(decrease, profile, x, information, [bool(group.rates) for group in groups])
    return NoiseFactors(np.exp(x), low, high, level, level - stated, converged, trajectory)


def _search(likelihood: NoiseLikelihood, x: Array | None, trajectory: Trajectory, is_coarse: bool) -> _Optimum | None:
    """Return the optimum of log factors and trajectory; None if the cost of a trajectory is not finite.

    It starts from log factors x, or if None from the innovations with factors of 1.
    """
    gain, objective, converged, n_rejections = np.inf, np.inf, False, 0
    zeros = np.zeros(likelihood.minimum.size)
    likelihood.set_process_memory(trajectory)
    with_stated = likelihood.filter(zeros, trajectory)
    stated = level = -np.inf if with_stated is None else log_likelihood(with_stated)
    if x is None:
        x = zeros if with_stated is None else likelihood.start_from_innovations(with_stated)
    best, latest = -np.inf, 0
    information, increase = np.eye(x.size), _COARSE_INCREASE if is_coarse else _MIN_INCREASE
    steps = list[tuple[Array, Array]]()
    for number in range(1, MAX_TRAJECTORIES + 1):
        before, last_information, last_progress = x, information, likelihood.progress
        highest = _climb(likelihood, x, trajectory, min_increase=increase)
        if highest is None and number == 1:
            highest = _climb(likelihood, zeros, trajectory, min_increase=increase)
        if highest is None:
            return None
        x, filtered, information = highest
        change, last, level = x - before, level, log_likelihood(filtered)
        is_same = bool((np.abs(change) < _MAX_CHANGE * _deviations(information)).all())
        # The first trajectory is not yet a marginal estimate.
        converged = gain < _MAX_GAIN and (is_same or (is_coarse and abs(level - last) < _MAX_GAIN))
        share = _SEARCH_SHARE * (1.0 - _REMAINING**number)
        likelihood.progress = NoiseProgress(
            passes=likelihood.progress.passes,
            trajectories=number,
            log_factor=x,
            log_likelihood=level,
            gain=level - stated,
            trajectory=trajectory,
            share=share,
            converged=converged,
        )
        best, latest = (level, number) if level > best + _MAX_GAIN else (best, latest)
        # With a wrong model, noise and trajectory may go round in a circle.
        if converged or number == MAX_TRAJECTORIES or (is_coarse and number - latest == _PATIENCE):
            break
        # The first step is made with very different noise.
        history = None if is_coarse or number == 1 else steps
        step = likelihood.one_step(filtered, is_coarse, history)
        is_worse = step is None or step.objective > objective + _MAX_INCREASE
        if not is_coarse and number > 1 and is_worse:
            # With such different noise the linear problem about this trajectory is a bad approximation.
            n_rejections += 1
            steps.clear()  # the last one is not made
            x, information = before, last_information
            passes = likelihood.progress.passes
            likelihood.progress = last_progress._replace(passes=passes, trajectories=number, share=share)
            filtered = likelihood.filter(x, trajectory)
            if filtered is None:
                return None
            level = log_likelihood(filtered)
            step = None if n_rejections == _MAX_REJECTIONS else likelihood.one_step(filtered, is_coarse, history)
        if step is None:
            break
        trajectory, gain, objective = step
        likelihood.set_process_memory(trajectory)
    # After the last rejection, the likelihood about the trajectory has its maximum elsewhere.
    has_intervals = not is_coarse and n_rejections < _MAX_REJECTIONS
    return _Optimum(x, trajectory, information, level, stated, converged, has_intervals)


class _ClimbResult(NamedTuple):
    """Log factors at the end of a climb."""

    log_factor: Array  # shape (k,)
    filtered: Filtered  # with these factors
    information: Array  # shape (k, k); of the last step, or the identity if there was none


def _climb(
    likelihood: NoiseLikelihood,
    x: Array,
    trajectory: Trajectory,
    free: NDArray[np.bool_] | None = None,
    min_increase: float = _MIN_INCREASE,
    enough: float = np.inf,
) -> _ClimbResult | None:
    """Maximise the log-likelihood about a trajectory by scoring; only the `free` log factors if given.

    It ends where the likelihood is flat or higher than `enough`. None if the cost is not finite.
    """
    current, minimum, information = likelihood.filter(x, trajectory), likelihood.minimum, np.eye(x.size)
    for _ in range(_MAX_STEPS):
        if current is None or log_likelihood(current) > enough:
            break
        scores = likelihood.scores(current)
        information = scores.information
        # Noise at its minimum, or negligible noise, is not reduced: smaller noise slows the smoother.
        moves = (scores.slope > 0.0) | (x > minimum) & (scores.slope < -_MIN_INCREASE)
        moves = moves if free is None else moves & free
        restricted = scores.information * np.outer(moves, moves) + np.diag(~moves)
        scores = scores._replace(slope=scores.slope * moves, information=restricted)
        # The added diagonal limits the step, also for noise that is too small to be observable.
        limited = scores.information + np.diag(np.abs(scores.slope) / _MAX_STEP + _MIN_INFORMATION)
        step = np.clip(x + np.linalg.solve(limited, scores.slope), minimum, _MAX_LOG_FACTOR) - x
        if scores.slope @ step < min_increase:
            break
        level = log_likelihood(current)
        while (trial := likelihood.filter(x + step, trajectory)) is None or log_likelihood(trial) < level:
            step /= 2.0
            if scores.slope @ step < min_increase:
                # Restore the noise of x: the rejected trial has changed it.
                current = likelihood.filter(x, trajectory)
                return None if current is None else _ClimbResult(x, current, information)
        x, current = x + step, trial
    return None if current is None else _ClimbResult(x, current, information)


def _deviations(information: Array) -> Array:
    """Return the standard deviations of log factors."""
    return np.sqrt(np.diagonal(np.linalg.inv(information + _MIN_INFORMATION * np.eye(len(information)))))


def _intervals(
    decrease: Callable[[Array], float],
    profile: Callable[..., float],
    x: Array,
    information: Array,
    is_time_constant: Sequence[bool] | None = None,
) -> tuple[Array, Array]:
    """Return 95 % intervals of the factors: from the curvature, and for wide ones from the likelihood itself."""
    width = np.minimum(_INTERVAL_DEVIATIONS * _deviations(information), _MAX_LOG_FACTOR)
    finite = width < _MAX_LOG_FACTOR
    low, high = np.where(finite, np.exp(x - width), 0.0), np.where(finite, np.exp(x + width), np.inf)
    for i in np.flatnonzero(width > _WIDE).tolist():
        unit = np.eye(x.size)[i]
        if is_time_constant is not None and is_time_constant[i]:
            low[i] = 0.0 if profile(i) < _INTERVAL_DECREASE else low[i]
            high[i] = np.inf if profile(i, x[i] + _LONG) < _INTERVAL_DECREASE else high[i]
        elif decrease(x - (_MAX_LOG_FACTOR + x[i]) * unit) < _INTERVAL_DECREASE or profile(i) < _INTERVAL_DECREASE:
            low[i] = 0.0

            def decrease_by(change: float, unit: Array = unit) -> float:
                return decrease(x + change * unit)

            high[i] = np.exp(x[i] + _end_of_interval(decrease_by, information[i, i], _MAX_LOG_FACTOR - x[i]))
    return low, high


def _end_of_interval(decrease: Callable[[float], float], information: float, limit: float) -> float:
    """Return the increase of a log factor that ends its 95 % interval; infinite if that is above `limit`.

    The decrease of the log-likelihood is about quadratic in the variance of the noise.
    """
    if limit <= 0.0:
        return np.inf
    growth = 2.0 * _INTERVAL_DEVIATIONS / np.sqrt(information + _MIN_INFORMATION)
    near, far, change = 0.0, np.inf, 0.0
    for _ in range(_MAX_EVALUATIONS):
        change = min(0.5 * np.log1p(growth), limit)
        if not near < change < far:
            change = 0.5 * (near + far)
            growth = np.expm1(2.0 * change)
        share = decrease(change) / _INTERVAL_DECREASE
        if abs(share - 1.0) < _DECREASE_TOLERANCE:
            return change
        if share > 1.0:
            far = change
        elif change >= limit:
            break
        else:
            near = change
        growth /= np.sqrt(max(share, _MIN_SHARE))
    return change if np.isfinite(far) else np.inf
