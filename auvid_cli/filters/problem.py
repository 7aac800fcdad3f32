"""What a filter is given and what it gives back: plain value types.

The state is split in two blocks: constant parameters first, then the moving states that the process
advances. Measurements are linear in the state, or what a compiled function makes of it; their noise is independent.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]

# advance(moving, parameters, inputs, constants, selection, n_lanes, duration, scratch), in place on blocks.
# A compiled process has exactly this signature, explicit so that numba finds the filters in its
# cache again in another interpreter session.
PROCESS_SIGNATURE = types.void(_vector, _vector, _vector, _vector, _indices, types.uint64, types.float64, _vector)
# transition(mean, inputs, substep_input, substep_duration, constants, selection, matrix, scratch): one state, in place.
TRANSITION_SIGNATURE = types.void(_vector, _matrix, _indices, _vector, _vector, _indices, _matrix, _vector)
# observe(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch) fills `predicted`.
OBSERVATION_SIGNATURE = types.void(
    *(_vector, _vector, types.int64, _vector, _vector, _indices, types.uint64, _vector, _vector)
)
# linearise(mean, sensor, inputs, constants, selection, predicted, matrix, scratch): one state; fills rows of both.
LINEARISATION_SIGNATURE = types.void(*(_vector, types.int64, _vector, _vector, _indices, _vector, _matrix, _vector))


@compiled(OBSERVATION_SIGNATURE, pointer=True)
def no_observation(moving, parameters, sensor, inputs, constants, selection, n_lanes, predicted, scratch):
    """Stand in for the observation of a problem without nonlinear sensors; never called."""


@compiled(LINEARISATION_SIGNATURE, pointer=True)
def no_linearisation(mean, sensor, inputs, constants, selection, predicted, matrix, scratch):
    """Stand in for the derivative of that observation; never called."""


class Process(NamedTuple):
    """How the moving states advance, and what nonlinear sensors measure of the state.

    Attributes
    ----------
    advance : compiled function of `PROCESS_SIGNATURE`
        Moves up to one block of states on by one integration step.
    transition : compiled function of `TRANSITION_SIGNATURE`
        Moves one state over consecutive substeps, and fills in the moving rows of its transition matrix, shape (n, n).
    constants, selection : ndarray
        Handed to these functions as they are.
    scratch_size : int
        How many doubles these functions want to work with.
    noise_density : ndarray, shape (n_moving,)
        Square root of the power spectral density that drives each moving state.
    observe : compiled function of `OBSERVATION_SIGNATURE`
        What a nonlinear sensor measures of a block of states, under the inputs that hold from then on.
    linearise : compiled function of `LINEARISATION_SIGNATURE`
        What it measures of one state, shape (c,), and the derivative of that, shape (c, n).
    decay : ndarray, shape (n_moving,) or (0,)
        1/s; rate at which each moving state forgets what drives it, see `auvid_cli.filters.linear_smoother`. Smoothers
        use it where it is known.
    """

    advance: Any
    transition: Any
    constants: Array
    selection: Indices
    noise_density: Array
    scratch_size: int = 0
    observe: Any = no_observation
    linearise: Any = no_linearisation
    decay: Array = np.zeros(0)


class Sensors(NamedTuple):
    """Measurements, component by component.

    Attributes
    ----------
    matrix : ndarray, shape (n_sensors, c, n)
        Measurement matrix of each linear sensor, zero rows where it has fewer than c components.
    variance : ndarray, shape (n_sensors, c)
        Of the noise; positive.
    angular : ndarray of bool, shape (n_sensors, c)
        Whether an innovation is wrapped to [-pi, pi).
    nonlinear : ndarray of bool, shape (n_sensors,)
        Whether `Process.observe` says what a sensor measures, instead of its matrix.
    gate : float
        A component whose innovation squared is more than so many times its variance is rejected.
    threshold : float
        A fit of all data weighs a component down whose residual is more of its standard deviations, see
        `auvid_cli.filters.smoother_forward`.
    """

    matrix: Array
    variance: Array
    angular: NDArray[np.bool_]
    nonlinear: NDArray[np.bool_]
    gate: float = np.inf
    threshold: float = np.inf


SENSORS_TYPE = types.NamedTuple(
    (types.float64[:, :, ::1], _matrix, types.boolean[:, ::1], types.boolean[::1], *[types.float64] * 2), Sensors
)


class ModelData(NamedTuple):
    """Process and sensors without the functions, which compiled code is handed apart: numba takes none in a tuple.

    Attributes
    ----------
    constants, selection, noise_density
        As in `Process`.
    sensors : Sensors
    """

    constants: Array
    selection: Indices
    noise_density: Array
    sensors: Sensors

    @classmethod
    def of(cls, process: Process, sensors: Sensors) -> "ModelData":
        """Take them from a process."""
        return cls(process.constants, process.selection, process.noise_density, sensors)


MODEL_DATA = types.NamedTuple((_vector, _indices, _vector, SENSORS_TYPE), ModelData)


class Timeline(NamedTuple):
    """Consecutive events in time order: all of a dataset, or a chunk of them that follows another.

    Attributes
    ----------
    time : ndarray, shape (n_events,)
        s, strictly increasing.
    substep_offset : ndarray of int, shape (n_events + 1,)
        Substeps ``substep_offset[k] : substep_offset[k + 1]`` lead to event k from the event before, which of
        the first is the last of the chunk before; nothing leads to the first event of all.
    substep_duration : ndarray, shape (n_substeps,)
        s; no longer than the integration step, and the input is constant within each.
    substep_input : ndarray of int, shape (n_substeps,)
        Row of `inputs` that holds during a substep.
    inputs : ndarray, shape (n, n_inputs)
    event_input : ndarray of int, shape (n_events,)
        Row of `inputs` that holds from an event on.
    measurement_offset : ndarray of int, shape (n_events + 1,)
        Measurements ``measurement_offset[k] : measurement_offset[k + 1]`` were taken at event k.
    measurement_sensor : ndarray of int8, shape (n_measurements,)
        Row in `Sensors`.
    measurement : ndarray, shape (n_measurements, c)
        NaN where a component is missing.
    """

    time: Array
    substep_offset: Indices
    substep_duration: Array
    substep_input: Indices
    inputs: Array
    event_input: Indices
    measurement_offset: Indices
    measurement_sensor: NDArray[np.int8]
    measurement: Array


TIMELINE = types.NamedTuple(
    (_vector, _indices, _vector, _indices, _matrix, _indices, _indices, types.int8[::1], _matrix), Timeline
)


class Gaussian(NamedTuple):
    """Gaussian over the state: mean, and a square root of the covariance.

    Attributes
    ----------
    mean : ndarray, shape (n,)
        Parameters first.
    factor : ndarray, shape (n, n)
        Lower triangular, ``factor @ factor.T`` is the covariance.
    """

    mean: Array
    factor: Array


class Records(NamedTuple):
    """What a filter writes down of consecutive events and of their measurements.

    Attributes
    ----------
    mean, standard_deviation : ndarray, shape (events, n)
        After each event.
    innovation, innovation_variance : ndarray, shape (measurements, c)
        NaN where missing; of a component that was rejected, or counted less than half, only the variance is NaN.
    nis : ndarray, shape (measurements,)
        Normalised innovation squared; its expectation is the number of components present.
    weight : ndarray, shape (measurements, c), or None
        By how much each counts in a fit that weighs them; 1 where missing.
    """

    mean: Array
    standard_deviation: Array
    innovation: Array
    innovation_variance: Array
    nis: Array
    weight: Array | None = None


RECORDS = types.NamedTuple((*[_matrix] * 4, _vector, types.none), Records)


def empty_records(timeline: Timeline, n: int) -> Records:
    """Make the records of a timeline for a state of n components, to be filled in."""
    n_measurements, n_components = timeline.measurement.shape
    rows = (timeline.time.size, n), (timeline.time.size, n), *[(n_measurements, n_components)] * 2, n_measurements
    return Records(*(np.full(shape, np.nan) for shape in rows))


def truncate(records: Records, n_events: int, n_measurements: int) -> Records:
    """Keep the first rows of records."""
    of_measurements = (None if a is None else a[:n_measurements] for a in records[2:])
    return Records(*(a[:n_events] for a in records[:2]), *of_measurements)


# Told every chunk of the timeline, and the records of those of its events that went well.
OnChunk = Callable[[Timeline, Records], None]

# What ended a run: a sensor's row in `Sensors`, or one of these.
OK, PREDICTION, NOT_CONVERGED = -1, -2, -3


class FaultScores(NamedTuple):
    """What the data say of faults of the model or of themselves, each by itself; see `auvid_cli.filters.fault_scores`.

    Attributes
    ----------
    labels : tuple
        Identity of each fault, as the caller chose it.
    score : ndarray, shape (n_faults,)
    information : ndarray, shape (n_faults, n_faults)
        The data say that a fault by itself is as large as ``score / information``, by the diagonal, with variance
        ``1 / information``; and all together as large as ``information^-1 score``.
    effect : ndarray, shape (n_parameters, n_faults)
        True parameters less those found, per unit of each.
    """

    labels: tuple[Any, ...]
    score: Array
    information: Array
    effect: Array

    def conditional_on(self, found: Mapping[Any, float]) -> "FaultScores":
        """Return the scores of the other faults where some are estimated, which take up what they can explain.

        Parameters
        ----------
        found : mapping of float
            By label, the prior standard deviation of each estimated fault.
        """
        along = np.array([label in found for label in self.labels])
        if not along.any():
            return self
        known = np.diag([found[label] ** -2 for label in self.labels if label in found])
        taken = np.linalg.solve(self.information[np.ix_(along, along)] + known, self.information[np.ix_(along, ~along)])
        return FaultScores(
            tuple(label for label in self.labels if label not in found),
            self.score[~along],
            self.information[np.ix_(~along, ~along)] - self.information[np.ix_(~along, along)] @ taken,
            self.effect[:, ~along] - self.effect[:, along] @ taken,
        )


class AlternativeEstimate(NamedTuple):
    """Parameters of another minimum, or of one segment; see `auvid_cli.filters.smoother`.

    Attributes
    ----------
    difference : ndarray, shape (n_parameters,)
        From the estimate.
    deviation : ndarray, shape (n_parameters,)
        Standard deviation of the difference; infinite where the two cannot be compared.
    moved : ndarray, shape (n_parameters,)
        Change of the estimate by such a difference.
    cost_increase : float
        Cost of another minimum less that of the estimate.
    begin : float or None
        First time of the segment, s; None for another minimum.
    """

    difference: Array
    deviation: Array
    moved: Array
    cost_increase: float = 0.0
    begin: float | None = None

    @classmethod
    def of_minimum(cls, difference: Array, deviation: Array, cost_increase: float) -> "AlternativeEstimate | None":
        """Return another minimum; None if it is the same."""
        if (np.abs(difference) <= deviation).all():
            return None
        return cls(difference, deviation, deviation, cost_increase)


class ConvergenceStatus(NamedTuple):
    """Distance from convergence, by the linear problem about the last iterate.

    Attributes
    ----------
    cost_decrease : float
        Predicted decrease of the cost, in squares of standard deviations.
    step : ndarray, shape (n_parameters,)
        Next step of the parameters, in standard deviations.
    fraction : float
        Fraction of the data that was fitted at all.
    """

    cost_decrease: float
    step: Array
    fraction: float = 1.0


class FilterOutcome(NamedTuple):
    """How a run of a filter ended.

    Attributes
    ----------
    covariance : ndarray, shape (n, n)
        After the last good event.
    n_good : int
        Events that went well.
    failure : int
        `OK`; or what ended the filter after event ``n_good - 1``: `PREDICTION`, or the sensor whose
        measurement it was. `NOT_CONVERGED` if it went to the end with what an iteration had not finished.
    faults : FaultScores or None
        Of an estimator that tests for faults.
    others : tuple of AlternativeEstimate
    convergence : ConvergenceStatus or None
        Of an iteration that did not converge.
    corrected : ndarray, shape (n_parameters,)
        Of a batch estimator: standard deviations that allow for the autocorrelation of what it leaves unexplained, see
        `auvid_cli.filters.autocorrelation`. Empty where there are none.
    """

    covariance: Array
    n_good: int
    failure: int
    faults: FaultScores | None = None
    others: tuple[AlternativeEstimate, ...] = ()
    convergence: ConvergenceStatus | None = None
    corrected: Array = np.zeros(0)
