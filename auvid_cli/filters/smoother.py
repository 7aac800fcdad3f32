"""Iterated smoother: the most probable trajectory and parameters.

Gauss-Newton on the cost of a whole trajectory (Bell, SIAM J. Optim. 4(3), 1994): the squares of process noise, of
residuals and of the distance from the prior, each divided by its variance. One pass through the data solves the
problem that is linear about the last trajectory: `gauss_newton` calls `LinearSmoothing.filter` (forward pass) and
`LinearSmoothing.step` (backward pass) in `auvid_cli.filters.linear_smoother`; these call `forward` in
`auvid_cli.filters.smoother_forward` and `backward` in `auvid_cli.filters.smoother_backward` chunk by chunk. A filter
linearises once, about its estimate at that time; the smoother linearises again about each better trajectory.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from auvid_cli.arrays import Array, ArrayStore
from auvid_cli.filters.autocorrelation import corrected_deviation
from auvid_cli.filters.fault_scores import score_faults
from auvid_cli.filters.linear_smoother import (
    MIN_DECREASE,
    Filtered,
    LinearSmoothing,
    Smoothed,
    Trajectory,
    convergence_status,
    gauss_newton,
)
from auvid_cli.filters.problem import (
    NOT_CONVERGED,
    OK,
    PREDICTION,
    AlternativeEstimate,
    FaultScores,
    FilterOutcome,
    Gaussian,
    JointProblem,
    OnChunk,
    Records,
    Sensors,
    Timeline,
    filter_sequentially,
)
from auvid_cli.filters.signatures import FaultEffects, Faults, Signatures, fault_signatures
from auvid_cli.filters.smoother_forward import MIN_WEIGHT, ForwardPass, Linearised
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature

# Distance from the start of the parameters beyond which other starts are tried, in standard deviations.
_MAX_DISTANCE = 1.0
# Factors of the process noise, one after another, for a start that does not converge with the stated noise.
_ANNEALING = 100.0, 10.0
# Factors for a start along the measurements.
_FOLLOWING_NOISE = 100.0
_FOLLOWING_PRIOR = 1e-3
# Number of minima to find from different starts.
_N_MINIMA = 2
# Largest number of passes from a start after another one has converged.
_PATIENCE = 20
# Largest cost increase of a reported minimum: it is at least 1 % as probable.
_MAX_COST_INCREASE = -2.0 * np.log(0.01)
# Size of a fault beyond which its effect is removed from the residuals that its standard deviation allows for, in
# standard deviations with white residuals.
_SIGNIFICANT = 3.0
# Smallest variance of a difference, relative to that of the segment: below is rounding.
_ROUNDING = 1e-6


def run_smoother(
    problem: JointProblem,
    on_chunk: OnChunk,
    max_passes: int = 50,
    faults: Faults | None = None,
    marginal: bool = False,
    start: Trajectory | None = None,
) -> FilterOutcome:
    """Estimate the most probable parameters and motion.

    The first start is the trajectory of a CKF. If the minimum is far from it, or there is none, the second start keeps
    the prior's parameters and follows the measurements. If these two do not both end in a minimum, the third start is
    the minimum with more process noise. The most probable minimum is the estimate. It is compared with the second one,
    and with the estimate from each segment alone. A given `start` with a finite cost is the only one.

    Parameters
    ----------
    problem : JointProblem
        The gate is ignored: every measurement counts.
    on_chunk : callable
        Receives constant parameters, the smoothed motion, and the innovations of the last forward pass.
    max_passes : int
        Maximum number of forward passes from each start, and of `marginal` steps.
    faults : Faults, optional
        To test about the estimate.
    marginal : bool
        Whether to maximise the posterior of the parameters with the motion integrated out.
    start : Trajectory, optional
        Of a similar model. The `marginal` search begins here, and not at the most probable trajectory.

    Returns
    -------
    FilterOutcome
        `NOT_CONVERGED` after `max_passes`. `PREDICTION` if no start has a finite cost, if the motion diverges for the
        parameters, or if a smoothed variance is lost in rounding.
    """
    smoothing = LinearSmoothing(problem)
    # The marginal estimate can be far from the most probable trajectory.
    near = smoothing.filter(start) if marginal and start is not None else None
    minima = [(near, True)] if near is not None else most_probable(problem, smoothing, max_passes, first=start)
    if not minima:
        return _failed(problem)
    (best, converged), *others = minima
    rest = convergence_status(best)
    if not converged:
        return _report(problem, smoothing, best, on_chunk)._replace(failure=NOT_CONVERGED, convergence=rest)
    alternatives = [found for other, _ in others if (found := other_minimum(best, other)) is not None]
    if len(problem.segments) > 1:
        alternatives += _segment_estimates(problem, best)
    estimate, score = best, score_faults
    # Without a status if the last steps were as small as usual.
    convergence = rest._replace(is_negligible=True) if rest.cost_decrease > MIN_DECREASE else None
    if marginal:
        # Its compiled code serves no other estimate.
        from auvid_cli.filters.marginal import marginal_estimate
        from auvid_cli.filters.marginal_gradient import marginal_scores

        found = marginal_estimate(problem, smoothing, best, max_passes)
        if found is None:
            return _failed(problem)
        problem, estimate, convergence = found
        score = marginal_scores
    outcome = _report(problem, smoothing, estimate, on_chunk, is_estimate=marginal)
    if outcome.failure != OK:
        return outcome
    outcome = outcome._replace(convergence=convergence)
    if convergence is not None and not convergence.is_negligible:
        return outcome._replace(failure=NOT_CONVERGED)
    signatures = Signatures(problem, smoothing, estimate, faults)
    corrected, scores = _corrected_deviation(signatures, None if faults is None else score(signatures))
    outcome = outcome._replace(faults=scores, others=tuple(alternatives), corrected=corrected)
    if faults is None:
        return outcome
    return outcome._replace(without_faults=partial(_without_faults, problem.sensors, smoothing, estimate, faults))


def most_probable(
    problem: JointProblem,
    smoothing: LinearSmoothing,
    max_passes: int,
    enough: int = _N_MINIMA,
    first: Trajectory | None = None,
) -> list[tuple[Filtered, bool]]:
    """Return the last iterate from each start until `enough` converged, and whether it did; the most probable first.

    If the `first` start has a finite cost, it is the only one.
    """
    minima = list[tuple[Filtered, bool]]()

    def passes() -> int:
        return min(max_passes, _PATIENCE) if any(converged for _, converged in minima) else max_passes

    if first is not None and (minimum := gauss_newton(smoothing, first, max_passes)) is not None:
        return [minimum]
    for start in _starts(problem, smoothing, passes):
        limit = passes()
        minimum = gauss_newton(smoothing, start, limit)
        if minimum is None:
            continue
        iterate, converged = minimum
        if not converged and limit < max_passes and all(iterate.cost < other.cost for other, _ in minima):
            # It is the most probable one so far, so it has to converge.
            minimum = gauss_newton(smoothing, iterate.trajectory, max_passes - limit)
            assert minimum is not None, "the cost of this trajectory is finite"
        minima.append(minimum)
        if _is_near(start, minimum[0]) or sum(converged for _, converged in minima) == enough:
            break
    return sorted(minima, key=lambda minimum: minimum[0].cost)


def _starts(problem: JointProblem, smoothing: LinearSmoothing, passes: Callable[[], int]) -> Iterator[Trajectory]:
    """Yield the trajectory of a CKF, one along the measurements, and the minimum with more process noise.

    `passes` returns the largest number of forward passes now.
    """
    if (filtered := _ckf(problem)) is not None:
        yield filtered
    if (followed := follow_measurements(problem)) is not None:
        yield followed
        if (annealed := _anneal_process_noise(problem, smoothing, followed, passes())) is not None:
            yield annealed


def _ckf(problem: JointProblem) -> Trajectory | None:
    """Return the trajectory of a CKF; None if the filter fails."""
    n_parameters, priors = problem.n_parameters, problem.priors
    parameters, initial, moving = problem.prior.mean[:n_parameters], list[Array](), list[ArrayStore]()

    def keep(timeline: Timeline, records: Records) -> None:
        nonlocal parameters
        if len(records.mean):
            parameters = records.mean[-1, :n_parameters].copy()
        states = records.mean[:, n_parameters:].copy()
        if not moving[-1] and len(states):
            before = priors[len(moving) - 1].mean[n_parameters:]
            initial.append(before if timeline.has_initial_substep else states[0])
        moving[-1].append(states)

    def run(timelines: Iterable[Timeline], gaussian: Gaussian, on_chunk: OnChunk) -> FilterOutcome:
        moving.append(ArrayStore())
        return run_square_root_filter(points, problem.process, problem.sensors, timelines, gaussian, on_chunk)

    points = cubature(n_parameters + problem.n_moving)
    outcome = filter_sequentially(run, problem, keep)
    return Trajectory(parameters, initial, moving) if outcome.failure == OK else None


def follow_measurements(problem: JointProblem) -> Trajectory | None:
    """Return a trajectory along the measurements with the prior's parameters; None if the filter fails."""
    process, prior, n_parameters = problem.process, problem.prior, problem.n_parameters
    noisy = process._replace(noise_density=_FOLLOWING_NOISE * process.noise_density)
    factor = prior.factor.copy()
    factor[:, :n_parameters] *= _FOLLOWING_PRIOR
    followed = _ckf(problem._replace(process=noisy, prior=prior._replace(factor=factor)))
    return None if followed is None else replace(followed, parameters=prior.mean[:n_parameters])


