"""The one problem that every filter solves: data, process, sensors and prior, as auvid itself sets them up."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.filters.problem import FilterOutcome, Gaussian, OnChunk, Process, Sensors, Timeline
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.process import first_order_transition
from auvid_cli.identification.run import FilterRun, set_up_filters
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.equations import N_CONSTANTS
from auvid_cli.vehicle.parameters import N_MOTION

Array = NDArray[np.float64]

# Coefficients come first in the state, in units of their prior standard deviation; then the nine motion states.
N_STATE = N_COEFFICIENTS + N_MOTION


class Answer(NamedTuple):
    """What a filter believes after the last event."""

    mean: Array
    covariance: Array


class Event(NamedTuple):
    """One prediction and one measurement: everything that does not depend on the state, made before the clock starts.

    Attributes
    ----------
    duration : float
        Since the event before, s; zero for the first, to which nothing leads.
    held : ndarray, shape (4,)
        Inputs that hold during it.
    process_noise : ndarray, shape (31, 31)
        Covariance that it adds.
    time : float
        s.
    measured : ndarray of int, shape (c,)
        States that are measured; all measurements of an event at once.
    measurement, variance : ndarray, shape (c,)
    matrix : ndarray, shape (c, 31)
        Selects the measured states.
    noise : ndarray, shape (c, c)
    """

    duration: float
    held: Array
    process_noise: Array
    time: float
    measured: NDArray[np.int64]
    measurement: Array
    variance: Array
    matrix: Array
    noise: Array


@dataclass(frozen=True)
class Problem:
    """Data and model.

    Attributes
    ----------
    filters : dict
        auvid's own by name, ready to run on a timeline.
    process, sensors, prior
        auvid's own.
    timeline : Timeline
        The first events of the data, for auvid's filters.
    events : tuple of Event
        The same for the others.
    covariance : ndarray, shape (31, 31)
        Of the prior.
    unscented : tuple of float
        alpha, beta, kappa of auvid's UKF.
    """

    filters: dict[str, Callable[[list[Timeline], OnChunk], FilterOutcome]]
    process: Process
    sensors: Sensors
    prior: Gaussian
    timeline: Timeline
    events: tuple[Event, ...]
    covariance: Array
    unscented: tuple[float, float, float]

    def first(self, n_events: int) -> "Problem":
        """Return the same with fewer events."""
        return replace(self, timeline=_first(self.timeline, n_events), events=self.events[:n_events])


@dataclass(frozen=True)
class Peer:
    """A filter to be measured.

    Attributes
    ----------
    name : str
        Kind of filter and what is special about it.
    library : str
        Of the package index, whose version is reported.
    process_model : str
        How the equations of motion are computed.
    reference : str
        Filter of auvid whose answer should come out.
    build : callable
        Makes a function that filters a problem from its prior to its end.
    max_events : int or None
        Where a slow one stops.
    compiles : bool
        Whether it compiles itself for the data when it first runs.
    note : str
    """

    name: str
    library: str
    process_model: str
    reference: str
    build: Callable[[Problem], Callable[[], Answer]]
    max_events: int | None = None
    compiles: bool = False
    note: str = ""


def make_problem(n_events: int) -> Problem:
    """Set up the beginning of the default experiment, with its own prior, noise and settings."""
    dataset = simulate(load_experiment(find_experiment(None), []))
    runs = set_up_filters(prepare(dataset), list(FilterName))
    settings = dataset.experiment.identification
    exact = settings.model_copy(update={"ekf": settings.ekf.model_copy(update={"transition": "exact"})})
    experiment = dataset.experiment.model_copy(update={"identification": exact})
    (exact_ekf,) = set_up_filters(prepare(replace(dataset, experiment=experiment)), [FilterName.EKF])

    problem = augmented_problem(prepare(dataset))
    process, sensors = problem.process._replace(transition=first_order_transition), problem.sensors
    whole = next(iter(problem.segments[0].timelines))
    if not 0 < n_events <= whole.time.size:
        raise ValueError(f"--events must be from 1 to {whole.time.size}")
    timeline = _first(whole._replace(measurement=_unwrapped(whole, sensors)), n_events)
    prior = problem.prior
    filters = {run.header.filter: _from_prior(run, prior) for run in runs} | {
        "ekf exact": _from_prior(exact_ekf, prior)
    }
    unscented = settings.ukf.alpha, settings.ukf.beta, settings.ukf.kappa
    covariance = prior.factor @ prior.factor.T
    return Problem(
        filters, process, sensors, prior, timeline, _events(timeline, process, sensors), covariance, unscented
    )


def units_of(process: Process) -> Array:
    """Return what the units of the estimated coefficients are in SI: behind the vehicle and the held coefficients."""
    return process.constants[N_CONSTANTS + N_COEFFICIENTS : N_CONSTANTS + 2 * N_COEFFICIENTS]


def _from_prior(run: FilterRun, prior: Gaussian) -> Callable[[list[Timeline], OnChunk], FilterOutcome]:
    """Turn a run of ours into a filter of any data."""
    return lambda timelines, receive: run.estimator.estimate([timelines], prior, receive)


def _first(timeline: Timeline, n_events: int) -> Timeline:
    n_substeps, n_measurements = timeline.substep_offset[n_events], timeline.measurement_offset[n_events]
    return Timeline(
        timeline.time[:n_events],
        timeline.substep_offset[: n_events + 1],
        timeline.substep_duration[:n_substeps],
        timeline.substep_input[:n_substeps],
        timeline.inputs,
        timeline.event_input[:n_events],
        timeline.measurement_offset[: n_events + 1],
        timeline.measurement_sensor[:n_measurements],
        timeline.measurement[:n_measurements],
    )


def _unwrapped(timeline: Timeline, sensors: Sensors) -> Array:
    """Return angles without jumps, because not every library can wrap an innovation."""
    measurement = timeline.measurement.copy()
    for sensor in np.flatnonzero(sensors.angular.any(axis=1)):
        own = timeline.measurement_sensor == sensor
        measurement[own] = np.unwrap(measurement[own], axis=0)
    return measurement


def _events(timeline: Timeline, process: Process, sensors: Sensors) -> tuple[Event, ...]:
    substeps = np.diff(timeline.substep_offset)
    if substeps[0] != 0 or (substeps[1:] != 1).any() or np.isnan(timeline.measurement).any():
        raise ValueError("the peers are written for one integration step from event to event and whole measurements")
    events = []
    noises = {0.0: np.zeros((N_STATE, N_STATE))}
    for k in range(timeline.time.size):
        duration, held = 0.0, timeline.inputs[0]
        if k:
            substep = timeline.substep_offset[k]
            duration, held = float(timeline.substep_duration[substep]), timeline.inputs[timeline.substep_input[substep]]
        if duration not in noises:
            noises[duration] = np.zeros((N_STATE, N_STATE))
            noises[duration][N_COEFFICIENTS:, N_COEFFICIENTS:] = np.diag(process.noise_density**2 * duration)
        measurements = slice(timeline.measurement_offset[k], timeline.measurement_offset[k + 1])
        rows = timeline.measurement_sensor[measurements]
        matrix, variance = np.concatenate(sensors.matrix[rows]), np.concatenate(sensors.variance[rows])
        measured = matrix.argmax(axis=1)
        measurement = timeline.measurement[measurements].ravel()
        time = float(timeline.time[k])
        events.append(
            Event(duration, held, noises[duration], time, measured, measurement, variance, matrix, np.diag(variance))
        )
    return tuple(events)
