"""Models with their uncertainty, and initial states for free runs from the data."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.coefficients import Prior
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import EXCESS_BUOYANCY, FIN_TRIMS, THRUST_SCALE, TRIM_MOMENT, BiasName
from auvid_cli.config.identification import Identification, InputSettings, Use
from auvid_cli.config.vehicle import ActuatorSettings, VehicleEntry
from auvid_cli.data.acting_inputs import as_acting
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import FaultKind
from auvid_cli.evaluation.free_run import MeasurementErrors, estimated_errors
from auvid_cli.filters.problem import OK, Records, Timeline
from auvid_cli.filters.square_root import run_square_root_filter
from auvid_cli.filters.workspace import cubature
from auvid_cli.identification.prepared_data import PreparedData, corrected_records
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.states import coefficient_priors
from auvid_cli.validation.results import MAX_NIS
from auvid_cli.vehicle.equations import NO_ERRORS
from auvid_cli.vehicle.parameters import AS_STATED, DISTURBANCE, MOTION_AND_DEPTH, Quantity
from auvid_cli.vehicle.rigid_body import NO_BALLAST, dvl_axes

_NOISE_FACTORS = (10.0, 100.0, 1000.0)  # of the process noise, tried if innovations contradict the settings
# A constant of these blocks is part of the model; one that walks differs in each run.
_MODEL_BLOCKS = BiasName.THRUST, BiasName.FIN_TRIM, BiasName.BALLAST, BiasName.DELAY
VEHICLE_ERRORS = THRUST_SCALE, *FIN_TRIMS, EXCESS_BUOYANCY, TRIM_MOMENT  # in the order of `NO_ERRORS`


@dataclass(frozen=True)
class InitialStates:
    """Filtered motion and depth at some events, from earlier measurements."""

    time: Array  # s, shape (k,)
    # motion, deviation: shape (k, 10); mean and standard deviation; zero for a depth that is not measured. With an
    # estimated current, velocities are those through the water.
    motion: Array
    deviation: Array
    # force, force_deviation: shape (k, 6); mean and standard deviation of the disturbance, N and N m; zero if it is not
    # estimated
    force: Array
    force_deviation: Array
    # vehicle, vehicle_deviation: shape (k, 5); mean and standard deviation of thrust, fins and ballast in this run, in
    # the order of `NO_ERRORS`
    vehicle: Array
    vehicle_deviation: Array
    # errors, errors_deviation: mean and standard deviation of the errors of the sensors and the current
    errors: list[MeasurementErrors]
    errors_deviation: list[MeasurementErrors]
    final_errors: MeasurementErrors  # mean at the end
    final_vehicle: Array  # shape (5,); `vehicle` at the end
    # Normalised innovation squared by sensor, per component; 1 if the model predicts the next measurement as accurately
    # as it states
    nis: dict[str, float]
    status: str  # "completed", or the time of divergence
    # Shape (10,); root spectral density for each motion state and depth from the settings, SI / s^0.5
    process_noise: Array
    noise_factor: float = 1.0  # ratio of the filter's process noise to it


def with_model(dataset: Dataset, estimate: Estimate, anew: bool = False) -> Dataset:
    """Return the data with the estimate's vehicle, coefficients, ballast, fins, thrust and settings, without truth.

    Ballast, fins and thrust that walk (with `anew` also constant ones) are estimated by the filter that finds the
    initial states. A constant scale and yaw of the DVL are removed from its velocities.
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
    if actuators != AS_STATED:
        inputs = replace(inputs, values=actuators.acting(inputs.values))
    ballast = NO_BALLAST if BiasName.BALLAST in own else estimate.final_ballast()
    ballasted = ballast.added_to(earlier.vehicle.known_parameters())
    entries = {symbol: VehicleEntry(value=value) for symbol, value in ballasted.items()}
    parameters = earlier.vehicle.parameters.model_copy(update=entries)
    kept = [block for block in identification.estimate.biases if block not in _MODEL_BLOCKS or block in own]
    vehicle = vehicle.model_copy(update={"parameters": parameters})
    acting = replace(dataset, inputs=inputs)
    if BiasName.DVL in kept and all(block.walk == 0.0 for block in identification.estimate.blocks_of(BiasName.DVL)):
        # Short data hardly tell the mounting of a DVL from sideslip, and it does not change.
        kept.remove(BiasName.DVL)
        acting = _with_mounted_dvl(acting, estimate)
    return _with_fixed_model(acting, earlier.model_copy(update={"vehicle": vehicle}), kept)


