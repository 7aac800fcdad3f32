"""How each measurement moves what a batch estimator finds, for `auvid_cli.filters.autocorrelation`.

Of the output-error method the influence of a measurement on the parameters is the joint covariance times the whitened
derivative of what is predicted. Of the smoother what is left of the motion is estimated as well as a filter can that
knows the parameters: an innovation depends on these through

    s = h_theta + h_x d,    d <- d - g s / S,    d <- F_x d + F_theta

with motion d that errs with the parameters, and its influence is the parameters' covariance times ``s / sqrt(S)``.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.autocorrelation import corrected_deviation
from auvid_cli.filters.conditional_filter import ConditionalFilter
from auvid_cli.filters.fault_scores import carry_errors
from auvid_cli.filters.hac_windows import Influence
from auvid_cli.filters.information import Uncertainty
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing
from auvid_cli.filters.problem import Timeline
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.sensitivities import responses

Array = NDArray[np.float64]


def corrected_free_motion(problem: JointProblem, state: Array, uncertainty: Uncertainty) -> Array:
    """Correct the standard deviations of parameters that were found with motions left to themselves.

    Parameters
    ----------
    problem : JointProblem
    state : ndarray, shape (n,)
        The joint state that was found.
    uncertainty : Uncertainty
        Of it.
    """
    nominal = uncertainty.deviation(np.eye(problem.n_parameters, state.size))
    return corrected_deviation(nominal, of_free_motion(problem, state, uncertainty), problem.sensors.variance.size)


def corrected_smoothing(problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered) -> Array:
    """Correct the standard deviations of parameters about the most probable trajectory."""
    nominal = np.sqrt(np.diagonal(filtered.final.covariance())[: problem.n_parameters])
    return corrected_deviation(nominal, of_smoothing(problem, smoothing, filtered), problem.sensors.variance.size)


def of_free_motion(problem: JointProblem, state: Array, uncertainty: Uncertainty) -> list[Iterable[Influence]]:
    """Return the influences of each segment on parameters found with motions left to themselves."""
    return [_FreeMotion(problem, uncertainty, state, segment) for segment in range(len(problem.segments))]


def of_smoothing(problem: JointProblem, smoothing: LinearSmoothing, filtered: Filtered) -> list[Iterable[Influence]]:
    """Return the influences of each segment on parameters about the most probable trajectory."""
    return [_Innovations(problem, smoothing, filtered, segment) for segment in range(len(problem.segments))]


def _influence(timeline: Timeline, present: NDArray[np.bool_], residual: Array, rows: Array) -> Influence:
    """Leave out components that are missing."""
    n_measurements, n_components = present.shape
    time = np.repeat(timeline.time, np.diff(timeline.measurement_offset))[:n_measurements]
    channel = timeline.measurement_sensor[:n_measurements, None].astype(np.int64) * n_components
    return Influence(
        np.repeat(time, n_components)[present.ravel()],
        (channel + np.arange(n_components))[present],
        residual[present],
        rows[present],
    )


@dataclass(frozen=True)
class _FreeMotion:
    """Influences of a segment on what the output-error method finds."""

    problem: JointProblem
    uncertainty: Uncertainty
    state: Array
    segment: int

    def __iter__(self) -> Iterator[Influence]:
        process, sensors, segments, _ = self.problem
        place, root = self.problem.places[self.segment], self.uncertainty.root
        covariance = root[place] @ root[: self.problem.n_parameters].T
        for response in responses(process, sensors, segments[self.segment], self.state[place]):
            rows, residual = response.whitened[..., :-1] @ covariance, response.whitened[..., -1]
            yield _influence(response.timeline, ~np.isnan(response.innovation), residual, rows)


@dataclass(frozen=True)
class _Innovations:
    """Influences of a segment on what the smoother finds."""

    problem: JointProblem
    smoothing: LinearSmoothing
    filtered: Filtered
    segment: int

    def __iter__(self) -> Iterator[Influence]:
        n, n_moving = self.problem.n_parameters, self.problem.n_moving
        covariance = self.filtered.final.covariance()[:n, :n]
        error, moved = self.filtered.by_parameters[self.segment].copy(), np.empty((n_moving, n))
        chunks = ConditionalFilter(self.problem, self.smoothing, self.filtered, self.segment).forward()
        for timeline, _, motion, by_parameters, _, forward_pass in chunks:
            carry_errors(timeline, motion, forward_pass, by_parameters, error, moved)
            deviation = np.sqrt(forward_pass.total)
            rows = (by_parameters.added / deviation[..., None]) @ covariance
            yield _influence(timeline, ~np.isnan(motion.residual), forward_pass.error / deviation, rows)