def _anneal_process_noise(
    problem: JointProblem, smoothing: LinearSmoothing, start: Trajectory, max_passes: int
) -> Trajectory | None:
    """Return the minimum with more, then less, process noise; None if the cost of a start is not finite.

    With little process noise a nonlinear motion limits the steps to short ones. With more of it the parameters
    converge first.
    """
    process, trajectory = problem.process, start
    for factor in _ANNEALING:
        more = process._replace(noise_density=factor * process.noise_density)
        smoothing.change_noise(problem._replace(process=more))
        minimum = gauss_newton(smoothing, trajectory, max_passes)
        if minimum is None:
            trajectory = None
            break
        trajectory = minimum[0].trajectory
    smoothing.change_noise(problem)
    return trajectory


def _is_near(start: Trajectory, minimum: Filtered) -> bool:
    """Whether a minimum has the parameters of its start, within their uncertainty."""
    n_parameters = start.parameters.size
    deviation = np.sqrt(np.diagonal(minimum.final.covariance())[:n_parameters])
    moved = minimum.trajectory.parameters + minimum.final.mean[:n_parameters] - start.parameters
    return bool((np.abs(moved) <= _MAX_DISTANCE * deviation).all())


def other_minimum(best: Filtered, other: Filtered) -> AlternativeEstimate | None:
    """Return the estimate of another minimum; None if it is the same or far less probable."""
    n = best.trajectory.parameters.size
    deviation = np.sqrt(np.diagonal(best.final.covariance())[:n])
    estimate, alternative = (found.trajectory.parameters + found.final.mean[:n] for found in (best, other))
    increase = other.cost - best.cost
    if increase > _MAX_COST_INCREASE:
        return None
    return AlternativeEstimate.of_minimum(alternative - estimate, deviation, increase)