def _with_mounted_dvl(dataset: Dataset, estimate: Estimate) -> Dataset:
    """Return the data with the velocities of the DVL in the axes of the vehicle, by its estimated scale and yaw."""
    if "dvl" not in dataset.sensors:
        return dataset
    scale, yaw, *_ = estimated_errors(estimate.state, estimate.mean[-1]).dvl
    record = dataset.sensors["dvl"]
    corrected = replace(record, values=record.values @ np.linalg.inv(dvl_axes(scale, yaw)).T)
    return replace(dataset, sensors={**dataset.sensors, "dvl": corrected})


def with_vehicle_file(dataset: Dataset) -> Dataset | None:
    """Return the data with their own vehicle and settings, without truth; None if the vehicle lacks a coefficient.

    No estimate has a part in it. A current belongs to the water, so it is estimated from these data.
    """
    settings = dataset.experiment
    if set(settings.vehicle.stated_coefficients()) != set(settings.vehicle.coefficient_set.symbols):
        return None
    kept = [block for block in settings.identification.estimate.biases if block not in _MODEL_BLOCKS]
    if "dvl" in dataset.sensors and BiasName.CURRENT not in kept:
        kept.append(BiasName.CURRENT)
    return _with_fixed_model(replace(dataset, inputs=as_acting(dataset.inputs, settings)), settings, kept)


def _with_fixed_model(dataset: Dataset, settings: RunSettings, blocks: Sequence[BiasName]) -> Dataset:
    """Return data, whose inputs act as they are, with a vehicle and noise, and some estimated errors."""
    identification = settings.identification
    changes = {
        "coefficients": (),
        "prior": Prior(),
        "inputs": InputSettings(),
        "delays": {},
        "use": Use(),
        "estimate": identification.estimate.model_copy(update={"biases": tuple(blocks)}),
    }
    updated = {
        "vehicle": settings.vehicle.model_copy(update={"actuators": ActuatorSettings()}),
        "identification": identification.model_copy(update=changes),
    }
    experiment = dataset.experiment.model_copy(update=updated)
    sensors = corrected_records(dataset.sensors, identification)
    return replace(dataset, truth=None, experiment=experiment, sensors=sensors)


def own_of_each_run(settings: Identification, anew: bool = False) -> tuple[BiasName, ...]:
    """Return the blocks of the vehicle that differ in each run: those that walk, or with `anew` all estimated ones."""
    blocks = {name: settings.estimate.blocks_of(name) for name in settings.estimate.biases}
    return tuple(
        name
        for name in _MODEL_BLOCKS
        if any(block.walk > 0.0 or (anew and not block.is_delay) for block in blocks.get(name, ()))
    )


def errors_of_each_run(settings: Identification, anew: bool = False) -> set[str]:
    """Return the symbols of thrust, fins and ballast that differ in each run."""
    return {
        quantity.symbol
        for name in own_of_each_run(settings, anew)
        for block in settings.estimate.blocks_of(name)
        for quantity in block.quantities
    }


