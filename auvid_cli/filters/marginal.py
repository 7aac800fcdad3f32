"""Most probable parameters with the motion integrated out (Laplace's approximation).

Minus twice the log of the marginal posterior is the minimum of the cost over all motions, plus the sum of the
logarithms of the innovations' variances given the parameters. Its minimum is found from the joint one by steps along
the gradient of that sum, from `auvid_cli.filters.marginal_gradient`.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from auvid_cli.arrays import Array
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, Trajectory, gauss_newton
from auvid_cli.filters.marginal_gradient import marginal_step
from auvid_cli.filters.problem import NEGLIGIBLE_DECREASE, ConvergenceStatus, JointProblem
from auvid_cli.filters.process_noise import with_process_memory

# Largest last step of the parameters, in standard deviations.
_MAX_LAST_STEP = 0.05
# Number of previous steps by which an iteration is accelerated.
_MEMORY = 3
# Maximum number of passes in which the motion adapts to new parameters, and that of a rough step.
_MOTION_PASSES = 5
_ROUGH_PASSES = 4
# Smallest decrease of the cost worth another of these passes. The error of the cost is quadratic in the error of the
# motion, that of the sum of logarithms linear: with a remaining decrease of 0.005, the objective was wrong by 0.05.
_MOTION_DECREASE = 1e-3
# Largest error of the objective, because the motion has not converged, for which a rough step may raise it.
_MAX_ERROR = 5.0
# Largest number of halvings of a step that raises the objective.
_MAX_HALVINGS = 8


class MarginalEstimate(NamedTuple):
    """Maximum of the marginal posterior."""

    problem: JointProblem  # with process memory, see `auvid_cli.filters.process_noise`
    filtered: Filtered  # about the estimated parameters and the most probable motion given them
    convergence: ConvergenceStatus | None  # none if the last step was small


def marginal_estimate(
    problem: JointProblem, smoothing: LinearSmoothing, joint: Filtered, max_steps: int
) -> MarginalEstimate | None:
    """Return the marginal estimate, from the joint minimum; None if the motion diverges for the parameters.

    The process noise has the same memory as in `auvid tune`; `smoothing` has that noise afterwards.
    """
    with_memory = with_process_memory(problem, joint.trajectory.parameters, joint.trajectory.moving)
    smoothing.change_noise(with_memory)
    filtered = smoothing.filter(joint.trajectory)
    found = None if filtered is None else integrate_out_motion(with_memory, smoothing, filtered, max_steps)
    return None if found is None else MarginalEstimate(with_memory, *found[:2])


class _GivenParameters(NamedTuple):
    """Motion given the parameters, with the objective of the problem that was solved for it."""

    trajectory: Trajectory
    objective: float  # minus twice the log of the marginal posterior of the parameters, up to a constant
    remaining: float  # decrease of the cost to the minimum over all motions, in the linear problem
    converged: bool

    def least(self, rough_motion: bool) -> float:
        """Return the objective less `remaining` if the motion has converged or the step is rough."""
        return self.objective - (self.remaining if rough_motion or self.converged else 0.0)


def integrate_out_motion(
    problem: JointProblem,
    smoothing: LinearSmoothing,
    start: Filtered,
    max_steps: int,
    rough_motion: bool = False,
    history: list[tuple[Array, Array]] | None = None,
) -> tuple[Filtered, ConvergenceStatus | None, float, float] | None:
    """Maximise the marginal posterior of the parameters; None if the motion diverges for them.

    Parameters
    ----------
    problem : JointProblem
    smoothing : LinearSmoothing
        Of the problem.
    start : Filtered
        About the first parameters, for example those of the joint minimum, and a motion.
    max_steps : int
    rough_motion : bool
        Whether the motion need not converge. On long data it hardly does: a step that the small process noise does
        not allow raises the cost at first. The objective of the linear problem hardly depends on it.
    history : list of tuple, optional
        Plain step of the parameters and move made instead, for each step of earlier calls with a similar problem. They
        accelerate the next steps, which are added.

    Returns
    -------
    filtered : Filtered
        Its trajectory is the estimate.
    convergence : ConvergenceStatus or None
        None if the last step was small. Negligible if the rest no longer matters, although no step lowers the
        objective, or `max_steps` are done.
    gain : float
        Increase of the log of the marginal posterior.
    objective : float
        Minus twice the log of the marginal posterior at the estimate, up to a constant of the data.
    """
    n, filtered, convergence = problem.n_parameters, start, None
    covariance = start.final.covariance()[:n, :n]
    deviation, made = np.sqrt(np.diagonal(covariance)), [] if history is None else history
    of_motion = LinearSmoothing(problem, parameters_are_given=True)
    at = _given_linear_problem(problem, filtered)
    if not rough_motion:
        at = _given_parameters(problem, of_motion, filtered.trajectory, rough_motion)
        if at is None or (filtered := smoothing.filter(at.trajectory)) is None:
            return None
    objective = at.least(rough_motion)
    for _ in range(max_steps):
        # To the joint minimum of the linear problem, and from there to the marginal one.
        step = filtered.final.mean[:n] + marginal_step(problem, smoothing, filtered)
        convergence = ConvergenceStatus(float(step @ np.linalg.solve(covariance, step)), step / deviation)
        is_small = bool((np.abs(step / deviation) <= _MAX_LAST_STEP).all())
        # The objective has an error of about this size, because the motion has not quite converged. A small step is
        # always accepted: it changes the objective by less than that.
        limit = np.inf if is_small else at.least(rough_motion) + NEGLIGIBLE_DECREASE
        # The motion changes with the parameters as in the linear problem, and then goes to its minimum.
        trials = (
            (move, filtered.trajectory.stepped(smoothing.step(filtered, move), 1.0))
            for move in _possible_moves(made, step, deviation)
        )
        found = _line_search(problem, of_motion, at, trials, limit, rough_motion)
        if found is None:
            # Where the motion hardly converges, the objective has a larger error.
            convergence = convergence._replace(is_negligible=convergence.cost_decrease < NEGLIGIBLE_DECREASE)
            break
        at, move = found
        made.append((step, move))
        if (filtered := smoothing.filter(at.trajectory)) is None:
            return None
        if is_small and at.converged:
            convergence = None
            break
    else:
        if convergence is not None:
            convergence = convergence._replace(is_negligible=convergence.is_close)
    after = at.least(rough_motion)
    return filtered, convergence, 0.5 * (objective - after), after


def _line_search(
    problem: JointProblem,
    of_motion: LinearSmoothing,
    at: _GivenParameters,
    trials: Iterable[tuple[Array, Trajectory]],
    limit: float,
    rough_motion: bool,
) -> tuple[_GivenParameters, Array] | None:
    """Return the motion after the first move with an objective below a limit, and this move; None if none has one.

    The trials are moves, each with the trajectory from which its motion goes to the minimum.
    """
    for move, start in trials:
        after = _given_parameters(problem, of_motion, start, rough_motion)
        if after is None:
            continue
        error = min(at.remaining + after.remaining, _MAX_ERROR) if rough_motion else 0.0
        if after.least(rough_motion) < limit + error:
            return after, move
    return None


def _possible_moves(made: list[tuple[Array, Array]], step: Array, deviation: Array) -> Iterator[Array]:
    """Yield the accelerated step, and then the plain one and parts of it.

    Where the data hardly tell the parameters, the plain step can be ten times too long.
    """
    if made:
        yield _accelerated(made, step, deviation)
    for halvings in range(_MAX_HALVINGS):
        yield 0.5**halvings * step


def _accelerated(made: list[tuple[Array, Array]], step: Array, deviation: Array) -> Array:
    """Return the next move of a fixed-point iteration by Anderson's method (SIAM J. Numer. Anal. 49(4), 2011).

    Parameters
    ----------
    made : list of tuple
        Plain step and move made instead, so far.
    step : ndarray, shape (n,)
        Plain step now.
    deviation : ndarray, shape (n,)
        Standard deviations, by which the components are weighted.
    """
    steps, moves = zip(*made[-_MEMORY:], strict=True)
    changes = np.diff(np.stack([*steps, step], axis=1), axis=1)
    share = np.linalg.lstsq(changes / deviation[:, None], step / deviation)[0]
    return step - (np.stack(moves, axis=1) + changes) @ share


def _given_parameters(
    problem: JointProblem, of_motion: LinearSmoothing, start: Trajectory, rough_motion: bool
) -> _GivenParameters | None:
    """Return the most probable motion given the parameters of a start; None if its cost is not finite."""
    n, prior = problem.n_parameters, problem.prior
    from_prior = np.linalg.solve(prior.factor[:n, :n], start.parameters - prior.mean[:n])
    max_passes = _ROUGH_PASSES if rough_motion else _MOTION_PASSES
    found = gauss_newton(of_motion, start, max_passes, _MOTION_DECREASE)
    if found is None:
        return None
    minimum, converged = found
    # A full step could raise the cost again before it has converged.
    moved = minimum.trajectory.stepped(of_motion.step(minimum), 1.0) if converged else minimum.trajectory
    objective = minimum.cost + minimum.log_determinant + float(from_prior @ from_prior)
    return _GivenParameters(moved, objective, minimum.cost - minimum.least, converged)


def _given_linear_problem(problem: JointProblem, filtered: Filtered) -> _GivenParameters:
    """Return the trajectory of a linear problem, with the objective of that problem given the parameters."""
    n = problem.n_parameters
    estimate, prior = filtered.estimate(n), problem.prior.factor
    distance = solve_triangular(estimate.factor, estimate.mean, lower=True)
    # Given the parameters, the log determinant is less: by that of their prior covariance, minus that of the estimate.
    less = 2.0 * float(np.log(np.abs(np.diagonal(prior)[:n] / np.diagonal(estimate.factor))).sum())
    objective = filtered.cost + filtered.log_determinant - less
    remaining = filtered.cost - filtered.least - float(distance @ distance)
    return _GivenParameters(filtered.trajectory, objective, remaining, remaining <= _MOTION_DECREASE)
