"""Noise by maximum likelihood: how much of it makes the innovations of a smoother's filter most probable.

About the most probable trajectory the problem is linear, and minus twice the log-likelihood of the measurements, with
trajectory and parameters integrated out, is ``sum(log S + e^2 / S)`` over the innovations e of variance S (Schweppe,
IEEE Trans. Autom. Control 11(1), 1965). It is minimised over logarithms of factors; then the trajectory is found anew.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from auvid_cli.filters.linear_smoothing import LinearSmoothing, Trajectory
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoother import minimise, most_probable

Array = NDArray[np.float64]

# scipy's hints know nothing of what it takes.
_minimised: Any = scipy.optimize.minimize

# Logarithms of factors: step of a derivative, and of a second one; how near the last two answers are to each other; how
# far factors may be from 1.
_STEP, _WIDE_STEP, _SAME, _FARTHEST = 0.05, 0.3, 0.05, 14.0
_MOST_ROUNDS = 6
# Twice the log-likelihood that is not worth another step.
_NEGLIGIBLE = 0.02
# Twice the log-likelihood that an end of a 95 % interval lies below the greatest, and that many standard deviations.
_BELOW, _DEVIATIONS = 3.84, 1.96


class NoiseGroup(NamedTuple):
    """Noise that has one factor.

    Attributes
    ----------
    moving : tuple of int
        Moving states, whose densities it multiplies.
    sensor : int
        Row of the sensor whose standard deviations it multiplies; negative if none.
    """

    moving: tuple[int, ...] = ()
    sensor: int = -1


class NoiseFactors(NamedTuple):
    """The factors that make the measurements most probable.

    Attributes
    ----------
    factor : ndarray, shape (k,)
    low, high : ndarray, shape (k,)
        Ends of a 95 % interval of each; 0 where less is as likely, however little.
    gain : float
        By how much the log-likelihood is greater than with all factors 1.
    converged : bool
    """

    factor: Array
    low: Array
    high: Array
    gain: float
    converged: bool


def scaled(problem: JointProblem, groups: Sequence[NoiseGroup], factors: Array) -> JointProblem:
    """Multiply densities and standard deviations of groups by their factors."""
    density, variance = problem.process.noise_density.copy(), problem.sensors.variance.copy()
    for group, factor in zip(groups, factors.tolist(), strict=True):
        density[list(group.moving)] *= factor
        if group.sensor >= 0:
            variance[group.sensor] *= factor**2
    process, sensors = problem.process._replace(noise_density=density), problem.sensors._replace(variance=variance)
    return problem._replace(process=process, sensors=sensors)


class _Likelihood:
    """Minus twice the log-likelihood along one trajectory after the other, by the logarithms of the factors."""

    def __init__(self, problem: JointProblem, groups: Sequence[NoiseGroup], on_evaluation: Callable[[], None]) -> None:
        self._problem, self._groups, self._on_evaluation = problem, groups, on_evaluation
        self.smoothing = LinearSmoothing(problem)

    def follow(self, trajectory: Trajectory, logarithms: Array, max_passes: int) -> Trajectory:
        """Return the most probable trajectory with other noise, from another one."""
        self._with(logarithms)
        answer = minimise(self.smoothing, trajectory, max_passes)
        return trajectory if answer is None else answer[0].trajectory

    def along(self, logarithms: Array, trajectory: Trajectory) -> float:
        """Evaluate it; infinite where the noise cannot be."""
        self._on_evaluation()
        self._with(logarithms)
        filtered = self.smoothing.filter(trajectory)
        return np.inf if filtered is None else filtered.least + filtered.log_determinant

    def slope(self, logarithms: Array, trajectory: Trajectory) -> Array:
        """Return its derivative: from both sides, for by one the likeliest noise of a sensor would be off by a step."""
        steps = _STEP * np.eye(logarithms.size)
        both = [[self.along(logarithms + sign * step, trajectory) for sign in (-1.0, 1.0)] for step in steps]
        return np.diff(both, axis=1)[:, 0] / (2.0 * _STEP)

    def _with(self, logarithms: Array) -> None:
        problem = scaled(self._problem, self._groups, np.exp(logarithms))
        self.smoothing.change_noise(problem.process, problem.sensors)


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
        Called before each pass; what it raises ends the search.

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
    as_stated = likelihood.along(x, trajectory)
    for _ in range(_MOST_ROUNDS):
        solution = _minimised(
            likelihood.along,
            x,
            args=(trajectory,),
            jac=likelihood.slope,
            method="L-BFGS-B",
            bounds=[(-_FARTHEST, _FARTHEST)] * len(groups),
            options={"ftol": _NEGLIGIBLE / max(abs(as_stated), 1.0), "maxiter": 50},
        )
        moved, x = np.abs(solution.x - x).max(), solution.x
        trajectory = likelihood.follow(trajectory, x, max_passes)
        if converged := bool(moved < _SAME):
            break
    best = likelihood.along(x, trajectory)
    low, high = _intervals(lambda logarithms: likelihood.along(logarithms, trajectory) - best, x)
    return NoiseFactors(np.exp(x), low, high, 0.5 * (as_stated - best), converged)


def _intervals(above: Callable[[Array], float], x: Array) -> tuple[Array, Array]:
    """Return 95 % intervals of the factors, from how much less likely others are than the best."""
    low, high = np.zeros(x.size), np.full(x.size, np.inf)
    steps = _WIDE_STEP * np.eye(x.size)
    level = np.array([[above(x + sign * step) for sign in (-1.0, 1.0)] for step in steps])
    curvature = np.diag(level.sum(axis=1) / _WIDE_STEP**2)
    for i in range(x.size):
        for j in range(i):
            both = above(x + steps[i] + steps[j]) - level[i, 1] - level[j, 1]
            curvature[i, j] = curvature[j, i] = both / _WIDE_STEP**2
    # Of what the likelihood hardly depends on, the other way to find an end.
    curved = np.flatnonzero(level.min(axis=1) > 0.0)
    covariance = 2.0 * np.linalg.pinv(curvature[np.ix_(curved, curved)])
    for place, i in enumerate(curved):
        width = _DEVIATIONS * np.sqrt(max(covariance[place, place], 0.0))
        if width < _FARTHEST:
            low[i], high[i] = np.exp(x[i] - width), np.exp(x[i] + width)
    for i in range(x.size):
        unit = np.eye(x.size)[i]
        if above(np.where(unit > 0.0, -_FARTHEST, x)) < _BELOW:
            low[i] = 0.0
            high[i] = np.exp(_crossing(lambda by, unit=unit: above(x + by * unit) - _BELOW, x[i]))
    return low, high


def _crossing(beyond: Callable[[float], float], start: float) -> float:
    """Find where it is so much less likely, going up."""
    if beyond(_FARTHEST - start) < 0.0:
        return np.inf
    root: Any = scipy.optimize.brentq(beyond, 0.0, _FARTHEST - start, xtol=_STEP)
    return start + float(root)