def filtered_initial_states(prepared: PreparedData, wanted: Array) -> InitialStates:
    """Return the filtered motion at the first events at or after the `wanted` times, s, shape (k,), increasing.

    Each state depends only on earlier measurements, at the different rates of the sensors; the model provides what no
    sensor measures. If innovations of the whole run contradict the process noise of the estimate's settings, it is
    increased, so that the measurements determine the states instead of a wrong model. The NIS is that of the settings.
    `prepared` is data from `with_model`.
    """
    settings = prepared.experiment.identification
    first = states = _filtered(prepared, wanted)
    for factor in _NOISE_FACTORS:
        if states.status == "completed" and max(states.nis.values()) <= MAX_NIS:
            break
        noise = settings.process_noise.times(factor)
        states = replace(_filtered(prepared.with_identification(process_noise=noise), wanted), noise_factor=factor)
    return replace(states, nis=first.nis, process_noise=first.process_noise)


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
        # Where measurements are far apart, several times have the same event.
        events = np.unique(np.searchsorted(time, moments))
        kept.extend(zip(time[events], records.mean[events], records.standard_deviation[events], strict=True))
        reached, last = float(time[-1]), records.mean[-1]
        sensors = timeline.measurement_sensor[: len(records.nis)]
        for sensor in range(squares.size):
            counted = (sensors == sensor) & np.isfinite(records.nis)
            squares[sensor] += records.nis[counted].sum()
            components[sensor] += np.isfinite(records.innovation_variance[counted]).sum()

    def columns_of(quantities: Sequence[Quantity], states: Array) -> Array:
        """Return states, shape (n, quantities); zero for those that are not estimated."""
        columns = [problem.layout.row(quantity.symbol) for quantity in quantities]
        none = np.zeros(len(states))
        return np.column_stack([none if column is None else states[:, column] for column in columns])

    points, density = cubature(prior.mean.size), np.zeros(prior.mean.size)
    density[problem.layout.n_parameters :] = problem.process.noise_density
    outcome = run_square_root_filter(points, problem.process, problem.sensors, timelines, prior, receive)
    time, mean, deviation = (np.array(rows) for rows in zip(*kept, strict=True)) if kept else (np.zeros(0),) * 3
    shape = len(kept), len(problem.layout.symbols)
    mean, deviation = mean.reshape(shape), deviation.reshape(shape)
    symbols = problem.layout.symbols
    return InitialStates(
        time=time,
        motion=columns_of(MOTION_AND_DEPTH, mean),
        deviation=columns_of(MOTION_AND_DEPTH, deviation),
        force=columns_of(DISTURBANCE, mean),
        force_deviation=columns_of(DISTURBANCE, deviation),
        vehicle=NO_ERRORS + columns_of(VEHICLE_ERRORS, mean),
        vehicle_deviation=columns_of(VEHICLE_ERRORS, deviation),
        errors=[estimated_errors(symbols, row) for row in mean],
        errors_deviation=[estimated_errors(symbols, row) for row in deviation],
        final_errors=estimated_errors(symbols, last),
        final_vehicle=(NO_ERRORS + columns_of(VEHICLE_ERRORS, last[None]))[0],
        nis={n: float(s / max(c, 1.0)) for n, s, c in zip(problem.measuring, squares, components, strict=True)},
        status="completed" if outcome.failure == OK else f"diverged at t = {reached:.3f} s",
        process_noise=columns_of(MOTION_AND_DEPTH, density[None])[0],
    )


class Models(NamedTuple):
    """Coefficients by symbol, SI."""

    identified: Mapping[str, float]
    prior: Mapping[str, float] | None  # mean of the prior; None if the estimate does not contain it


def models_of(estimate: Estimate) -> Models:
    """Return the models that an estimate contains."""
    return Models(estimate.final_coefficients(), _prior(estimate))


def _prior(estimate: Estimate) -> Mapping[str, float] | None:
    estimated = [symbol for symbol in estimate.coefficient_set.symbols if symbol in estimate.state]
    settings = estimate.experiment
    if settings.identification.prior.from_estimate is None:
        priors = coefficient_priors(settings.vehicle, settings.identification.prior)
        return estimate.held | {symbol: priors[symbol].mean for symbol in estimated}
    if estimate.in_one_batch:
        return None
    # The first measurements hold no information on coefficients: the first mean is that of the prior.
    return estimate.held | {symbol: float(estimate.mean[0, estimate.state.index(symbol)]) for symbol in estimated}


