"""Input and output of all estimators: process, sensors, data, prior, records and outcome.

A state has constant parameters first, then the moving states that the process advances. A measurement is linear in
the state or a compiled function of it; the noise of its components is independent. Segments of the data share the
parameters, and each starts with its own motion: the joint state is the parameters, then the initial moving states of
each segment.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Reversible, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.numerics import compiled, types

Indices = NDArray[np.int64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]

# Explicit signatures, so that numba finds compiled filters in its cache in the next session.
# advance(moving, parameters, inputs, constants, selection, n_lanes, duration, scratch): a block of states, in place.
PROCESS_SIGNATURE = types.void(_vector, _vector, _vector, _vector, _indices, types.int64, types.float64, _vector)
# transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch): one state, in place.
TRANSITION_SIGNATURE = types.void(_vector, _matrix, _indices, _vector, _vector, _indices, _matrix, _vector)
# observe(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch) fills `predicted`.
OBSERVATION_SIGNATURE = types.void(
    *(_vector, _vector, types.int64, _vector, _vector, _indices, types.int64, _vector, _vector)
)
# linearise(mean, sensor, inputs, constants, selection, predicted, matrix, scratch): one state; fills rows of both.
LINEARISATION_SIGNATURE = types.void(*(_vector, types.int64, _vector, _vector, _indices, _vector, _matrix, _vector))


@compiled(OBSERVATION_SIGNATURE)
def no_observation(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch):
    """Stand in where all sensors are linear; never called."""


@compiled(LINEARISATION_SIGNATURE)
def no_linearisation(mean, sensor, inputs, constants, selection, predicted, matrix, scratch):
    """Stand in where all sensors are linear; never called."""


class Process(NamedTuple):
    """Motion of the moving states, and measurement functions of nonlinear sensors."""

    advance: Any  # moves a block of states by one integration step
    # Moves one state over consecutive substeps, and fills in the moving rows of its transition matrix, shape (n, n)
    transition: Any
    constants: Array  # arguments of these functions
    selection: Indices  # arguments of these functions
    noise_density: Array  # shape (n_moving,); square root of the power spectral density that drives each moving state
    scratch_size: int = 0  # number of doubles in the scratch array of these functions
    # Predicts the measurement of a nonlinear sensor for a block of states, with the inputs after the event
    observe: Any = no_observation
    linearise: Any = no_linearisation  # predicts it for one state, shape (c,), with its derivative, shape (c, n)
    # Shape (n_moving,) or (0,); 1/s; rate at which each moving state forgets process noise, see
    # `auvid_cli.filters.process_noise`. Empty if unknown; used by smoothers only.
    decay: Array = np.zeros(0)
    # Shape (n_moving, n_moving) or (0, 0); derivative of the rate of each moving state by each noisy state that drives
    # it; such a state is itself not driven. Empty if none is; used by smoothers only.
    driven: Array = np.zeros((0, 0))


class Sensors(NamedTuple):
    """Measurement models."""

    # Shape (n_sensors, c, n); measurement matrix of each linear sensor; zero rows if it has fewer than c components
    matrix: Array
    variance: Array  # shape (n_sensors, c); variance of the noise, positive
    angular: NDArray[np.bool_]  # shape (n_sensors, c); whether an innovation is wrapped to [-pi, pi)
    # Shape (n_sensors,); whether `Process.observe` predicts the measurement instead of the matrix
    nonlinear: NDArray[np.bool_]
    gate: float = np.inf  # largest squared innovation of an accepted component, in variances of the innovation
    # Residual beyond which a batch fit reduces the weight of a component, in standard deviations of the noise, see
    # `auvid_cli.filters.smoother_forward`
    threshold: float = np.inf


SENSORS_TYPE = types.NamedTuple(
    (types.float64[:, :, ::1], _matrix, types.boolean[:, ::1], types.boolean[::1], *[types.float64] * 2), Sensors
)


class ModelData(NamedTuple):
    """Process and sensors without compiled functions, which numba does not accept in a tuple."""

    constants: Array
    selection: Indices
    noise_density: Array
    sensors: Sensors

    @classmethod
    def of(cls, process: Process, sensors: Sensors) -> "ModelData":
        """Return the data of a process and its sensors."""
        return cls(process.constants, process.selection, process.noise_density, sensors)


MODEL_DATA = types.NamedTuple((_vector, _indices, _vector, SENSORS_TYPE), ModelData)


class Timeline(NamedTuple):
    """Consecutive events in time order: all data of a segment, or a chunk of them."""

    time: Array  # shape (n_events,); s, strictly increasing
    # Shape (n_events + 1,); substeps ``substep_offset[k] : substep_offset[k + 1]`` lead from the previous event to
    # event k. The event before a chunk is the last one of the previous chunk; before a whole segment there is none.
    substep_offset: Indices
    substep_duration: Array  # shape (n_substeps,); s; at most the integration step, with constant input
    substep_input: Indices  # shape (n_substeps,); row of `inputs` during a substep
    inputs: Array  # shape (n, n_inputs)
    event_input: Indices  # shape (n_events,); row of `inputs` after an event
    # Shape (n_events + 1,); measurements ``measurement_offset[k] : measurement_offset[k + 1]`` were taken at event k
    measurement_offset: Indices
    measurement_sensor: NDArray[np.int8]  # shape (n_measurements,); row in `Sensors`
    measurement: Array  # shape (n_measurements, c); NaN for a missing component

    @property
    def has_initial_substep(self) -> bool:
        """Whether substeps lead to the first event of a segment."""
        return bool(self.substep_offset[1] > self.substep_offset[0])


TIMELINE = types.NamedTuple(
    (_vector, _indices, _vector, _indices, _matrix, _indices, _indices, types.int8[::1], _matrix), Timeline
)


class Gaussian(NamedTuple):
    """Normal distribution of a state."""

    mean: Array  # shape (n,)
    factor: Array  # shape (n, n); lower triangular; ``factor @ factor.T`` is the covariance

    def with_parameters(self, parameters: "Gaussian") -> "Gaussian":
        """Replace the marginal distribution of the parameters, and keep that of the motion given the parameters."""
        n = parameters.mean.size
        by_parameters = self.by_parameters(n)
        mean, factor = self.mean.copy(), self.factor.copy()
        mean[:n] = parameters.mean
        mean[n:] += by_parameters @ (parameters.mean - self.mean[:n])
        factor[:n, :n] = parameters.factor
        factor[n:, :n] = by_parameters @ parameters.factor
        return Gaussian(mean, factor)

    def given(self, parameters: Array) -> "Gaussian":
        """Return the distribution of the motion given the parameters, shape (n_parameters,)."""
        n = parameters.size
        mean = self.mean[n:] + self.by_parameters(n) @ (parameters - self.mean[:n])
        return Gaussian(mean, self.factor[n:, n:])

    def by_parameters(self, n: int) -> Array:
        """Return the derivative of the mean of the motion by n given parameters, shape (n_motion, n)."""
        return np.asarray(np.linalg.solve(self.factor[:n, :n].T, self.factor[n:, :n].T).T, dtype=np.float64)


class Records(NamedTuple):
    """States after consecutive events, and innovations of their measurements."""

    mean: Array  # shape (events, n)
    standard_deviation: Array  # shape (events, n)
    innovation: Array  # shape (measurements, c); NaN if missing
    # Shape (measurements, c); NaN if missing, rejected, or with a weight below one half
    innovation_variance: Array
    nis: Array  # shape (measurements,); normalised innovation squared; its expectation is the number of components
    # Shape (measurements, c), or None; weight of each component in a robust fit; 1 if missing
    weight: Array | None = None

    def truncate(self, n_events: int, n_measurements: int) -> "Records":
        """Keep the first rows."""
        of_measurements = (None if a is None else a[:n_measurements] for a in self[2:])
        return Records(*(a[:n_events] for a in self[:2]), *of_measurements)


RECORDS = types.NamedTuple((*[_matrix] * 4, _vector, types.none), Records)


def empty_records(timeline: Timeline, n: int) -> Records:
    """Return records of NaN for a state of n components."""
    n_measurements, n_components = timeline.measurement.shape
    rows = (timeline.time.size, n), (timeline.time.size, n), *[(n_measurements, n_components)] * 2, n_measurements
    return Records(*(np.full(shape, np.nan) for shape in rows))


# Receives each chunk of the data, and the records of its good events.
OnChunk = Callable[[Timeline, Records], None]

# Reason for the end of a run: one of these, or a sensor's row in `Sensors`.
OK = -1
PREDICTION = -2
NOT_CONVERGED = -3
# An iteration without further progress has converged if the cost can fall by at most this, in squares of standard
# deviations, and no parameter would move by more than this share of its standard deviation.
NEGLIGIBLE_DECREASE = 0.1
_NEGLIGIBLE_STEP = 0.05


class FaultScores(NamedTuple):
    """Score tests of faults of the model or the data; see `auvid_cli.filters.fault_scores`."""

    labels: tuple[Any, ...]  # identity of each fault, chosen by the caller
    score: Array  # shape (n_faults,)
    # Shape (n_faults, n_faults); the estimate of one fault alone is ``score / information``, by the diagonal, with
    # variance ``1 / information``; the joint estimate of all faults is ``information^-1 score``
    information: Array
    # Shape (n_parameters, n_faults); error of the parameters, true less estimated, per unit of each fault
    effect: Array
    # Shape (n_faults,) or (0,); factor of the standard deviation of each size by autocorrelated residuals, see
    # `auvid_cli.filters.autocorrelation`; empty if it was not computed
    inflation: Array = np.zeros(0)

    def conditional_on(self, found: Mapping[Any, float]) -> "FaultScores":
        """Return the scores of the other faults where some are estimated together with the parameters.

        Parameters
        ----------
        found : mapping of float
            Label and prior standard deviation of each estimated fault.
        """
        estimated = np.array([label in found for label in self.labels])
        if not estimated.any():
            return self
        prior = np.diag([found[label] ** -2 for label in self.labels if label in found])
        own = self.information[np.ix_(estimated, estimated)] + prior
        taken = np.linalg.solve(own, self.information[np.ix_(estimated, ~estimated)])
        return FaultScores(
            tuple(label for label in self.labels if label not in found),
            self.score[~estimated],
            self.information[np.ix_(~estimated, ~estimated)] - self.information[np.ix_(~estimated, estimated)] @ taken,
            self.effect[:, ~estimated] - self.effect[:, estimated] @ taken,
            self.inflation[~estimated] if self.inflation.size else self.inflation,
        )


class AlternativeEstimate(NamedTuple):
    """Parameters of another minimum, or of one segment; see `auvid_cli.filters.smoother`."""

    difference: Array  # shape (n_parameters,); difference from the estimate
    # Shape (n_parameters,); standard deviation of the difference; infinite if the two are not comparable
    deviation: Array
    moved: Array  # shape (n_parameters,); change of the estimate by a difference of one standard deviation
    cost_increase: float = 0.0  # cost of another minimum less that of the estimate
    begin: float | None = None  # first time of the segment, s; None for another minimum

    @classmethod
    def of_minimum(cls, difference: Array, deviation: Array, cost_increase: float) -> "AlternativeEstimate | None":
        """Return another minimum; None if it is within one standard deviation of the estimate."""
        if (np.abs(difference) <= deviation).all():
            return None
        return cls(difference, deviation, deviation, cost_increase)


class ConvergenceStatus(NamedTuple):
    """Distance from convergence, by the linear problem about the last iterate."""

    cost_decrease: float  # predicted decrease of the cost, in squares of standard deviations
    step: Array  # shape (n_parameters,); next step of the parameters, in standard deviations
    fraction: float = 1.0  # fraction of the data that was fitted
    is_negligible: bool = False  # whether the rest of the way no longer matters, so that the estimate is an answer

    @property
    def is_close(self) -> bool:
        """Whether neither the cost nor a parameter would change by an amount that matters."""
        return self.cost_decrease <= NEGLIGIBLE_DECREASE and bool((np.abs(self.step) <= _NEGLIGIBLE_STEP).all())


class FilterOutcome(NamedTuple):
    """Result of an estimator."""

    covariance: Array  # shape (n, n); covariance after the last good event
    n_good: int  # number of good events
    # `OK`; `PREDICTION`, or the row of the sensor, where the run failed after event ``n_good - 1``; `NOT_CONVERGED` if
    # an iteration ended before it converged
    failure: int
    faults: FaultScores | None = None
    others: tuple[AlternativeEstimate, ...] = ()
    # Status of an iteration that did not converge, or that ended where the rest of the way no longer matters
    convergence: ConvergenceStatus | None = None
    # Shape (n_parameters,) or (0,); standard deviations of a batch estimate that allow for autocorrelated residuals,
    # see `auvid_cli.filters.autocorrelation`
    corrected: Array = np.zeros(0)
    # Yields data and innovations less the effects of `faults`, whose sizes are its argument, shape (n_faults,)
    without_faults: "Callable[[Array], Iterator[tuple[Timeline, Records]]] | None" = None


class JointProblem(NamedTuple):
    """Estimation problem of all segments."""

    process: Process
    sensors: Sensors
    segments: Sequence[Reversible[Timeline]]  # in time order; each is read many times, in both directions
    prior: Gaussian  # prior of the joint state

    @property
    def n_moving(self) -> int:
        """Number of moving states."""
        return self.process.noise_density.size

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""
        return self.prior.mean.size - len(self.segments) * self.n_moving

    @property
    def indices(self) -> list[Indices]:
        """Indices of each segment's state in the joint state."""
        return segment_indices(self.prior.mean.size, self.n_moving, len(self.segments))

    @property
    def priors(self) -> list[Gaussian]:
        """Prior of each segment's state."""
        return [segment_gaussian(self.prior, indices) for indices in self.indices]

    def by_segment(self) -> "list[JointProblem]":
        """Return a separate problem for each segment."""
        return [
            self._replace(segments=[timelines], prior=prior)
            for timelines, prior in zip(self.segments, self.priors, strict=True)
        ]


