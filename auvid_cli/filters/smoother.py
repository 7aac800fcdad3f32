"""Iterated smoother: the most probable trajectory and parameters, process noise included.

Gauss-Newton on the cost of a whole trajectory (Bell, SIAM J. Optim. 4(3), 1994): squares of what it needs of process
noise, of residuals and of the distance to the prior, each by its variance. Each step is a linear smoothing problem
about the last trajectory, see `auvid_cli.filters.linear_smoother`. A filter cannot take back what it concluded far
from the answer; this linearises anew where the data have led it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.fault_scores import Faults, score_faults
from auvid_cli.filters.influence_functions import corrected_smoothing
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, Smoothed, Trajectory, gauss_newton, is_led_to
from auvid_cli.filters.problem import (
    NOT_CONVERGED,
    OK,
    PREDICTION,
    AlternativeEstimate,
    ConvergenceStatus,
    FilterOutcome,
    Gaussian,
    OnChunk,
    Records,
    Sensors,
    Timeline,
    truncate,
)
from auvid_cli.filters.segments import JointProblem, filter_sequentially
from auvid_cli.filters.smoother_forward import SET_ASIDE
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature

Array = NDArray[np.float64]

# Largest distance of a filter's parameters from the estimate that it leads to, in standard deviations: if they are
# farther, other starts are tried.
_FAR = 1.0
# Factors of the process noise, and of the prior's spread of the parameters, for a start along the measurements.
_LOOSE = 100.0
_HELD = 1e-3
# Factors of the process noise, in this order, where an estimate is not found at once.
_ANNEALING = _LOOSE, 10.0
# Minima to be found from starts that are far from them.
_MINIMA = 2
# Cost by which another minimum may be higher: if it is less than 1 % as probable, it is ignored.
_RIVAL = -2.0 * np.log(0.01)
# Smallest variance of a difference, as a fraction of the segment's: below is rounding.
_LEAST = 1e-6


def run_smoother(
    problem: JointProblem,
    on_chunk: OnChunk,
    max_passes: int = 50,
    faults: Faults | None = None,
    marginal: bool = False,
) -> FilterOutcome:
    """Find the most probable parameters and motion.

    It starts from the trajectory of a CKF. Where the answer is far from that, or there is none, it starts once more,
    from a trajectory that keeps the prior's parameters and follows the measurements; where these two do not both end in
    a minimum, from the answer to more process noise. The most probable answer counts, and is compared with another,
    and with what each of several segments says by itself.

    Parameters
    ----------
    problem : JointProblem
        Every measurement counts, whatever the gate.
    on_chunk : callable
        What it receives has constant parameters, the smoothed motion, and the innovations of the last filter pass.
    max_passes : int
        Of the filter through the data, from each start, and steps from there where `marginal`.
    faults : Faults, optional
        To test for, about the answer.
    marginal : bool
        Whether to go on to the most probable parameters whatever the motion was, and the motion that goes with them.

    Returns
    -------
    FilterOutcome
        `NOT_CONVERGED` if `max_passes` were not enough; `PREDICTION` if no start has a finite cost, if the motion
        cannot follow the parameters, or where rounding leaves nothing of a variance of the smoothed motion.
    """
    smoothing = LinearSmoothing(problem)
    answers = most_probable(problem, smoothing, max_passes)
    if not answers:
        return _failed(problem)
    (best, converged), *others = answers
    if not converged:
        outcome = _hand_over(smoothing, problem.sensors, best, on_chunk)
        n_parameters = problem.n_parameters
        deviation = np.sqrt(np.diagonal(outcome.covariance)[:n_parameters])
        convergence = ConvergenceStatus(best.cost - best.least, best.final.mean[:n_parameters] / deviation)
        return outcome._replace(failure=NOT_CONVERGED, convergence=convergence)
    rivals = [other for rival, _ in others if (other := other_minimum(best, rival)) is not None]
    if len(problem.segments) > 1:
        rivals += _segment_estimates(problem, best)
    answer, convergence, score = best, None, score_faults
    if marginal:
        # What it is compiled from serves no other answer.
        from auvid_cli.filters.marginal import marginal_answer, marginal_scores

        found = marginal_answer(problem, smoothing, best, max_passes)
        if found is None:
            return _failed(problem)
        problem, answer, convergence = found
        score = partial(marginal_scores, problem)
    outcome = _hand_over(smoothing, problem.sensors, answer, on_chunk, is_answer=marginal)
    if outcome.failure != OK:
        return outcome
    if convergence is not None:
        return outcome._replace(failure=NOT_CONVERGED, convergence=convergence)
    scores = None if faults is None else score(smoothing, answer, faults)
    corrected = corrected_smoothing(problem, smoothing, answer)
    return outcome._replace(faults=scores, others=tuple(rivals), corrected=corrected)


def _segment_estimates(problem: JointProblem, answer: Filtered) -> Iterator[AlternativeEstimate]:
    """Yield the estimate of each segment by itself, about the estimate of all.

    A segment alone, a of covariance C, and all together, b of covariance P, share the segment's data and the prior. If
    one model holds for all, the covariance of a and b is P, and that of their difference ``C - P`` (Hausman,
    Econometrica 46(6), 1978).
    """
    trajectory, n = answer.trajectory, answer.trajectory.parameters.size
    together, variance = answer.final.mean[:n], np.diagonal(answer.final.covariance())[:n]
    for alone, initial, moving in zip(problem.by_segment(), trajectory.initial, trajectory.moving, strict=True):
        own = LinearSmoothing(alone).filter(Trajectory(trajectory.parameters, [initial], [moving]))
        assert own is not None, "with the others its trajectory has a finite cost"
        own_variance = np.diagonal(own.final.covariance())[:n]
        more = own_variance - variance
        comparable = more > _LEAST * own_variance
        deviation = np.sqrt(np.where(comparable, more, np.inf))
        begin = next(iter(alone.segments[0])).time[0]
        moved = np.where(comparable, deviation, 0.0) * variance / own_variance
        yield AlternativeEstimate(own.final.mean[:n] - together, deviation, moved, begin=begin)


def other_minimum(answer: Filtered, other: Filtered) -> AlternativeEstimate | None:
    """Return the estimate from another start; None if it is the same, or far less probable."""
    n = answer.trajectory.parameters.size
    deviation = np.sqrt(np.diagonal(answer.final.covariance())[:n])
    here, there = (each.trajectory.parameters + each.final.mean[:n] for each in (answer, other))
    higher = other.cost - answer.cost
    return None if higher > _RIVAL else AlternativeEstimate.of_minimum(there - here, deviation, higher)


def _failed(problem: JointProblem) -> FilterOutcome:
    factor = problem.priors[0].factor
    return FilterOutcome(factor @ factor.T, 0, PREDICTION)


def most_probable(problem: JointProblem, smoothing: LinearSmoothing, max_passes: int) -> list[tuple[Filtered, bool]]:
    """Find the most probable trajectory from each start: where that ends, and whether at a minimum; the best first."""
    answers = []
    for start in _starts(problem, smoothing, max_passes):
        if (answer := gauss_newton(smoothing, start, max_passes)) is not None:
            answers.append(answer)
            if _is_near(start, answer[0]) or sum(converged for _, converged in answers) == _MINIMA:
                break
    return sorted(answers, key=lambda answer: answer[0].cost)


def _starts(problem: JointProblem, smoothing: LinearSmoothing, max_passes: int) -> Iterator[Trajectory]:
    """Yield trajectories to start from: as a CKF has it, along the measurements, and the answer to more noise."""
    if (filtered := _ckf(problem)) is not None:
        yield filtered
    if (followed := follow_measurements(problem)) is not None:
        yield followed
        if (eased := _anneal_process_noise(problem, smoothing, followed, max_passes)) is not None:
            yield eased


def _anneal_process_noise(
    problem: JointProblem, smoothing: LinearSmoothing, start: Trajectory, max_passes: int
) -> Trajectory | None:
    """Return the estimate with more, then less, process noise; None if the cost of a start is not finite.

    With little process noise a step costs much wherever the motion is nonlinear, so that only short steps reduce the
    cost. With more of it the parameters converge first.
    """
    process, answer = problem.process, start
    for times in _ANNEALING:
        smoothing.change_noise(process._replace(noise_density=times * process.noise_density), problem.sensors)
        found = gauss_newton(smoothing, answer, max_passes)
        if found is None:
            answer = None
            break
        answer = found[0].trajectory
    smoothing.change_noise(process, problem.sensors)
    return answer


def follow_measurements(problem: JointProblem) -> Trajectory | None:
    """Return a trajectory along the measurements with the prior's parameters; None if the filter fails."""
    process, prior, n_parameters = problem.process, problem.prior, problem.n_parameters
    loose = process._replace(noise_density=_LOOSE * process.noise_density)
    held = prior.factor.copy()
    held[:, :n_parameters] *= _HELD
    followed = _ckf(problem._replace(process=loose, prior=prior._replace(factor=held)))
    return None if followed is None else replace(followed, parameters=prior.mean[:n_parameters])


