"""Models with their uncertainty, and initial states for free runs from the data."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import EXCESS_BUOYANCY, FIN_TRIMS, THRUST_SCALE, TRIM_MOMENT, BiasName
from auvid_cli.config.filters import Prior
from auvid_cli.config.identification import Identification, InputSettings, Use
from auvid_cli.config.vehicle import ActuatorSettings, VehicleEntry
from auvid_cli.data.acting_inputs import as_acting
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.free_run import MeasurementErrors, estimated_errors
from auvid_cli.filters.problem import OK, Records, Timeline
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature
from auvid_cli.identification.prepared_data import PreparedData, corrected_records
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.states import coefficient_priors
from auvid_cli.vehicle.actuators import AS_STATED
from auvid_cli.vehicle.equations import NO_ERRORS
from auvid_cli.vehicle.matrices import NO_BALLAST
from auvid_cli.vehicle.parameters import DISTURBANCE, MOTION_AND_DEPTH, Quantity

Array = NDArray[np.float64]
# Mean NIS of a component above which the settings do not hold.
LARGEST_NIS = 1.5
# By which the process noise is tried then.
_NOISE_FACTORS = (10.0, 100.0, 1000.0)
# What is found once for all is part of the model, and not of what a filter finds ahead of a prediction; what walks is
# another in each run.
_OF_THE_MODEL = BiasName.THRUST, BiasName.FIN_TRIM, BiasName.BALLAST, BiasName.DELAY
# By the order of `NO_ERRORS`, to which they add.
VEHICLE_ERRORS = THRUST_SCALE, *FIN_TRIMS, EXCESS_BUOYANCY, TRIM_MOMENT


@dataclass(frozen=True)
class InitialStates:
    """Filtered motion and depth at some events, from the measurements up to there.

    Attributes
    ----------
    time : ndarray, shape (k,)
        s.
    motion, deviation : ndarray, shape (k, 10)
        Mean and standard deviation; zero of a depth that is not measured.
        The velocity is that through the water where the filter looks for a current.
    force, force_deviation : ndarray, shape (k, 6)
        Mean and standard deviation of what disturbs the motion, N and N m; zero where the filter does not look for it.
    vehicle, vehicle_deviation : ndarray, shape (k, 5)
        Mean and standard deviation of `NO_ERRORS`: what the thrust, the fins and the ballast are of this run, where the
        filter looks for it.
    errors, errors_deviation : list of MeasurementErrors
        Mean and standard deviation of what the filter finds of the sensors' errors and of the current by then.
    final_errors : MeasurementErrors
        The mean at the end.
    final_vehicle : ndarray, shape (5,)
        That of `vehicle`.
    nis : dict of float
        Normalised innovation squared of each sensor, per component: 1 if measurements are predicted as well from one to
        the next as the model says.
    status : str
        "completed", or how far the filter came.
    process_noise : ndarray, shape (10,)
        Root of its spectral density for each motion state and the depth by the settings, SI / s^0.5.
    noise_factor : float
        By how much that of the filter is larger.
    """

    time: Array
    motion: Array
    deviation: Array
    force: Array
    force_deviation: Array
    vehicle: Array
    vehicle_deviation: Array
    errors: list[MeasurementErrors]
    errors_deviation: list[MeasurementErrors]
    final_errors: MeasurementErrors
    final_vehicle: Array
    nis: dict[str, float]
    status: str
    process_noise: Array
    noise_factor: float = 1.0


def with_model(dataset: Dataset, estimate: Estimate, anew: bool = False) -> Dataset:
    """Return the data as the model sees them: its vehicle, coefficients, ballast, fins, thrust, settings; no truth.

    Of ballast, fins and thrust those that walk are left to the filter that finds where predictions start, or all of
    them if they are to be found anew.
    """
    earlier, identification = estimate.experiment, estimate.experiment.identification
    own = own_of_each_run(identification, anew)
    vehicle = earlier.vehicle.with_coefficients(estimate.final_coefficients())
    inputs = as_acting(dataset.inputs, earlier)
    actuators = estimate.final_actuators()
    if BiasName.THRUST in own:
        actuators = actuators._replace(thrust=AS_STATED.thrust)
    if BiasName.FIN_TRIM in own:
        actuators = AS_STATED._replace(thrust=actuators.thrust)
    values = actuators.acting(inputs.values)
    ballast = NO_BALLAST if BiasName.BALLAST in own else estimate.final_ballast()
    ballasted = ballast.added_to(earlier.vehicle.known_parameters())
    entries = {symbol: VehicleEntry(value=value) for symbol, value in ballasted.items()}
    parameters = earlier.vehicle.parameters.model_copy(update=entries)
    kept = tuple(block for block in identification.estimate.biases if block not in _OF_THE_MODEL or block in own)
    changes = {
        "coefficients": (),
        "prior": Prior(),
        "inputs": InputSettings(),
        "delays": {},
        "use": Use(),
        "estimate": identification.estimate.model_copy(update={"biases": kept}),
    }
    settings = {
        "vehicle": vehicle.model_copy(update={"parameters": parameters, "actuators": ActuatorSettings()}),
        "identification": identification.model_copy(update=changes),
    }
    experiment = dataset.experiment.model_copy(update=settings)
    sensors = corrected_records(dataset.sensors, identification)
    return replace(dataset, truth=None, experiment=experiment, inputs=replace(inputs, values=values), sensors=sensors)


def own_of_each_run(settings: Identification, anew: bool = False) -> tuple[BiasName, ...]:
    """Name what of the vehicle begins anew in each run: what settings take to walk, or all that they estimate."""
    blocks = {name: settings.estimate.blocks_of(name) for name in settings.estimate.biases}
    return tuple(
        name
        for name in _OF_THE_MODEL
        if any(block.walk > 0.0 or (anew and not block.shifts) for block in blocks.get(name, ()))
    )


def errors_of_each_run(settings: Identification, anew: bool = False) -> set[str]:
    """Name, by symbol, what a filter finds of thrust, fins and ballast in each run."""
    return {
        quantity.symbol
        for name in own_of_each_run(settings, anew)
        for block in settings.estimate.blocks_of(name)
        for quantity in block.quantities
    }


def filtered_initial_states(prepared: PreparedData, wanted: Array) -> InitialStates:
    """Filter the motion alone, and keep it at the first events at or after some times.

    Each start knows only measurements before what is predicted from it, at whatever times each sensor spoke, and what
    no sensor measures comes from the model. The process noise is that of the estimate's settings; where the
    innovations of the whole run contradict it, it is made larger, so that the measurements and not a wrong model say
    where predictions start. The NIS stays that of the settings.

    Parameters
    ----------
    prepared : PreparedData
        From `with_model`.
    wanted : ndarray, shape (k,)
        s, increasing.

    Raises
    ------
    DataError
        As `augmented_problem`.
    """
    first = states = _filtered(prepared, wanted)
    for factor in _NOISE_FACTORS:
        if states.status == "completed" and max(states.nis.values()) <= LARGEST_NIS:
            break
        states = replace(_filtered(_with_noise(prepared, factor), wanted), noise_factor=factor)
    return replace(states, nis=first.nis, process_noise=first.process_noise)


def _with_noise(prepared: PreparedData, factor: float) -> PreparedData:
    """Prepare the data with all densities of the process noise so many times as large."""
    settings = prepared.experiment.identification
    identification = settings.model_copy(update={"process_noise": settings.process_noise.times(factor)})
    return prepared.with_settings(prepared.experiment.model_copy(update={"identification": identification}))


def _filtered(prepared: PreparedData, wanted: Array) -> InitialStates:
    problem = augmented_problem(prepared)
    kept, squares, components = [], np.zeros(len(problem.measuring)), np.zeros(len(problem.measuring))
    timelines, prior = problem.segments[0].timelines, problem.prior
    reached, last = timelines.span[0], prior.mean

    def receive(timeline: Timeline, records: Records) -> None:
        nonlocal reached, last
        good = len(records.mean)
        if not good:
            return
        time = timeline.time[:good]
        moments = wanted[(wanted > reached) & (wanted <= time[-1])]
        # Where measurements are far apart, the same event follows several times.
        events = np.unique(np.searchsorted(time, moments))
        kept.extend(zip(time[events], records.mean[events], records.standard_deviation[events], strict=True))
        reached, last = float(time[-1]), records.mean[-1]
        sensors = timeline.measurement_sensor[: len(records.nis)]
        for sensor in range(squares.size):
            counted = (sensors == sensor) & np.isfinite(records.nis)
            squares[sensor] += records.nis[counted].sum()
            components[sensor] += np.isfinite(records.innovation_variance[counted]).sum()

    def picked(quantities: Sequence[Quantity], states: Array) -> Array:
        """Return states, shape (n, quantities); zero where there are none."""
        columns = [problem.layout.row(quantity.symbol) for quantity in quantities]
        none = np.zeros(len(states))
        return np.column_stack([none if column is None else states[:, column] for column in columns])

    points, density = cubature(prior.mean.size), np.zeros(prior.mean.size)
    density[problem.layout.n_parameters :] = problem.process.noise_density
    outcome = run_square_root_filter(points, problem.process, problem.sensors, timelines, prior, receive)
    time, mean, deviation = (np.array(rows) for rows in zip(*kept, strict=True)) if kept else (np.zeros(0),) * 3
    shape = len(kept), len(problem.layout.symbols)
    mean, deviation = mean.reshape(shape), deviation.reshape(shape)
    return InitialStates(
        time,
        picked(MOTION_AND_DEPTH, mean),
        picked(MOTION_AND_DEPTH, deviation),
        picked(DISTURBANCE, mean),
        picked(DISTURBANCE, deviation),
        NO_ERRORS + picked(VEHICLE_ERRORS, mean),
        picked(VEHICLE_ERRORS, deviation),
        [estimated_errors(problem.layout.symbols, row) for row in mean],
        [estimated_errors(problem.layout.symbols, row) for row in deviation],
        estimated_errors(problem.layout.symbols, last),
        (NO_ERRORS + picked(VEHICLE_ERRORS, last[None]))[0],
        {name: float(s / max(n, 1.0)) for name, s, n in zip(problem.measuring, squares, components, strict=True)},
        "completed" if outcome.failure == OK else f"diverged at t = {reached:.3f} s",
        picked(MOTION_AND_DEPTH, density[None])[0],
    )


class Models(NamedTuple):
    """Coefficients by symbol, SI.

    Attributes
    ----------
    identified : dict
    prior : dict or None
        Mean of the prior, None if it is not in the estimate.
    vehicle_file : dict or None
        None if the vehicle file does not state all, or states the prior.
    """

    identified: Mapping[str, float]
    prior: Mapping[str, float] | None
    vehicle_file: Mapping[str, float] | None


def models_of(estimate: Estimate) -> Models:
    """Return the models that an estimate knows of."""
    return Models(estimate.final_coefficients(), _prior(estimate), _vehicle_file(estimate))


def _prior(estimate: Estimate) -> Mapping[str, float] | None:
    estimated = [symbol for symbol in estimate.coefficient_set.symbols if symbol in estimate.state]
    settings = estimate.experiment
    if settings.identification.prior.from_estimate is None:
        priors = coefficient_priors(settings.vehicle, settings.identification.prior)
        return estimate.held | {symbol: priors[symbol].mean for symbol in estimated}
    if estimate.in_one_batch:
        return None
    # The first measurements say nothing of coefficients: there the mean is still the prior's.
    return estimate.held | {symbol: float(estimate.mean[0, estimate.state.index(symbol)]) for symbol in estimated}


def _vehicle_file(estimate: Estimate) -> Mapping[str, float] | None:
    given = estimate.experiment.vehicle.stated_coefficients()
    return given if set(given) == set(estimate.coefficient_set.symbols) else None


class Draws(NamedTuple):
    """Models that may be as well.

    Attributes
    ----------
    coefficients : ndarray, shape (count, 22 + terms)
        SI.
    errors : ndarray, shape (count, 5)
        By how much thrust, fins and ballast differ from those of the identified model, by the order of `NO_ERRORS`.
    """

    coefficients: Array
    errors: Array


def drawn_models(
    estimate: Estimate, count: int, rng: np.random.Generator, left_out: Collection[str] = ()
) -> Draws | None:
    """Draw models from the final mean and covariance of an estimate.

    Thrust, fins and ballast are drawn along with the coefficients: what data tell is often the two together, and a
    coefficient that is unsure because the ballast is, is less so beside the ballast that goes with it.

    Parameters
    ----------
    estimate : Estimate
    count : int
    rng : numpy.random.Generator
    left_out : collection of str
        Symbols of errors that are no part of the model, since they are found in each run.

    Returns
    -------
    Draws or None
        None if the covariance is not finite and positive definite.
    """
    symbols, final = estimate.coefficient_set.symbols, estimate.final_coefficients()
    known = [error.symbol in estimate.state and error.symbol not in left_out for error in VEHICLE_ERRORS]
    beside = [
        estimate.state.index(error.symbol) for error, is_drawn in zip(VEHICLE_ERRORS, known, strict=True) if is_drawn
    ]
    rows, n = [*estimate.coefficient_rows, *beside], len(estimate.coefficient_rows)
    drawn = np.tile([final[symbol] for symbol in symbols], (count, 1))
    covariance = estimate.final_covariance()[np.ix_(rows, rows)]
    variance = np.diagonal(covariance)
    if not (np.isfinite(covariance).all() and (variance > 0.0).all()):
        return None
    # Coefficients differ by orders of magnitude.
    deviation = np.sqrt(variance)
    try:
        factor = np.linalg.cholesky(covariance / np.outer(deviation, deviation))
    except np.linalg.LinAlgError:
        return None
    off = deviation * (rng.standard_normal((count, len(rows))) @ factor.T)
    drawn[:, [symbols.index(estimate.state[i]) for i in rows[:n]]] += off[:, :n]
    errors = np.zeros((count, len(VEHICLE_ERRORS)))
    errors[:, known] = off[:, n:]
    # The stated force already acts as many times as was found.
    errors[:, 0] /= estimate.final_actuators().thrust
    return Draws(drawn, errors)
