"""Iterated smoother: the most probable trajectory and parameters, process noise included.

Gauss-Newton on the cost of a whole trajectory (Bell, SIAM J. Optim. 4(3), 1994): squares of what it needs of process
noise, of residuals and of the distance to the prior, each by its variance. Each step is a linear smoothing problem
about the last trajectory, see `auvid_cli.filters.linear_smoothing`. A filter cannot take back what it concluded far
from the answer; this linearises anew where the data have led it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.descent import minimise
from auvid_cli.filters.fault_scores import Faults, score_faults
from auvid_cli.filters.huber import SET_ASIDE
from auvid_cli.filters.influences import corrected_smoothing
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing, Smoothed, Trajectory, is_led_to
from auvid_cli.filters.other_answers import answers_of_segments, other_minimum
from auvid_cli.filters.point_sets import cubature
from auvid_cli.filters.problem import (
    NOT_CONVERGED,
    OK,
    PREDICTION,
    FilterOutcome,
    Gaussian,
    OnChunk,
    Records,
    Sensors,
    Timeline,
    Unsettled,
    until,
)
from auvid_cli.filters.segments import JointProblem, one_after_the_other
from auvid_cli.filters.square_root import run_square_root_filter

Array = NDArray[np.float64]

# Standard deviations by which a filter's parameters may be off the answer that it led to, before that is doubted.
_FAR = 1.0
# Times the process noise, and the prior's spread of the parameters, for a start that only follows the measurements.
_LOOSE, _HELD = 100.0, 1e-3
# Times the process noise, one after the other, on the way to an answer that is not found at once.
_EASED = _LOOSE, 10.0
# Minima to be found from starts that are far from them.
_MINIMA = 2


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
        unsettled = Unsettled(best.cost - best.least, best.final.mean[:n_parameters] / deviation)
        return outcome._replace(failure=NOT_CONVERGED, unsettled=unsettled)
    rivals = [other for rival, _ in others if (other := other_minimum(best, rival)) is not None]
    if len(problem.segments) > 1:
        rivals += answers_of_segments(problem, best)
    answer, unsettled, score = best, None, score_faults
    if marginal:
        # What it is compiled from serves no other answer.
        from auvid_cli.filters.marginal import marginal_answer, marginal_scores

        found = marginal_answer(problem, smoothing, best, max_passes)
        if found is None:
            return _failed(problem)
        problem, answer, unsettled = found
        score = partial(marginal_scores, problem)
    outcome = _hand_over(smoothing, problem.sensors, answer, on_chunk, is_answer=marginal)
    if outcome.failure != OK:
        return outcome
    if unsettled is not None:
        return outcome._replace(failure=NOT_CONVERGED, unsettled=unsettled)
    scores = None if faults is None else score(smoothing, answer, faults)
    corrected = corrected_smoothing(problem, smoothing, answer)
    return outcome._replace(faults=scores, others=tuple(rivals), corrected=corrected)


def _failed(problem: JointProblem) -> FilterOutcome:
    factor = problem.priors[0].factor
    return FilterOutcome(factor @ factor.T, 0, PREDICTION)


def most_probable(problem: JointProblem, smoothing: LinearSmoothing, max_passes: int) -> list[tuple[Filtered, bool]]:
    """Find the most probable trajectory from each start: where that ends, and whether at a minimum; the best first."""
    answers = []
    for start in _starts(problem, smoothing, max_passes):
        if (answer := minimise(smoothing, start, max_passes)) is not None:
            answers.append(answer)
            if _is_near(start, answer[0]) or sum(converged for _, converged in answers) == _MINIMA:
                break
    return sorted(answers, key=lambda answer: answer[0].cost)


def _starts(problem: JointProblem, smoothing: LinearSmoothing, max_passes: int) -> Iterator[Trajectory]:
    """Yield trajectories to start from: as a CKF has it, along the measurements, and the answer to more noise."""
    if (filtered := _ckf(problem)) is not None:
        yield filtered
    if (followed := follow(problem)) is not None:
        yield followed
        if (eased := _eased(problem, smoothing, followed, max_passes)) is not None:
            yield eased


def _eased(problem: JointProblem, smoothing: LinearSmoothing, start: Trajectory, max_passes: int) -> Trajectory | None:
    """Go to the answers to less and less process noise; None if the cost of a start is not finite.

    Little process noise makes a step cost much wherever the motion bends away from its linearisation, so that only
    ever shorter ones go down. With more of it parameters find their way first.
    """
    process, answer = problem.process, start
    for times in _EASED:
        smoothing.change_noise(process._replace(noise_density=times * process.noise_density), problem.sensors)
        found = minimise(smoothing, answer, max_passes)
        if found is None:
            answer = None
            break
        answer = found[0].trajectory
    smoothing.change_noise(process, problem.sensors)
    return answer


def follow(problem: JointProblem) -> Trajectory | None:
    """Keep the prior's parameters along the measurements; None if the filter fails."""
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
    outcome = one_after_the_other(run, problem, keep)
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
    chunks = [_answer(chunk, sensors) for chunk in smoothing.smooth(filtered, with_variance=True)]
    n_good = 0
    for moving, chunk in zip(nominal, reversed(chunks), strict=True):
        lost = np.flatnonzero(~(chunk.variance > 0.0).all(axis=1))
        good = int(lost[0]) if lost.size else len(moving)
        records = Records(
            np.hstack([np.tile(parameters, (good, 1)), (moving + share * chunk.step)[:good]]),
            np.hstack([np.tile(deviation, (good, 1)), np.sqrt(chunk.variance[:good])]),
            chunk.innovation,
            chunk.innovation_variance,
            chunk.nis,
            chunk.weight,
        )
        n_measurements = int(chunk.timeline.measurement_offset[good])
        on_chunk(chunk.timeline, until(records, good, n_measurements))
        n_good += good
        if lost.size:
            return FilterOutcome(covariance, n_good, PREDICTION)
    return FilterOutcome(covariance, n_good, OK)


class _Answer(NamedTuple):
    """What is handed over of a chunk; the traces of all of them would be large.

    Attributes
    ----------
    timeline : Timeline
    step, variance : ndarray, shape (n_events, n_moving)
    innovation, innovation_variance : ndarray, shape (n_measurements, c)
    nis : ndarray, shape (n_measurements,)
    weight : ndarray, shape (n_measurements, c), or None
    """

    timeline: Timeline
    step: Array
    variance: Array
    innovation: Array
    innovation_variance: Array
    nis: Array
    weight: Array | None


def _answer(chunk: Smoothed, sensors: Sensors) -> _Answer:
    trace, weights = chunk.trace, chunk.trace.weight
    counted = ~np.isnan(trace.innovation) & (weights >= SET_ASIDE)
    # What is judged is judged by the noise that is stated.
    by_weights = (1.0 / weights - 1.0) * sensors.variance[chunk.timeline.measurement_sensor]
    squares = np.where(counted, trace.error**2 / (trace.total - by_weights), 0.0)
    variance = np.where(counted, trace.variance - by_weights, np.nan)
    told = None if np.isinf(sensors.threshold) else weights.copy()
    of_measurements = trace.innovation, variance, squares.sum(axis=1), told
    return _Answer(chunk.timeline, chunk.step, chunk.variance, *of_measurements)