# Vehicles whose known parameters the drawn models have.
_VEHICLES = 10


class Draws(NamedTuple):
    """Models drawn from the uncertainty of an estimate."""

    coefficients: Array  # shape (count, 22 + terms); SI
    # Shape (count, 5); differences of thrust, fins and ballast from the identified model, in the order of `NO_ERRORS`
    errors: Array
    parameters: tuple[dict[str, float], ...]


def drawn_models(
    estimate: Estimate, count: int, rng: np.random.Generator, left_out: Collection[str] = ()
) -> Draws | None:
    """Return models drawn from the final mean and covariance of an estimate; None without a valid covariance.

    Thrust, fins, ballast and known parameters are drawn with the coefficients, because they are often confounded: a
    coefficient is more certain given the ballast or the inertia. Those with symbols in `left_out` differ in each run
    and are not drawn. Several models share the parameters of one of a few vehicles, which saves time.
    """
    symbols, final = estimate.coefficient_set.symbols, estimate.final_coefficients()
    estimated = [error.symbol in estimate.state and error.symbol not in left_out for error in VEHICLE_ERRORS]
    drawn_errors = [error for error, is_drawn in zip(VEHICLE_ERRORS, estimated, strict=True) if is_drawn]
    error_rows = [estimate.state.index(error.symbol) for error in drawn_errors]
    rows, n = [*estimate.coefficient_rows, *error_rows], len(estimate.coefficient_rows)
    drawn = np.tile([final[symbol] for symbol in symbols], (count, 1))
    covariance = estimate.data_covariance()[np.ix_(rows, rows)]
    variance = np.diagonal(covariance)
    if not (np.isfinite(covariance).all() and (variance > 0.0).all()):
        return None
    # Normalised, because coefficients differ by orders of magnitude.
    deviation = np.sqrt(variance)
    try:
        factor = np.linalg.cholesky(covariance / np.outer(deviation, deviation))
    except np.linalg.LinAlgError:
        return None
    difference = deviation * (rng.standard_normal((count, len(rows))) @ factor.T)
    drawn[:, [symbols.index(estimate.state[i]) for i in rows[:n]]] += difference[:, :n]
    errors = np.zeros((count, len(VEHICLE_ERRORS)))
    errors[:, estimated] = difference[:, n:]
    # The stated force is already multiplied by the estimated scale.
    errors[:, 0] /= estimate.final_actuators().thrust
    parameters = _add_considered(estimate, drawn, errors, rng)
    return Draws(drawn, errors, parameters)


def _add_considered(
    estimate: Estimate, drawn: Array, errors: Array, rng: np.random.Generator
) -> tuple[dict[str, float], ...]:
    """Add considered errors to coefficients, shape (count, n), and thrust; return those of known parameters."""
    count, considered = len(drawn), estimate.considered
    if considered is None:
        return ({},) * count
    vehicles = considered.draw(min(_VEHICLES, count), rng)
    sizes = vehicles[np.arange(count) * len(vehicles) // count]
    symbols = estimate.coefficient_set.symbols
    for row in estimate.coefficient_rows:
        drawn[:, symbols.index(estimate.state[row])] += sizes @ considered.effect[row]
    parameters: tuple[dict[str, float], ...] = tuple({} for _ in range(count))
    for k, fault in enumerate(considered.faults):
        if fault.kind is FaultKind.THRUST_SCALE:
            errors[:, 0] += sizes[:, k]
        elif fault.kind is FaultKind.FIN_SCALE:
            of_fin = [c for c, each in enumerate(estimate.coefficient_set) if fault.component in each.signals]
            drawn[:, of_fin] *= 1.0 + sizes[:, k : k + 1]
        elif fault.kind is FaultKind.HELD_COEFFICIENT:
            drawn[:, symbols.index(fault.component)] += sizes[:, k]
        elif symbol := fault.parameter:
            for own, size in zip(parameters, sizes[:, k].tolist(), strict=True):
                own[symbol] = size
    return parameters
