"""What a filter will state after a run: the covariance of the coefficients, with process noise, along a true motion."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray
from scipy.linalg import block_diag

from auvid_cli.compilation import compiled
from auvid_cli.config.experiment import Experiment
from auvid_cli.identification.states import coefficient_priors
from auvid_cli.simulation.motion import Truth
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.jacobian import N_COLUMNS, transition_step, transition_work
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, N_MOTION, SENSORS

Array = NDArray[np.float64]

# Those that measure the motion itself.
MEASURING = "gyroscope", "dvl", "attitude"


class FilterAssumptions(NamedTuple):
    """What a filter knows before a run and learns in it, SI.

    Attributes
    ----------
    prior_std : ndarray, shape (m,)
        Of the vehicle's coefficients; 0 of one that is held.
    initial_std : ndarray, shape (9,)
        Of the motion at the start.
    noise_density : ndarray, shape (9,)
        Of the process noise.
    measured_density : ndarray, shape (9,)
        Of the noise of what measures each motion state: its standard deviation by the root of its rate; infinite where
        nothing does.
    covariance : ndarray, shape (m, m)
        Of the coefficients before the run, in units of `prior_std`.
    """

    prior_std: Array
    initial_std: Array
    noise_density: Array
    measured_density: Array
    covariance: Array


class Posterior(NamedTuple):
    """What is known of the coefficients at the end of a run, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s.
    deviation : ndarray, shape (n, m)
        Standard deviations after so much of the run.
    covariance : ndarray, shape (m, m)
        At its end.
    """

    time: Array
    deviation: Array
    covariance: Array


def filter_assumptions(experiment: Experiment, in_hand: Array | None = None) -> FilterAssumptions:
    """Collect what the settings of an experiment say of priors and noise.

    Parameters
    ----------
    experiment : Experiment
    in_hand : ndarray, shape (m, m), optional
        Fisher information of earlier data about the vehicle's coefficients, SI.

    Notes
    -----
    Of gyroscope, DVL and attitude as a filter is told of them; errors that are estimated beside the coefficients, such
    as biases, are left out.
    """
    identification, suite = experiment.identification, experiment.sensors
    vehicle = experiment.vehicle
    priors, estimated = coefficient_priors(vehicle, identification.prior), identification.estimated(vehicle)
    density = np.full(N_MOTION, np.inf)
    for name, settings in ((name, sensor) for name, sensor in suite.given().items() if name in MEASURING):
        for quantity, deviation in zip(SENSORS[name], settings.stated_standard_deviation(), strict=True):
            density[MOTION_SYMBOLS.index(quantity.symbol)] = deviation / np.sqrt(settings.rate)
    noise, initial = identification.process_noise, identification.initial_motion
    prior_std = np.array(
        [priors[s].standard_deviation if s in estimated else 0.0 for s in vehicle.coefficient_set.symbols]
    )
    return FilterAssumptions(
        prior_std,
        np.repeat([initial.velocity, initial.rate, initial.attitude], 3),
        np.array(noise.of_motion()),
        density,
        _known_before(prior_std, in_hand),
    )


def _known_before(prior_std: Array, in_hand: Array | None) -> Array:
    """Return the covariance in units of the prior: that of the prior, or of the prior and earlier data."""
    free = prior_std > 0.0
    if in_hand is None:
        return np.diag(free.astype(float))
    information = np.eye(prior_std.size) + in_hand * np.outer(prior_std, prior_std)
    return np.linalg.inv(information).astype(np.float64) * np.outer(free, free)


def uncounted_information(experiment: Experiment) -> list[str]:
    """Name what an estimator would use or estimate besides, and is not counted."""
    identification = experiment.identification
    names = [f"estimated errors ({name.value})" for name in identification.estimate.biases]
    if identification.attitude_from == "inertial":
        names.append("raw inertial sensors, in place of which the attitude counts")
    if experiment.sensors.depth is not None:
        names.append("the depth sensor")
    if identification.prior.from_estimate is not None:
        names.append("the earlier estimate of the prior (identification.prior.from_estimate)")
    return names


_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class _Workspace(NamedTuple):
    """Arrays of a pass.

    Attributes
    ----------
    covariance : ndarray, shape (m + 9, m + 9)
        Coefficients in units of their priors, then the motion, SI.
    moved : ndarray, shape (9, m + 9)
    by_coefficients : ndarray, shape (9, m)
        What the motion owes to the coefficients in a step, in these units.
    column : ndarray, shape (m + 9,)
    motion : ndarray, shape (9,)
    transition : ndarray, shape (9, N_COLUMNS + terms)
    step : ndarray
        Of `transition_work`.
    """

    covariance: Array
    moved: Array
    by_coefficients: Array
    column: Array
    motion: Array
    transition: Array
    step: Array


_WORKSPACE = types.NamedTuple((_matrix, _matrix, _matrix, _vector, _vector, _matrix, _vector), _Workspace)
_KNOWLEDGE = types.NamedTuple((_vector, _vector, _vector, _vector, _matrix), FilterAssumptions)


@compiled(types.void(_vector, _WORKSPACE), internal=True)
def _predict(prior_std, work):
    """Move the covariance by the transition matrix in the workspace."""
    covariance, moved, transition, by_coefficients = work.covariance, work.moved, work.transition, work.by_coefficients
    m = prior_std.size
    for i in range(N_MOTION):
        for c in range(m):
            # Those of a vehicle's own terms stand behind all else.
            place = N_MOTION + c if c < N_COEFFICIENTS else N_COLUMNS + c - N_COEFFICIENTS
            by_coefficients[i, c] = transition[i, place] * prior_std[c]
    for i in range(N_MOTION):
        for j in range(m + N_MOTION):
            total = 0.0
            for c in range(m):
                total += by_coefficients[i, c] * covariance[c, j]
            for k in range(N_MOTION):
                total += transition[i, k] * covariance[m + k, j]
            moved[i, j] = total
    for i in range(N_MOTION):
        for c in range(m):
            covariance[m + i, c] = covariance[c, m + i] = moved[i, c]
        for j in range(i + 1):
            total = 0.0
            for c in range(m):
                total += moved[i, c] * by_coefficients[j, c]
            for k in range(N_MOTION):
                total += moved[i, m + k] * transition[j, k]
            covariance[m + i, m + j] = covariance[m + j, m + i] = total


@compiled(types.void(_vector, types.float64, _WORKSPACE), internal=True)
def _measure_motion(density, duration, work):
    """Update with measurements of each motion state for so long."""
    covariance, column = work.covariance, work.column
    m = column.size - N_MOTION
    for i in range(N_MOTION):
        for j in range(column.size):
            column[j] = covariance[m + i, j]
        variance = column[m + i] + density[i] ** 2 / duration
        for j in range(column.size):
            gain = column[j] / variance
            for k in range(column.size):
                covariance[j, k] -= gain * column[k]


@compiled(types.void(types.UniTuple(_matrix, 2), types.UniTuple(_vector, 3), _KNOWLEDGE, _matrix, _WORKSPACE))
def _run(record, vehicle, knowledge, deviation, work):
    inputs, motion = record
    time, constants, coefficients = vehicle
    m = knowledge.prior_std.size
    for tick in range(time.size):
        duration = time[1] - time[0] if tick == 0 else time[tick] - time[tick - 1]
        if tick > 0:
            # Each step is linearised about where the motion truly is, so that nothing runs away.
            for i in range(N_MOTION):
                work.motion[i] = motion[tick - 1, i]
                for j in range(work.transition.shape[1]):
                    work.transition[i, j] = 1.0 if i == j else 0.0
            transition_step(
                work.motion, coefficients, inputs[tick - 1], constants, duration, work.transition, work.step
            )
            _predict(knowledge.prior_std, work)
            for i in range(N_MOTION):
                work.covariance[m + i, m + i] += knowledge.noise_density[i] ** 2 * duration
        _measure_motion(knowledge.measured_density, duration, work)
        for c in range(m):
            deviation[tick, c] = knowledge.prior_std[c] * np.sqrt(work.covariance[c, c])


def predict_posterior(truth: Truth, knowledge: FilterAssumptions) -> Posterior:
    """Carry the covariance of an extended Kalman filter along a true motion, linearised step by step.

    Parameters
    ----------
    truth : Truth
        Its ticks are the steps: measurements count as often, with noise of the same density. 20 Hz are enough for a
        torpedo.
    knowledge : Knowledge
    """
    m = knowledge.prior_std.size
    terms = m - N_COEFFICIENTS
    work = _Workspace(
        np.ascontiguousarray(block_diag(knowledge.covariance, np.diag(knowledge.initial_std**2))),
        np.zeros((N_MOTION, m + N_MOTION)),
        np.zeros((N_MOTION, m)),
        np.zeros(m + N_MOTION),
        np.zeros(N_MOTION),
        np.zeros((N_MOTION, N_COLUMNS + terms)),
        np.zeros(transition_work(terms)),
    )
    deviation = np.zeros((truth.time.size, m))
    vehicle = truth.time, truth.constants, truth.coefficients
    _run((truth.inputs, truth.motion), vehicle, knowledge, deviation, work)
    covariance = work.covariance[:m, :m]
    return Posterior(truth.time, deviation, covariance * np.outer(knowledge.prior_std, knowledge.prior_std))