def segment_indices(n_joint: int, n_moving: int, n_segments: int) -> list[Indices]:
    """Return the indices of each segment's state in a joint state of `n_joint` components."""
    n_parameters = n_joint - n_segments * n_moving
    motions = np.arange(n_parameters, n_joint).reshape(n_segments, n_moving)
    return [np.concatenate([np.arange(n_parameters), moving]) for moving in motions]


def joint_gaussian(gaussians: Sequence[Gaussian], n_moving: int) -> Gaussian:
    """Return the joint distribution of segments with the same parameters and independent motions."""
    n = gaussians[0].mean.size + (len(gaussians) - 1) * n_moving
    joint = Gaussian(np.zeros(n), np.zeros((n, n)))
    for gaussian, indices in zip(gaussians, segment_indices(n, n_moving, len(gaussians)), strict=True):
        joint.mean[indices] = gaussian.mean
        joint.factor[np.ix_(indices, indices)] = gaussian.factor
    return joint


def segment_gaussian(joint: Gaussian, indices: Indices) -> Gaussian:
    """Return the distribution of one segment's state."""
    return Gaussian(joint.mean[indices], joint.factor[np.ix_(indices, indices)])


def filter_sequentially(
    run: Callable[[Iterable[Timeline], Gaussian, OnChunk], FilterOutcome], problem: JointProblem, on_chunk: OnChunk
) -> FilterOutcome:
    """Filter one segment after another; each starts from the parameters at the end of the previous one.

    Parameters
    ----------
    run : callable
        Filters one segment from a prior of its own state.
    problem : JointProblem
    on_chunk : callable
        Receives each chunk of each segment.

    Returns
    -------
    FilterOutcome
        Outcome of the last segment, or of the one that failed; with the good events of all segments.
    """
    final, n_good = problem.prior.mean, 0
    outcome = FilterOutcome(np.zeros((0, 0)), 0, OK)

    def keep_last(timeline: Timeline, records: Records) -> None:
        nonlocal final
        if len(records.mean):
            final = records.mean[-1]
        on_chunk(timeline, records)

    for k, segment in enumerate(problem.by_segment()):
        gaussian = segment.prior
        if k:
            try:
                gaussian = gaussian.with_parameters(_marginal(final, outcome.covariance, problem.n_parameters))
            except np.linalg.LinAlgError:
                return outcome._replace(n_good=n_good, failure=PREDICTION)
        outcome = run(segment.segments[0], gaussian, keep_last)
        n_good += outcome.n_good
        if outcome.failure != OK:
            break
    return outcome._replace(n_good=n_good)


def _marginal(mean: Array, covariance: Array, n: int) -> Gaussian:
    """Return the marginal distribution of the first n components."""
    scale = np.sqrt(np.diagonal(covariance)[:n])
    correlation = covariance[:n, :n] / np.outer(scale, scale)
    return Gaussian(mean[:n].copy(), np.asarray(scale[:, None] * np.linalg.cholesky(correlation), dtype=np.float64))
