"""Output-error method: parameters and initial motions whose simulated motion fits all measurements best.

The least-squares fit itself is in `auvid_cli.filters.least_squares`; this module chooses its starts and spans.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.autocorrelation import ResidualRows, cached, corrected_deviation
from auvid_cli.filters.least_squares import Information, LeastSquaresFit, Uncertainty, fit_free_motion
from auvid_cli.filters.problem import (
    NOT_CONVERGED,
    OK,
    PREDICTION,
    AlternativeEstimate,
    ConvergenceStatus,
    FilterOutcome,
    Gaussian,
    JointProblem,
    OnChunk,
    Records,
    Sensors,
    Timeline,
    filter_sequentially,
)
from auvid_cli.filters.sensitivities import Response, responses
from auvid_cli.filters.smoother_forward import MIN_WEIGHT, weight
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature

# Smallest variance of a residual, relative to the noise; with a smaller one the fit meets the measurement exactly.
_ROUNDING = 1e-9
# Events of the first span of a segment, some 40 s at 100 Hz: enough to correct the parameters of a CKF.
FIRST_SPAN = 4000
# Events of the first span from the prior's parameters, with which the motion departs from the true one in seconds.
FIRST_SPAN_FROM_PRIOR = 250
# Maximum number of evaluations for a span of the data; its fit is only the start of the fit of the next span.
_EVALUATIONS_OF_SPAN = 10
# Largest distance of a fit from its start or from another fit, in standard deviations; beyond, other starts are tried.
_MAX_DISTANCE = 2.5
# Maximum number of passes of the smoother whose estimate is a start.
_SMOOTHER_PASSES = 50
# Relative decrease of the sum of squares at which the fit of a span ends.
_SPAN_TOLERANCE = 1e-5
# Relative decrease at which the fit of all events ends.
_FINAL_TOLERANCE = 1e-9


def _report_segment(
    solution: Iterable[Response], sensors: Sensors, uncertainty: Uncertainty, on_chunk: OnChunk
) -> tuple[Array, int]:
    """Pass the motion from a fitted state of covariance P to `on_chunk`.

    With the sensitivity X_k of event k, states have the covariance ``X_k P X_k'``. A fitted measurement has a residual
    r of covariance ``S = R - H X_k P X_k' H'``, and the NIS ``r' S^-1 r``.

    Returns
    -------
    covariance : ndarray, shape (n, n)
        Covariance of the state after the last good event.
    n_good : int
        Number of events until the motion diverges.
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
        whitened = np.where(weights[..., None] < MIN_WEIGHT, 0.0, whitened)
    variance, nis = _residual_variance(response._replace(whitened=whitened), sensors, uncertainty)
    if weights is not None:
        variance[weights < MIN_WEIGHT] = np.nan
    return Records(response.mean, deviation, response.innovation, variance, nis, weights)


