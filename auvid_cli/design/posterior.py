"""Covariance of the coefficients that a filter will report after a run, with process noise, along a true motion."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from auvid_cli.arrays import Array
from auvid_cli.config.experiment import Experiment
from auvid_cli.identification.states import coefficient_priors
from auvid_cli.numerics import compiled, types
from auvid_cli.simulation.motion import Truth
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.jacobian import N_COLUMNS, transition_step, transition_work
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, N_MOTION, SENSORS

_COUNTED_SENSORS = ("gyroscope", "dvl", "attitude")


class FilterAssumptions(NamedTuple):
    """Priors and noise levels of a filter, SI."""

    prior_std: Array  # shape (m,); prior standard deviation of each coefficient; 0 if it is fixed
    initial_std: Array  # shape (9,); standard deviation of the motion at the start
    noise_density: Array  # shape (9,); process noise, per square root of a second
    # Shape (9,); measurement noise of each motion state: standard deviation divided by the square root of the rate;
    # infinite without a sensor
    measured_density: Array
    covariance: Array  # shape (m, m); covariance of the coefficients before the run, in units of `prior_std`


class Posterior(NamedTuple):
    """Accuracy of the coefficients along a run, SI."""

    time: Array  # shape (n,); s
    deviation: Array  # shape (n, m); standard deviations at these times
    covariance: Array  # shape (m, m); covariance at the end


def filter_assumptions(experiment: Experiment, earlier_information: Array | None = None) -> FilterAssumptions:
    """Return priors and noise levels from the settings of an experiment.

    Gyroscope, DVL and attitude count, with the noise that their settings state. Estimated sensor errors, such as
    biases, are left out.

    Parameters
    ----------
    earlier_information : ndarray, shape (m, m), optional
        Fisher information of earlier data about the coefficients, SI.
    """
    identification, vehicle = experiment.identification, experiment.vehicle
    priors, estimated = coefficient_priors(vehicle, identification.prior), identification.estimated(vehicle)
    density = np.full(N_MOTION, np.inf)
    for name, settings in experiment.sensors.given().items():
        if name in _COUNTED_SENSORS:
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
        _initial_covariance(prior_std, earlier_information),
    )


def _initial_covariance(prior_std: Array, earlier_information: Array | None) -> Array:
    """Return the covariance before the run, in units of the prior, shape (m, m)."""
    free = prior_std > 0.0
    if earlier_information is None:
        return np.diag(free.astype(float))
    information = np.eye(prior_std.size) + earlier_information * np.outer(prior_std, prior_std)
    return np.linalg.inv(information).astype(np.float64) * np.outer(free, free)


def uncounted_information(experiment: Experiment) -> list[str]:
    """Return the names of data and errors that an estimator uses or estimates, but that the prediction ignores."""
    identification = experiment.identification
    names = [f"estimated errors ({name.value})" for name in identification.estimate.biases]
    if identification.attitude_from == "inertial":
        names.append("raw inertial sensors (the attitude counts instead)")
    if experiment.sensors.depth is not None:
        names.append("the depth sensor")
    if identification.prior.from_estimate is not None:
        names.append("the earlier estimate of the prior (identification.prior.from_estimate)")
    return names


_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class _Workspace(NamedTuple):
    """Arrays of a pass."""

    covariance: Array  # shape (m + 9, m + 9); coefficients in units of their priors, then the motion, SI
    moved: Array  # shape (9, m + 9); rows of the motion after multiplication by the transition matrix
    # Shape (9, m); sensitivity of the motion after a step to the coefficients, in units of their priors
    by_coefficients: Array
    column: Array  # shape (m + 9,)
    motion: Array  # shape (9,)
    transition: Array  # shape (9, N_COLUMNS + terms)
    step: Array  # workspace of `transition_step`


_WORKSPACE = types.NamedTuple((_matrix, _matrix, _matrix, _vector, _vector, _matrix, _vector), _Workspace)
_ASSUMPTIONS = types.NamedTuple((_vector, _vector, _vector, _vector, _matrix), FilterAssumptions)


@compiled()
def _predict(prior_std, work):
    """Propagate the covariance by the transition matrix in the workspace."""
    covariance, moved, transition, by_coefficients = work.covariance, work.moved, work.transition, work.by_coefficients
    m = prior_std.size
    for i in range(N_MOTION):
        for c in range(m):
            # Columns of a vehicle's own terms follow all others.
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


@compiled()
def _measure_motion(density, duration, work):
    """Update with measurements of each motion state during `duration`, s."""
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


@compiled(types.void(types.UniTuple(_matrix, 2), types.UniTuple(_vector, 3), _ASSUMPTIONS, _matrix, _WORKSPACE))
def _run(record, vehicle, assumptions, deviation, work):
    inputs, motion = record
    time, constants, coefficients = vehicle
    m = assumptions.prior_std.size
    for tick in range(time.size):
        duration = time[1] - time[0] if tick == 0 else time[tick] - time[tick - 1]
        if tick > 0:
            # Linearised about the true motion at each step, so that an unstable vehicle does not diverge.
            for i in range(N_MOTION):
                work.motion[i] = motion[tick - 1, i]
                for j in range(work.transition.shape[1]):
                    work.transition[i, j] = 1.0 if i == j else 0.0
            transition_step(
                work.motion, coefficients, inputs[tick - 1], constants, duration, work.transition, work.step
            )
            _predict(assumptions.prior_std, work)
            for i in range(N_MOTION):
                work.covariance[m + i, m + i] += assumptions.noise_density[i] ** 2 * duration
        _measure_motion(assumptions.measured_density, duration, work)
        for c in range(m):
            deviation[tick, c] = assumptions.prior_std[c] * np.sqrt(work.covariance[c, c])


def predict_posterior(truth: Truth, assumptions: FilterAssumptions) -> Posterior:
    """Propagate the covariance of an extended Kalman filter along a true motion.

    Parameters
    ----------
    truth : Truth
        Each interval is one step with one measurement; its noise keeps the density of the sensor, so the interval
        hardly matters. 20 Hz are enough for a torpedo.
    """
    m = assumptions.prior_std.size
    terms = m - N_COEFFICIENTS
    work = _Workspace(
        np.ascontiguousarray(block_diag(assumptions.covariance, np.diag(assumptions.initial_std**2))),
        np.zeros((N_MOTION, m + N_MOTION)),
        np.zeros((N_MOTION, m)),
        np.zeros(m + N_MOTION),
        np.zeros(N_MOTION),
        np.zeros((N_MOTION, N_COLUMNS + terms)),
        np.zeros(transition_work(terms)),
    )
    deviation = np.zeros((truth.time.size, m))
    vehicle = truth.time, truth.constants, truth.coefficients
    _run((truth.inputs, truth.motion), vehicle, assumptions, deviation, work)
    covariance = work.covariance[:m, :m]
    return Posterior(truth.time, deviation, covariance * np.outer(assumptions.prior_std, assumptions.prior_std))
