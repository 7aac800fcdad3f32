"""Output-error method: parameters and initial motions whose simulated motion fits all measurements best."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.influence_functions import corrected_free_motion
from auvid_cli.filters.least_squares import Information, LeastSquaresFit, Uncertainty, fit_free_motion
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
)
from auvid_cli.filters.segments import JointProblem, filter_sequentially
from auvid_cli.filters.sensitivities import Response, responses
from auvid_cli.filters.smoother_forward import SET_ASIDE, weight
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature

Array = NDArray[np.float64]
# Shares of a residual's variance below this are rounding: measurements that the fit meets exactly say nothing.
_ROUNDING = 1e-9
# Events of the first span of a segment, some 40 s of a 100 Hz sensor: few enough for parameters that are somewhat off
# not to lose the motion altogether, and enough to correct them. Parameters that are far off lose it within seconds.
_FIRST_SPAN, _FIRST_SPAN_FROM_AFAR = 4000, 250
# A fit of a span that is not the whole only has to come near enough for the next.
_EVALUATIONS_OF_A_SPAN = 10
# Standard deviations by which a fit may be off the start that led to it, or off another fit, before it is doubted.
_FAR = 2.5
# Passes through the data of the smoother from which a fit may start.
_PASSES = 50
# Gains in the sum of squares, as shares of it, that end the fit of a span and of the whole.
_COARSE, _FINE = 1e-5, 1e-9


def hand_over(
    solution: Iterable[Response], sensors: Sensors, uncertainty: Uncertainty, on_chunk: OnChunk
) -> tuple[Array, int]:
    """Pass on the motion from a fitted state, chunk by chunk.

    Parameters
    ----------
    solution : iterable of Response
        From the fitted state.
    sensors : Sensors
    uncertainty : Uncertainty
        Of the fitted state, P.
    on_chunk : callable
        Told every chunk. Standard deviations are those of ``X_k P X_k'``. For measurements that were fitted the
        variance of a residual is what the fit leaves of the noise, ``S = noise - H X_k P X_k' H'``; the NIS is ``r'
        S^-1 r``.

    Returns
    -------
    covariance : ndarray, shape (n, n)
        Of the state after the last sound event.
    n_good : int
        Events until the end, or until the motion blew up.
    """
    n = len(uncertainty.root)
    n_good, last = 0, np.eye(n)
    for response in solution:
        on_chunk(response.timeline, _records(response, sensors, uncertainty))
        if len(response.mean):
            moving = response.sensitivity[-1]
            last = np.vstack([np.eye(n)[: n - len(moving)], moving])
        n_good += len(response.mean)
    return uncertainty.covariance(last), n_good


def _records(response: Response, sensors: Sensors, uncertainty: Uncertainty) -> Records:
    events, n = response.mean.shape
    n_parameters = n - response.sensitivity.shape[1]
    deviation = np.empty((events, n))
    deviation[:, :n_parameters] = uncertainty.deviation(np.eye(n)[:n_parameters])
    deviation[:, n_parameters:] = uncertainty.deviation(response.sensitivity)
    weights, whitened = None, response.whitened
    if not np.isinf(sensors.threshold):
        weights = weight(whitened[..., -1] ** 2, sensors.threshold)
        whitened = np.where(weights[..., None] < SET_ASIDE, 0.0, whitened)
    variance, nis = _left_over(response._replace(whitened=whitened), sensors, uncertainty)
    if weights is not None:
        variance[weights < SET_ASIDE] = np.nan
    return Records(response.mean, deviation, response.innovation, variance, nis, weights)


def _left_over(response: Response, sensors: Sensors, uncertainty: Uncertainty) -> tuple[Array, Array]:
    """Return the variance of each residual and normalised residual squared of each measurement."""
    explained = response.whitened[..., :-1] @ uncertainty.root
    share = explained @ explained.swapaxes(-1, -2)
    sensor = response.timeline.measurement_sensor[: len(share)]
    left = np.maximum(1.0 - np.diagonal(share, axis1=1, axis2=2), 0.0)
    variance = np.where(np.isnan(response.innovation), np.nan, sensors.variance[sensor] * left)
    # Missing components have rows of zeros: a residual of nothing.
    shares, directions = np.linalg.eigh(share)
    parts = np.einsum("kij,ki->kj", directions, response.whitened[..., -1])
    free = 1.0 - shares
    nis = np.where(free > _ROUNDING, parts**2 / np.maximum(free, _ROUNDING), 0.0).sum(axis=1)
    return variance, nis


def run_output_error(
    problem: JointProblem,
    on_chunk: OnChunk,
    max_evaluations: int = 100,
    bounds: tuple[Array, Array] | None = None,
    use_prior: bool = False,
) -> FilterOutcome:
    """Fit parameters, and the initial motion of each segment, to data.

    It starts from the final parameters of a CKF and the prior's motions. Where there are none, or the fit is far from
    them, it starts once more from the prior's parameters, and if that leads elsewhere, from a smoother's answer. The
    fit of the lowest cost counts, and is compared with the others.

    The free motion over all of a run is soon lost where parameters are off, its sum of squares full of local minima. So
    it fits the beginning of each segment first, held by the prior's spread about where it starts, and goes on to twice
    as much.

    Parameters
    ----------
    problem : JointProblem
        The process noise serves only the starts, and so does the prior, unless `use_prior`.
    on_chunk : callable
        What it receives is the solution, see `hand_over`, segment after segment.
    max_evaluations : int
        Of the motion along the data, from each start.
    bounds : tuple of ndarray, shape (n,)
        Lower and upper, of the joint state; the covariance does not know of them.
    use_prior : bool
        Whether the prior counts for as much as it says: the posterior mode instead of maximum likelihood.

    Returns
    -------
    FilterOutcome
        `NOT_CONVERGED` if `max_evaluations` were not enough; `PREDICTION` if a motion from the best state blows
        up. The covariance is of the state of the last segment.
    """
    prior = problem.prior
    box = bounds or (np.full(prior.mean.size, -np.inf), np.full(prior.mean.size, np.inf))
    sizes = [sum(timeline.time.size for timeline in timelines) for timelines in problem.segments]
    longest = max(sizes)

    def fit_first(n_events: int, start: Array, evaluations: int) -> LeastSquaresFit | None:
        firsts = problem._replace(segments=[FirstEvents(timelines, n_events) for timelines in problem.segments])
        if n_events < longest:
            about_start, evaluations = Gaussian(start, prior.factor), min(evaluations, _EVALUATIONS_OF_A_SPAN)
            return fit_free_motion(firsts, start, about_start, box, _COARSE, evaluations)
        return fit_free_motion(firsts, start, prior if use_prior else None, box, _FINE, evaluations)

    fits: list[LeastSquaresFit] = []
    for start in _starts(problem):
        fit = _fit_longer_and_longer(fit_first, np.clip(start.state, *box), start.span, longest, max_evaluations)
        if use_prior:
            fit = fit._replace(information=fit.information.join(Information.of_gaussian(prior, fit.state)))
        known = [start, *(_Start(other.state) for other in fits if other.converged)]
        fits.append(fit)
        if fit.converged and any(_is_near(fit, other, problem.n_parameters) for other in known):
            break
    # Of fits that end in the same place the first counts, however the last digits of their costs are.
    best, *others = sorted(fits, key=lambda fit: (-fit.fraction, round(fit.cost, 1)))
    outcome = _hand_over_segments(problem, sizes, best, on_chunk)
    deviation = best.deviation(problem.n_parameters)
    if outcome.failure == NOT_CONVERGED:
        return outcome._replace(convergence=_convergence(best, deviation))
    rivals = (
        AlternativeEstimate.of_minimum((other.state - best.state)[: deviation.size], deviation, other.cost - best.cost)
        for other in others
        if other.converged
    )
    return outcome._replace(others=tuple(rival for rival in rivals if rival is not None))


class _Start(NamedTuple):
    """Where a fit may start.

    Attributes
    ----------
    state : ndarray, shape (n,)
        Of the joint state.
    deviation : ndarray, shape (n_parameters,), or 0
        How far off the parameters are, by whoever found them.
    span : int
        Events to be fitted first.
    """

    state: Array
    deviation: Array | float = 0.0
    span: int = _FIRST_SPAN


def _is_near(fit: LeastSquaresFit, start: _Start, n_parameters: int) -> bool:
    """Say whether a fit has the parameters of a start, within what is not known of both.

    What a fit knows nothing of it must not have moved: far from the data, where motions lose all order, everything is
    unknown, and no fit would be far from anywhere.
    """
    moved, deviation = np.abs(fit.state - start.state)[:n_parameters], fit.deviation(n_parameters)
    unknown = np.maximum(start.deviation, np.where(np.isinf(deviation), 0.0, deviation))
    return bool((moved <= _FAR * unknown).all())


def _starts(problem: JointProblem) -> Iterator[_Start]:
    """Yield starts: parameters as a CKF leaves them, those of the prior, and a smoother's answer."""
    if (filtered := _filtered(problem)) is not None:
        yield filtered
    yield _Start(problem.prior.mean, span=_FIRST_SPAN_FROM_AFAR)
    # What it is compiled from is seldom wanted here.
    from auvid_cli.filters.linear_smoother import LinearSmoothing
    from auvid_cli.filters.smoother import most_probable

    for smoothed, _ in most_probable(problem, LinearSmoothing(problem), _PASSES)[:1]:
        trajectory = smoothed.trajectory
        yield _Start(np.concatenate([trajectory.parameters, *trajectory.initial]))


