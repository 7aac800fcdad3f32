"""Several segments of data that share their parameters, while the motion begins anew in each.

Their joint state is the parameters, then the moving states at the beginning of each segment. Of one segment it is the
state that a filter knows.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.problem import (
    OK,
    PREDICTION,
    FilterOutcome,
    Gaussian,
    Indices,
    OnChunk,
    Process,
    Records,
    Sensors,
    Timeline,
)

Array = NDArray[np.float64]

# Filters a segment from a Gaussian about its own state.
FilterPass = Callable[[Iterable[Timeline], Gaussian, OnChunk], FilterOutcome]


class JointProblem(NamedTuple):
    """What an estimator of all segments is given.

    Attributes
    ----------
    process, sensors
        See `auvid_cli.filters.problem`.
    segments : sequence of iterable of Timeline
        In time order; each may be gone through many times.
    prior : Gaussian
        About the joint state.
    """

    process: Process
    sensors: Sensors
    segments: Sequence[Iterable[Timeline]]
    prior: Gaussian

    @property
    def n_moving(self) -> int:
        """Return the number of moving states, which each segment has of its own."""
        return self.process.noise_density.size

    @property
    def n_parameters(self) -> int:
        """Return the number of parameters, which all segments share."""
        return self.prior.mean.size - len(self.segments) * self.n_moving

    @property
    def indices(self) -> list[Indices]:
        """Return where in the joint state the state of each segment stands."""
        return segment_indices(self.prior.mean.size, self.n_moving, len(self.segments))

    @property
    def priors(self) -> list[Gaussian]:
        """Return what the prior says of the state of each segment."""
        return [segment_gaussian(self.prior, place) for place in self.indices]

    def by_segment(self) -> "list[JointProblem]":
        """Return the problem that each segment is by itself."""
        return [
            self._replace(segments=[timelines], prior=prior)
            for timelines, prior in zip(self.segments, self.priors, strict=True)
        ]


def segment_indices(n_joint: int, n_moving: int, n_segments: int) -> list[Indices]:
    """Find where in a joint state the state of each segment stands."""
    n_parameters = n_joint - n_segments * n_moving
    motions = np.arange(n_parameters, n_joint).reshape(n_segments, n_moving)
    return [np.concatenate([np.arange(n_parameters), moving]) for moving in motions]


def joint_gaussian(gaussians: Sequence[Gaussian], n_moving: int) -> Gaussian:
    """Join segments of which the same is known of the parameters, and whose motions share nothing else."""
    n = gaussians[0].mean.size + (len(gaussians) - 1) * n_moving
    joint = Gaussian(np.zeros(n), np.zeros((n, n)))
    for gaussian, place in zip(gaussians, segment_indices(n, n_moving, len(gaussians)), strict=True):
        joint.mean[place] = gaussian.mean
        joint.factor[np.ix_(place, place)] = gaussian.factor
    return joint


def segment_gaussian(joint: Gaussian, place: Indices) -> Gaussian:
    """Return what a joint Gaussian says of the state of a segment."""
    return Gaussian(joint.mean[place], joint.factor[np.ix_(place, place)])


def filter_sequentially(run: FilterPass, problem: JointProblem, on_chunk: OnChunk) -> FilterOutcome:
    """Filter segments in their order; each begins with what the one before says of the parameters.

    Parameters
    ----------
    run : callable
    problem : JointProblem
    on_chunk : callable
        Told every chunk of every segment.

    Returns
    -------
    FilterOutcome
        That of the last segment, or of the one at which a filter failed.
    """
    final, n_good = problem.prior.mean, 0
    outcome = FilterOutcome(np.zeros((0, 0)), 0, OK)

    def keep_and_pass_on(timeline: Timeline, records: Records) -> None:
        nonlocal final
        if len(records.mean):
            final = records.mean[-1]
        on_chunk(timeline, records)

    for k, alone in enumerate(problem.by_segment()):
        gaussian = alone.prior
        if k:
            try:
                gaussian = with_parameters(gaussian, _marginal(final, outcome.covariance, problem.n_parameters))
            except np.linalg.LinAlgError:
                return outcome._replace(n_good=n_good, failure=PREDICTION)
        outcome = run(alone.segments[0], gaussian, keep_and_pass_on)
        n_good += outcome.n_good
        if outcome.failure != OK:
            break
    return outcome._replace(n_good=n_good)


def _marginal(mean: Array, covariance: Array, n: int) -> Gaussian:
    """Return what is known of the first n components of a state."""
    scale = np.sqrt(np.diagonal(covariance)[:n])
    correlation = covariance[:n, :n] / np.outer(scale, scale)
    return Gaussian(mean[:n].copy(), np.asarray(scale[:, None] * np.linalg.cholesky(correlation), dtype=np.float64))


def with_parameters(gaussian: Gaussian, parameters: Gaussian) -> Gaussian:
    """Keep the motion, given the parameters, and put another Gaussian about these."""
    n = parameters.mean.size
    by_parameters = np.linalg.solve(gaussian.factor[:n, :n].T, gaussian.factor[n:, :n].T).T
    mean, factor = gaussian.mean.copy(), gaussian.factor.copy()
    mean[:n] = parameters.mean
    mean[n:] += by_parameters @ (parameters.mean - gaussian.mean[:n])
    factor[:n, :n] = parameters.factor
    factor[n:, :n] = by_parameters @ parameters.factor
    return Gaussian(mean, factor)
