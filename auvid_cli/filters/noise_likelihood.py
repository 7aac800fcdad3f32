"""Noise by maximum likelihood: how much of it makes the innovations of a smoother's filter most probable.

About the most probable trajectory the problem is linear, and minus twice the log-likelihood of the measurements, with
trajectory and parameters integrated out, is ``sum(log S + e^2 / S)`` over the innovations e of variance S (Schweppe,
IEEE Trans. Autom. Control 11(1), 1965). It is maximised over logarithms of factors by scoring, with the derivatives of
`auvid_cli.filters.noise_scores`; then the trajectory is found anew.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, Trajectory, gauss_newton, with_process_memory
from auvid_cli.filters.noise_scores import NoiseGroup, NoiseScores, noise_scores, with_time_constants
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoother import most_probable

Array = NDArray[np.float64]

# Logarithms of factors: how near the last two answers are to each other, how far one goes in a step, how far factors
# may be from 1, and how exactly the end of an interval is found.
_SAME, _LONGEST, _FARTHEST, _EXACTLY = 0.05, 2.0, 14.0, 0.05
_MOST_ROUNDS, _MOST_STEPS = 6, 40
# Information that is none.
_LEAST = 1e-9
# Log-likelihood that is not worth another step.
_NEGLIGIBLE = 0.01
# Log-likelihood that an end of a 95 % interval lies below the greatest, and that many standard deviations.
_BELOW, _DEVIATIONS = 1.92, 1.96
# An interval that is narrower, in logarithms, cannot reach to no noise at all; and by so much a time is longer that is
# as good as endless.
_NARROW, _LONG = 0.5, 5.0


class NoiseFactors(NamedTuple):
    """The factors that make the measurements most probable.

    Attributes
    ----------
    factor : ndarray, shape (k,)
    low, high : ndarray, shape (k,)
        Ends of a 95 % interval of each; 0 where less is as likely, however little, and infinite where more is.
    log_likelihood : float
        But for a constant of the data.
    gain : float
        By how much it is greater than with all factors 1.
    converged : bool
    """

    factor: Array
    low: Array
    high: Array
    log_likelihood: float
    gain: float
    converged: bool


def scaled(problem: JointProblem, groups: Sequence[NoiseGroup], factors: Array) -> JointProblem:
    """Multiply densities, standard deviations and time constants of groups by their factors."""
    process, variance = problem.process, problem.sensors.variance.copy()
    for group, factor in zip(groups, factors.tolist(), strict=True):
        if group.rates:
            process = with_time_constants(process, group, factor)
        else:
            density = process.noise_density.copy()
            density[list(group.moving)] *= factor
            process = process._replace(noise_density=density)
        if group.sensor >= 0:
            variance[group.sensor] *= factor**2
    return problem._replace(process=process, sensors=problem.sensors._replace(variance=variance))


class _Likelihood:
    """Log-likelihood of noise along one trajectory after the other."""

    def __init__(self, problem: JointProblem, groups: Sequence[NoiseGroup], on_evaluation: Callable[[], None]) -> None:
        self._problem, self._groups, self._on_evaluation = problem, groups, on_evaluation
        self._present, self.smoothing = problem, LinearSmoothing(problem)
        self.least = np.array([group.min_log_factor for group in groups])

    def filter(self, logarithms: Array, trajectory: Trajectory) -> Filtered | None:
        """Filter with some noise; None where it cannot be."""
        self._on_evaluation()
        self._with(logarithms)
        return self.smoothing.filter(trajectory)

    def at(self, logarithms: Array, trajectory: Trajectory) -> float:
        """Evaluate it, but for a constant; minus infinity where the noise cannot be."""
        filtered = self.filter(logarithms, trajectory)
        return -np.inf if filtered is None else log_likelihood(filtered)

    def scores(self, filtered: Filtered) -> NoiseScores:
        """Differentiate it by the logarithms that were filtered with last."""
        self._on_evaluation()
        return noise_scores(self.smoothing, filtered, self._present, self._groups)

    def follow(self, trajectory: Trajectory, logarithms: Array, max_passes: int) -> Trajectory:
        """Return the most probable trajectory with other noise, from another one."""
        self._with(logarithms)
        answer = gauss_newton(self.smoothing, trajectory, max_passes)
        return trajectory if answer is None else answer[0].trajectory

    def forget_along(self, trajectory: Trajectory) -> None:
        """Let process noise be forgotten as fast as motion is along a trajectory."""
        self._problem = with_process_memory(self._problem, trajectory.parameters, trajectory.moving)

    def _with(self, logarithms: Array) -> None:
        self._present = scaled(self._problem, self._groups, np.exp(logarithms))
        self.smoothing.change_noise(self._present.process, self._present.sensors)


def log_likelihood(filtered: Filtered) -> float:
    """Return the log-likelihood of the measurements in a linear problem, but for a constant."""
    return -0.5 * (filtered.least + filtered.log_determinant)


def most_likely_noise(
    problem: JointProblem,
    groups: Sequence[NoiseGroup],
    max_passes: int,
    on_evaluation: Callable[[], None] = lambda: None,
) -> NoiseFactors | None:
    """Find the factors of groups of noise.

    Parameters
    ----------
    problem : JointProblem
    groups : sequence of NoiseGroup
    max_passes : int
        Of the filter through the data, for each trajectory.
    on_evaluation : callable
        Called before each pass through the data, there or back; what it raises ends the search.

    Returns
    -------
    NoiseFactors or None
        None if no trajectory has a finite cost.
    """
    likelihood = _Likelihood(problem, groups, on_evaluation)
    answers = most_probable(problem, likelihood.smoothing, max_passes)
    if not answers:
        return None
    trajectory, x, converged = answers[0][0].trajectory, np.zeros(len(groups)), False
    likelihood.forget_along(trajectory)
    as_stated = likelihood.at(x, trajectory)
    for _ in range(_MOST_ROUNDS):
        before, x = x, _climb(likelihood, x, trajectory)
        trajectory = likelihood.follow(trajectory, x, max_passes)
        likelihood.forget_along(trajectory)
        if converged := bool(np.abs(x - before).max() < _SAME):
            break
    filtered = likelihood.filter(x, trajectory)
    if filtered is None:
        return None
    best = log_likelihood(filtered)
    information = likelihood.scores(filtered).information

    def below(logarithms: Array) -> float:
        return best - likelihood.at(logarithms, trajectory)

    def without(i: int, at: float | None = None) -> float:
        # What one group leaves undone others may do: they are as likely as they can be without it.
        others = np.arange(x.size) != i
        start = np.where(others, x, groups[i].min_log_factor if at is None else at)
        return below(_climb(likelihood, start, trajectory, others))

    low, high = _intervals(below, without, x, information, [bool(group.rates) for group in groups])
    return NoiseFactors(np.exp(x), low, high, best, best - as_stated, converged)


def noise_scores_about(
    problem: JointProblem, groups: Sequence[NoiseGroup], trajectory: Trajectory
) -> NoiseScores | None:
    """Differentiate the log-likelihood by the noise as stated, about a trajectory; None where that is impossible."""
    likelihood = _Likelihood(problem, groups, lambda: None)
    likelihood.forget_along(trajectory)
    filtered = likelihood.filter(np.zeros(len(groups)), trajectory)
    return None if filtered is None else likelihood.scores(filtered)


def _climb(likelihood: _Likelihood, x: Array, trajectory: Trajectory, free: NDArray[np.bool_] | None = None) -> Array:
    """Go up along a trajectory, as far as that is worth a step; of some logarithms only, if asked."""
    here, least = likelihood.filter(x, trajectory), likelihood.least
    for _ in range(_MOST_STEPS):
        if here is None:
            break
        scores = likelihood.scores(here)
        # What is as little as it may be, and would be less, stays.
        moves = (x > least) | (scores.slope > 0.0)
        moves = moves if free is None else moves & free
        information = scores.information * np.outer(moves, moves) + np.diag(~moves)
        scores = scores._replace(slope=scores.slope * moves, information=information)
        # No step is much longer than that, even where the data say nothing of noise that is too small to be seen.
        bent = scores.information + np.diag(np.abs(scores.slope) / _LONGEST + _LEAST)
        step = np.clip(x + np.linalg.solve(bent, scores.slope), least, _FARTHEST) - x
        if scores.slope @ step < _NEGLIGIBLE:
            break
        level, tried = log_likelihood(here), likelihood.filter(x + step, trajectory)
        while tried is None or log_likelihood(tried) < level:
            step /= 2.0
            if scores.slope @ step < _NEGLIGIBLE:
                return x
            tried = likelihood.filter(x + step, trajectory)
        x, here = x + step, tried
    return x


def _intervals(
    below: Callable[[Array], float],
    without: Callable[..., float],
    x: Array,
    information: Array,
    lasts: Sequence[bool] | None = None,
) -> tuple[Array, Array]:
    """Return 95 % intervals of the factors, from the curvature, and of little noise from how much less is as likely.

    Where it `lasts`, a factor is of a time constant: of that, with all else as likely as it can be, any longer may do.
    """
    variance = np.diag(np.linalg.inv(information + _LEAST * np.eye(x.size)))
    width = np.minimum(_DEVIATIONS * np.sqrt(variance), _FARTHEST)
    some = width < _FARTHEST
    low, high = np.where(some, np.exp(x - width), 0.0), np.where(some, np.exp(x + width), np.inf)
    for i in np.flatnonzero(width > _NARROW).tolist():
        unit = np.eye(x.size)[i]
        if lasts is not None and lasts[i]:
            low[i] = 0.0 if without(i) < _BELOW else low[i]
            high[i] = np.inf if without(i, x[i] + _LONG) < _BELOW else high[i]
        elif below(x - (_FARTHEST + x[i]) * unit) < _BELOW or without(i) < _BELOW:
            low[i] = 0.0
            high[i] = np.exp(x[i] + _until(lambda by, unit=unit: below(x + by * unit) - _BELOW, _FARTHEST - x[i]))
    return low, high


def _until(beyond: Callable[[float], float], farthest: float) -> float:
    """Find how far to go until something is positive; infinite if it is nowhere."""
    # Only the search of noise gets here, and to load it takes a tenth of a second.
    import scipy.optimize

    near, far = 0.0, 1.0
    while beyond(far) < 0.0:
        near, far = far, 2.0 * far
        if near >= farthest:
            return np.inf
    root: Any = scipy.optimize.brentq(beyond, near, far, xtol=_EXACTLY)
    return float(root)