def _residual_variance(response: Response, sensors: Sensors, uncertainty: Uncertainty) -> tuple[Array, Array]:
    """Return the variance of each residual, and the normalised residual squared of each measurement."""
    explained = response.whitened[..., :-1] @ uncertainty.root
    share = explained @ explained.swapaxes(-1, -2)
    sensor = response.timeline.measurement_sensor[: len(share)]
    remaining = np.maximum(1.0 - np.diagonal(share, axis1=1, axis2=2), 0.0)
    variance = np.where(np.isnan(response.innovation), np.nan, sensors.variance[sensor] * remaining)
    # Missing components have rows of zeros, and so a zero residual.
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

    The first start has the final parameters of a CKF. If the CKF fails, or the fit is far from its start, the second
    start has the prior's parameters, and if that leads to another fit, the third is the estimate of a smoother. The fit
    with the lowest cost is the estimate, and is compared with the others.

    With wrong parameters the simulated motion departs from the true one, and the sum of squares over a whole run has
    many local minima. So the fit begins with a first span of each segment, with a prior about the start, and doubles
    the span until it covers all events.

    Parameters
    ----------
    problem : JointProblem
        The process noise is used for the starts only, and so is the prior unless `use_prior`.
    on_chunk : callable
        Receives the fitted motion.
    max_evaluations : int
        Maximum number of simulations of the motion from each start.
    bounds : tuple of ndarray, shape (n,)
        Lower and upper bounds of the joint state; the covariance ignores them.
    use_prior : bool
        Whether to find the posterior mode instead of the maximum of the likelihood.

    Returns
    -------
    FilterOutcome
        `NOT_CONVERGED` after `max_evaluations`; `PREDICTION` if the fitted motion diverges. The covariance is that of
        the last segment's state.
    """
    prior = problem.prior
    box = bounds or (np.full(prior.mean.size, -np.inf), np.full(prior.mean.size, np.inf))
    sizes = [sum(timeline.time.size for timeline in timelines) for timelines in problem.segments]
    longest = max(sizes)

    def fit_first(n_events: int, start: Array, evaluations: int) -> LeastSquaresFit | None:
        firsts = problem._replace(segments=[FirstEvents(timelines, n_events) for timelines in problem.segments])
        if n_events < longest:
            about_start, evaluations = Gaussian(start, prior.factor), min(evaluations, _EVALUATIONS_OF_SPAN)
            return fit_free_motion(firsts, start, about_start, box, _SPAN_TOLERANCE, evaluations)
        return fit_free_motion(firsts, start, prior if use_prior else None, box, _FINAL_TOLERANCE, evaluations)

    fits: list[LeastSquaresFit] = []
    for start in _starts(problem):
        fit = _fit_growing_spans(
            fit_first, np.clip(start.state, *box), start.span or FIRST_SPAN, longest, max_evaluations
        )
        if use_prior:
            fit = fit._replace(information=fit.information.join(Information.of_gaussian(prior, fit.state)))
        references = [start, *(_Start(other.state) for other in fits if other.converged)]
        fits.append(fit)
        if fit.converged and any(_is_near(fit, other, problem.n_parameters) for other in references):
            break
    # Costs are rounded, so that the first of equal fits counts.
    best, *others = sorted(fits, key=lambda fit: (-fit.fraction, round(fit.cost, 1)))
    outcome = _report(problem, sizes, best, on_chunk)
    deviation = best.deviation(problem.n_parameters)
    if outcome.failure == NOT_CONVERGED:
        return outcome._replace(convergence=_convergence(best, deviation))
    alternatives = (
        AlternativeEstimate.of_minimum((other.state - best.state)[: deviation.size], deviation, other.cost - best.cost)
        for other in others
        if other.converged
    )
    return outcome._replace(others=tuple(found for found in alternatives if found is not None))


class _Start(NamedTuple):
    """Start of a fit."""

    state: Array  # shape (n,); joint state
    deviation: Array | float = 0.0  # shape (n_parameters,), or 0; standard deviations of its parameters
    span: int | None = None  # number of events to fit first; by default `FIRST_SPAN`


def _is_near(fit: LeastSquaresFit, start: _Start, n_parameters: int) -> bool:
    """Whether a fit has the parameters of a start, within the uncertainties of both.

    An unobserved parameter, of infinite deviation, must have the same value: a fit far from the data observes nothing,
    and would be near every start.
    """
    moved, deviation = np.abs(fit.state - start.state)[:n_parameters], fit.deviation(n_parameters)
    uncertainty = np.maximum(start.deviation, np.where(np.isinf(deviation), 0.0, deviation))
    return bool((moved <= _MAX_DISTANCE * uncertainty).all())


def _starts(problem: JointProblem) -> Iterator[_Start]:
    """Yield starts with the parameters of a CKF, of the prior, and of a smoother."""
    if (filtered := _ckf(problem)) is not None:
        yield filtered
    yield _Start(problem.prior.mean, span=FIRST_SPAN_FROM_PRIOR)
    # Compiled code that is seldom needed here.
    from auvid_cli.filters.linear_smoother import LinearSmoothing
    from auvid_cli.filters.smoother import most_probable

    for smoothed, _ in most_probable(problem, LinearSmoothing(problem), _SMOOTHER_PASSES)[:1]:
        trajectory = smoothed.trajectory
        yield _Start(np.concatenate([trajectory.parameters, *trajectory.initial]))


def _convergence(fit: LeastSquaresFit, deviation: Array) -> ConvergenceStatus:
    """Return the distance of a fit from convergence."""
    factor, projected, root = fit.information.factor, fit.information.projected, fit.information.uncertainty().root
    step = root @ (root.T @ (factor.T @ projected))
    return ConvergenceStatus(float(projected @ projected), step[: deviation.size] / deviation, fit.fraction)


def _fit_growing_spans(
    fit_first: Callable[[int, Array, int], LeastSquaresFit | None],
    start: Array,
    span: int,
    longest: int,
    max_evaluations: int,
) -> LeastSquaresFit:
    """Fit the first `span` events of each segment, then twice as many, up to the `longest` segment.

    Where the motion diverges, the next span is shorter. Returns the last fit; converged, with a finite cost, only if it
    covers all events.

    Parameters
    ----------
    fit_first : callable
        Fits a number of events, from a state, with a maximum number of evaluations.
    """
    best = LeastSquaresFit(start, Information.empty(start.size), np.inf, converged=False, evaluations=0)
    fitted, span, remaining = 0, min(span, longest), max_evaluations
    while remaining > 0 and fitted < span:
        longer = fit_first(span, best.state, remaining)
        if longer is None:
            span, remaining = (fitted + span) // 2, remaining - 1
        else:
            best, remaining = longer, remaining - longer.evaluations
            fitted, span = span, min(2 * span, longest)
    return best if fitted == longest else best._replace(converged=False, cost=np.inf, fraction=fitted / longest)


def _report(problem: JointProblem, sizes: Sequence[int], best: LeastSquaresFit, on_chunk: OnChunk) -> FilterOutcome:
    """Pass the fitted motion of all segments to `on_chunk`, until it diverges."""
    uncertainty, n_good, covariance = best.information.uncertainty(), 0, np.zeros((0, 0))
    for timelines, size, place in zip(problem.segments, sizes, problem.indices, strict=True):
        solution = responses(problem.process, problem.sensors, timelines, best.state[place])
        covariance, reached = _report_segment(solution, problem.sensors, uncertainty.of(place), on_chunk)
        n_good += reached
        if reached < size:
            return FilterOutcome(covariance, n_good, PREDICTION)
    if not best.converged:
        return FilterOutcome(covariance, n_good, NOT_CONVERGED)
    nominal = uncertainty.deviation(np.eye(problem.n_parameters, best.state.size))
    n_channels = problem.sensors.variance.size
    corrected = corrected_deviation(nominal, influence_functions(problem, best.state, uncertainty), n_channels)
    return FilterOutcome(covariance, n_good, OK, corrected=corrected)


def influence_functions(problem: JointProblem, state: Array, uncertainty: Uncertainty) -> list[Iterable[ResidualRows]]:
    """Return the influence functions of each segment on parameters fitted with a joint state."""
    segments = [_SegmentInfluences(problem, uncertainty, state, segment) for segment in range(len(problem.segments))]
    # The number of chunks is not known before they are read.
    return cached(segments, [1] * len(segments))


@dataclass(frozen=True)
class _SegmentInfluences:
    """Influences of the residuals of a segment, computed again in each iteration."""

    problem: JointProblem
    uncertainty: Uncertainty
    state: Array
    segment: int

    def __iter__(self) -> Iterator[ResidualRows]:
        process, sensors, segments, _ = self.problem
        indices, root = self.problem.indices[self.segment], self.uncertainty.root
        covariance = root[indices] @ root[: self.problem.n_parameters].T
        for response in responses(process, sensors, segments[self.segment], self.state[indices]):
            rows, residual = response.whitened[..., :-1] @ covariance, response.whitened[..., -1]
            yield ResidualRows.of_present(response.timeline, ~np.isnan(response.innovation), residual, rows)


def _ckf(problem: JointProblem) -> _Start | None:
    """Return a start with the parameters of a CKF and the prior's motions; None if the CKF fails."""
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
    """First events of chunks in time order; iterable any number of times."""

    def __init__(self, timelines: Iterable[Timeline], n_events: int) -> None:
        self._timelines, self._n_events = timelines, n_events

    def __iter__(self) -> Iterator[Timeline]:
        remaining = self._n_events
        for timeline in self._timelines:
            yield timeline if timeline.time.size <= remaining else _cut(timeline, remaining)
            remaining -= timeline.time.size
            if remaining <= 0:
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