def _segment_estimates(problem: JointProblem, best: Filtered) -> Iterator[AlternativeEstimate]:
    """Yield the estimate from each segment alone, linearised about the joint estimate.

    An estimate a from one segment, of covariance C, and b from all segments, of covariance P, share the data of the
    segment and the prior. If one model holds for all segments, the covariance of a and b is P, and that of their
    difference ``C - P`` (Hausman, Econometrica 46(6), 1978).
    """
    trajectory, n = best.trajectory, best.trajectory.parameters.size
    joint, variance = best.final.mean[:n], np.diagonal(best.final.covariance())[:n]
    for segment, initial, moving in zip(problem.by_segment(), trajectory.initial, trajectory.moving, strict=True):
        filtered = LinearSmoothing(segment).filter(Trajectory(trajectory.parameters, [initial], [moving]))
        assert filtered is not None, "with the other segments its trajectory has a finite cost"
        own_variance = np.diagonal(filtered.final.covariance())[:n]
        difference = own_variance - variance
        comparable = difference > _ROUNDING * own_variance
        deviation = np.sqrt(np.where(comparable, difference, np.inf))
        begin = next(iter(segment.segments[0])).time[0]
        moved = np.where(comparable, deviation, 0.0) * variance / own_variance
        yield AlternativeEstimate(filtered.final.mean[:n] - joint, deviation, moved, begin=begin)


def _failed(problem: JointProblem) -> FilterOutcome:
    factor = problem.priors[0].factor
    return FilterOutcome(factor @ factor.T, 0, PREDICTION)