def _is_near(start: Trajectory, answer: Filtered) -> bool:
    """Say whether an answer has the parameters of its start, within what is not known of them."""
    n_parameters = start.parameters.size
    deviation = np.sqrt(np.diagonal(answer.final.covariance())[:n_parameters])
    moved = answer.trajectory.parameters + answer.final.mean[:n_parameters] - start.parameters
    return bool((np.abs(moved) <= _FAR * deviation).all())


def _ckf(problem: JointProblem) -> Trajectory | None:
    """Filter the data; None if the filter fails."""
    n_parameters, priors = problem.n_parameters, problem.priors
    parameters, initial, moving = problem.prior.mean[:n_parameters], list[Array](), list[list[Array]]()

    def keep(timeline: Timeline, records: Records) -> None:
        nonlocal parameters
        if len(records.mean):
            parameters = records.mean[-1, :n_parameters].copy()
        states = records.mean[:, n_parameters:].copy()
        if not moving[-1] and len(states):
            before = priors[len(moving) - 1].mean[n_parameters:]
            initial.append(before if is_led_to(timeline) else states[0])
        moving[-1].append(states)

    def run(timelines: Iterable[Timeline], gaussian: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        moving.append([])
        return run_square_root_filter(points, problem.process, problem.sensors, timelines, gaussian, on_chunk)

    points = cubature(n_parameters + problem.n_moving)
    outcome = filter_sequentially(run, problem, keep)
    return Trajectory(parameters, initial, moving) if outcome.failure == OK else None


def _hand_over(
    smoothing: LinearSmoothing, sensors: Sensors, filtered: Filtered, on_chunk: OnChunk, is_answer: bool = False
) -> FilterOutcome:
    """Pass on the smoothed trajectory, chunk by chunk, from the first to the last; or the nominal one itself."""
    covariance = filtered.final.covariance()
    n_parameters, share = filtered.trajectory.parameters.size, 0.0 if is_answer else 1.0
    parameters = filtered.trajectory.parameters + share * filtered.final.mean[:n_parameters]
    deviation = np.sqrt(np.diagonal(covariance)[:n_parameters])
    nominal = [moving for segment in filtered.trajectory.moving for moving in segment]
    chunks = [(chunk.timeline, _records(chunk, sensors)) for chunk in smoothing.smooth(filtered, with_variance=True)]
    n_good = 0
    for moving, (timeline, of_motion) in zip(nominal, reversed(chunks), strict=True):
        step, variance = of_motion[:2]
        lost = np.flatnonzero(~(variance > 0.0).all(axis=1))
        good = int(lost[0]) if lost.size else len(moving)
        records = of_motion._replace(
            mean=np.hstack([np.tile(parameters, (good, 1)), (moving + share * step)[:good]]),
            standard_deviation=np.hstack([np.tile(deviation, (good, 1)), np.sqrt(variance[:good])]),
        )
        on_chunk(timeline, truncate(records, good, int(timeline.measurement_offset[good])))
        n_good += good
        if lost.size:
            return FilterOutcome(covariance, n_good, PREDICTION)
    return FilterOutcome(covariance, n_good, OK)


def _records(chunk: Smoothed, sensors: Sensors) -> Records:
    """Return step and variance of the motion of a chunk, and its innovations: all its forward passes would be large."""
    forward_pass, weights = chunk.forward_pass, chunk.forward_pass.weight
    counted = ~np.isnan(forward_pass.innovation) & (weights >= SET_ASIDE)
    # Innovations are judged by the stated noise.
    by_weights = (1.0 / weights - 1.0) * sensors.variance[chunk.timeline.measurement_sensor]
    squares = np.where(counted, forward_pass.error**2 / (forward_pass.total - by_weights), 0.0)
    variance = np.where(counted, forward_pass.variance - by_weights, np.nan)
    kept_weights = None if np.isinf(sensors.threshold) else weights.copy()
    of_measurements = forward_pass.innovation, variance, squares.sum(axis=1), kept_weights
    return Records(chunk.step, chunk.variance, *of_measurements)