def _convergence(fit: LeastSquaresFit, deviation: Array) -> ConvergenceStatus:
    """Say how far from its end a fit was."""
    factor, projected, root = fit.information.factor, fit.information.projected, fit.information.uncertainty().root
    step = root @ (root.T @ (factor.T @ projected))
    return ConvergenceStatus(float(projected @ projected), step[: deviation.size] / deviation, fit.fraction)


def _fit_longer_and_longer(
    fit_first: Callable[[int, Array, int], LeastSquaresFit | None],
    start: Array,
    span: int,
    longest: int,
    max_evaluations: int,
) -> LeastSquaresFit:
    """Fit the first events of each segment, then twice as many, to the end; fewer more where the motion blows up.

    Parameters
    ----------
    fit_first : callable
        Fits so many events, from a state, with at most so many evaluations.
    start : ndarray, shape (n,)
    span, longest : int
        How many events to begin with, and how many the longest segment has.
    max_evaluations : int

    Returns
    -------
    LeastSquaresFit
        The last one that there is; converged, with a cost to be compared, only if it is one of all events.
    """
    best = LeastSquaresFit(start, Information.empty(start.size), np.inf, converged=False, evaluations=0)
    fitted, span, left = 0, min(span, longest), max_evaluations
    while left > 0 and fitted < span:
        longer = fit_first(span, best.state, left)
        if longer is None:
            span, left = (fitted + span) // 2, left - 1
        else:
            best, left = longer, left - longer.evaluations
            fitted, span = span, min(2 * span, longest)
    return best if fitted == longest else best._replace(converged=False, cost=np.inf, share=fitted / longest)