def _report(
    problem: JointProblem,
    smoothing: LinearSmoothing,
    filtered: Filtered,
    on_chunk: OnChunk,
    is_estimate: bool = False,
) -> FilterOutcome:
    """Pass the smoothed trajectory to `on_chunk`, or the nominal one if that `is_estimate`."""
    covariance = filtered.final.covariance()
    n_parameters, fraction = filtered.trajectory.parameters.size, 0.0 if is_estimate else 1.0
    parameters = filtered.trajectory.parameters + fraction * filtered.final.mean[:n_parameters]
    deviation = np.sqrt(np.diagonal(covariance)[:n_parameters])
    nominal = (moving for segment in filtered.trajectory.moving for moving in segment)
    # Chunks come from the last to the first.
    smoothed, weights = [ArrayStore() for _ in Records._fields[:-1]], ArrayStore()
    for chunk in smoothing.smooth(filtered):
        *rows, weight = _records(chunk, problem.sensors)
        for store, array in zip(smoothed, rows, strict=True):
            store.append(array)
        if weight is not None:
            weights.append(weight)
    for store in (*smoothed, weights):
        store.reverse()
    timelines, n_good = (timeline for segment in problem.segments for timeline in segment), 0
    for number, (moving, timeline) in enumerate(zip(nominal, timelines, strict=True)):
        weight = weights[number] if weights else None
        of_motion = Records(*(store[number] for store in smoothed), weight=weight)
        step, variance = of_motion[:2]
        lost = np.flatnonzero(~(variance > 0.0).all(axis=1))
        good = int(lost[0]) if lost.size else len(moving)
        records = of_motion._replace(
            mean=np.hstack([np.tile(parameters, (good, 1)), (moving + fraction * step)[:good]]),
            standard_deviation=np.hstack([np.tile(deviation, (good, 1)), np.sqrt(variance[:good])]),
        )
        on_chunk(timeline, records.truncate(good, int(timeline.measurement_offset[good])))
        n_good += good
        if lost.size:
            return FilterOutcome(covariance, n_good, PREDICTION)
    return FilterOutcome(covariance, n_good, OK)


def _records(chunk: Smoothed, sensors: Sensors) -> Records:
    """Return step and variance of the motion in place of mean and deviation, and innovations, without the rest."""
    return Records(chunk.step, chunk.variance, *_innovations(chunk.timeline, chunk.forward_pass, sensors))


def _innovations(
    timeline: Timeline, forward_pass: ForwardPass, sensors: Sensors
) -> tuple[Array, Array, Array, Array | None]:
    """Return innovations, their variance, NIS and weights."""
    weights = forward_pass.weight
    counted = ~np.isnan(forward_pass.innovation) & (weights >= MIN_WEIGHT)
    # Innovations are compared with the stated noise, not with that of the weights.
    excess = (1.0 / weights - 1.0) * sensors.variance[timeline.measurement_sensor]
    squares = np.where(counted, forward_pass.error**2 / (forward_pass.total - excess), 0.0)
    variance = np.where(counted, forward_pass.variance - excess, np.nan)
    kept_weights = None if np.isinf(sensors.threshold) else weights.copy()
    return forward_pass.innovation, variance, squares.sum(axis=1), kept_weights


def _without_faults(
    sensors: Sensors, smoothing: LinearSmoothing, filtered: Filtered, faults: Faults, sizes: Array
) -> Iterator[tuple[Timeline, Records]]:
    """Yield data and innovations less the effects of faults of some sizes, chunk by chunk; without states.

    These are the innovations of sequential updates, component by component, which are independent.
    """

    def together(segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        return FaultEffects(*((each @ sizes)[..., None] for each in faults.effects(segment, timeline, about)))

    no_states = np.zeros((0, 0))
    for chunk in fault_signatures(smoothing, filtered, 1, together):
        left, total = (
            np.where(chunk.present, values, np.nan)
            for values in (chunk.forward_pass.error - chunk.effect[..., 0], chunk.forward_pass.total)
        )
        changed = chunk.forward_pass._replace(error=left, innovation=left, variance=total)
        yield chunk.timeline, Records(no_states, no_states, *_innovations(chunk.timeline, changed, sensors))


def _corrected_deviation(signatures: Signatures, scores: FaultScores | None) -> tuple[Array, FaultScores | None]:
    """Return standard deviations that allow for autocorrelated innovations, and the scores with their inflation."""
    nominal, n_channels = np.sqrt(np.diagonal(signatures.covariance)), signatures.problem.sensors.variance.size
    n = nominal.size
    if scores is None:
        return corrected_deviation(nominal, signatures.influences(), n_channels), None
    information = np.diagonal(scores.information)
    own, observable = np.sqrt(information), information > 0.0
    removed = np.where(np.abs(scores.score) > _SIGNIFICANT * own, scores.score, 0.0)
    # With a fault of unit size, the parameters change by its effect.
    variance = np.divide(1.0, information, out=np.zeros_like(information), where=observable)
    of_parameters = np.vstack([signatures.covariance, np.zeros((variance.size, n))])
    of_faults = np.vstack([scores.effect, np.eye(variance.size)]) * variance
    deviation = corrected_deviation(
        np.append(nominal, 1.0 / np.where(observable, own, np.inf)),
        signatures.influences(np.hstack([of_parameters, of_faults])),
        n_channels,
        np.append(np.zeros(n), removed),
    )
    return deviation[:n], scores._replace(inflation=np.where(observable, deviation[n:] * own, 1.0))