def _hand_over_segments(
    problem: JointProblem, sizes: Sequence[int], best: LeastSquaresFit, on_chunk: OnChunk
) -> FilterOutcome:
    """Pass on the motion from the fitted state, segment after segment, up to where it blows up."""
    uncertainty, n_good, covariance = best.information.uncertainty(), 0, np.zeros((0, 0))
    for timelines, size, place in zip(problem.segments, sizes, problem.indices, strict=True):
        solution = responses(problem.process, problem.sensors, timelines, best.state[place])
        covariance, reached = hand_over(solution, problem.sensors, uncertainty.of(place), on_chunk)
        n_good += reached
        if reached < size:
            return FilterOutcome(covariance, n_good, PREDICTION)
    if not best.converged:
        return FilterOutcome(covariance, n_good, NOT_CONVERGED)
    return FilterOutcome(covariance, n_good, OK, corrected=corrected_free_motion(problem, best.state, uncertainty))


def _filtered(problem: JointProblem) -> _Start | None:
    """Return the parameters as a CKF leaves them and the motions as the prior has them; None if the CKF fails."""
    n_parameters = problem.n_parameters
    guess, deviation = problem.prior.mean.copy(), np.zeros(n_parameters)

    def keep_last(timeline: Timeline, records: Records) -> None:
        if len(records.mean):
            guess[:n_parameters] = records.mean[-1, :n_parameters]
            deviation[:] = records.standard_deviation[-1, :n_parameters]

    run = partial(run_square_root_filter, cubature(n_parameters + problem.n_moving), *problem[:2])
    outcome = filter_sequentially(run, problem, keep_last)
    return _Start(guess, deviation) if outcome.failure == OK else None


class FirstEvents:
    """The first so many events of some chunks, to be gone through any number of times.

    Parameters
    ----------
    timelines : iterable of Timeline
        Chunks in time order.
    n_events : int
    """

    def __init__(self, timelines: Iterable[Timeline], n_events: int) -> None:
        self._timelines, self._n_events = timelines, n_events

    def __iter__(self) -> Iterator[Timeline]:
        left = self._n_events
        for timeline in self._timelines:
            yield timeline if timeline.time.size <= left else _cut(timeline, left)
            left -= timeline.time.size
            if left <= 0:
                return


def _cut(timeline: Timeline, n_events: int) -> Timeline:
    substeps, measurements = timeline.substep_offset[n_events], timeline.measurement_offset[n_events]
    return Timeline(
        timeline.time[:n_events],
        timeline.substep_offset[: n_events + 1],
        timeline.substep_duration[:substeps],
        timeline.substep_input[:substeps],
        timeline.inputs,
        timeline.event_input[:n_events],
        timeline.measurement_offset[: n_events + 1],
        timeline.measurement_sensor[:measurements],
        timeline.measurement[:measurements],
    )
