"""The filter's problem for a vehicle: initial state, process, sensors and inputs."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import STEPS_PER_TIME_CONSTANT
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.filters.problem import Gaussian, Indices, JointProblem, Process, Sensors, joint_gaussian, segment_indices
from auvid_cli.filters.smoother_forward import THRESHOLD
from auvid_cli.identification.compiled_layout import NOT_USED, KnownSensor, KnownSensors
from auvid_cli.identification.prepared_data import PreparedData, Segment
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.states import (
    StateLayout,
    coefficient_priors,
    earlier_gaussian,
    refuse_simulated,
    state_layout,
)
from auvid_cli.identification.timeline import measurement_model
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.equations import vehicle_constants
from auvid_cli.vehicle.kinematics import rotation_matrix


def initial_gaussian(layout: StateLayout, parameters: Gaussian, measured: Mapping[str, float]) -> Gaussian:
    """Join what is known of the parameters with the moving states as they were measured first.

    Parameters
    ----------
    layout : StateLayout
    parameters : Gaussian
        Scaled coefficients and constant errors.
    measured : mapping
        What sensors measured first, by symbol, SI; the velocity is that over ground.

    Returns
    -------
    Gaussian
        Where a current is a state, the velocity is that over ground less the current, and as unsure as that.
    """
    n = layout.n_parameters
    mean, factor = np.zeros(layout.prior_std.size), np.diag(layout.prior_std)
    mean[:n], factor[:n, :n] = parameters.mean, parameters.factor
    for block in layout.blocks:
        if block.starts_as_measured:
            mean[layout.rows_of(block.name)] = [measured[quantity.symbol] for quantity in block.quantities]
    current = layout.rows_of("current")
    if current.start == current.stop:
        return Gaussian(mean, factor)
    turn = rotation_matrix(mean[layout.rows(("phi", "theta", "psi"))]).T[:, :2]
    velocity = layout.rows("uvw")
    mean[velocity] -= turn @ mean[current]
    factor[velocity] -= turn @ factor[current]
    triangle = np.linalg.qr(factor.T)[1]
    return Gaussian(mean, (triangle * np.sign(np.diagonal(triangle))[:, None]).T.copy())


@dataclass(frozen=True)
class AugmentedProblem:
    """What filters are given, coefficients as multiples of their priors, and what it is in SI.

    Attributes
    ----------
    layout : StateLayout
    known : dict
        Known parameters of the vehicle, SI.
    held : dict
        Coefficients that are not estimated, SI.
    coefficients : CoefficientSet
        Of the vehicle.
    process : Process
        With the exact transition.
    sensors : Sensors
    measuring : dict of SensorRecord
        Records of these sensors by name, in their order.
    segments : tuple of Segment
        In time order.
    prior : Gaussian
        About the joint state of the segments, see `auvid_cli.filters.problem`.
    """

    layout: StateLayout
    known: dict[str, float]
    held: dict[str, float]
    coefficients: CoefficientSet
    process: Process
    sensors: Sensors
    measuring: dict[str, SensorRecord]
    segments: tuple[Segment, ...]
    prior: Gaussian

    @property
    def places(self) -> list[Indices]:
        """Return where in the joint state the state of each segment stands."""
        return segment_indices(self.prior.mean.size, self.process.noise_density.size, len(self.segments))

    @property
    def joint(self) -> JointProblem:
        """Return what an estimator of all segments together is given."""
        return JointProblem(self.process, self.sensors, [segment.timelines for segment in self.segments], self.prior)

    @property
    def span(self) -> tuple[float, float]:
        """Return the first and the last time, s."""
        return self.segments[0].timelines.span[0], self.segments[-1].timelines.span[1]


def augmented_problem(prepared: PreparedData) -> AugmentedProblem:
    """Set up the estimation of a dataset's coefficients; no truth is looked at.

    Parameters
    ----------
    prepared : PreparedData

    Raises
    ------
    ConfigError
        If a coefficient that is to be held has no value.
    DataError
        If a sensor whose error is asked for is missing, a disturbance fades too soon to be seen, an earlier estimate
        does not fit, or the prior is the truth.
    FileError
        If an earlier estimate cannot be read.
    """
    experiment, measuring = prepared.experiment, prepared.measuring
    settings = experiment.identification
    held = held_coefficients(experiment)
    layout = state_layout(settings, experiment.vehicle, measuring)
    _check_time_constants(layout, measuring)
    known, coefficients = experiment.vehicle.known_parameters(), experiment.vehicle.coefficient_set
    constants = vehicle_constants(known, coefficients.terms)
    process = vehicle_process(constants, held, layout, _known_sensors(measuring), coefficients)
    sensors = measurement_model(
        measuring,
        layout,
        np.inf if settings.gate is None else settings.gate,
        THRESHOLD if settings.robust == "huber" else np.inf,
    )
    if sensors.nonlinear.any():
        # What it is compiled from takes long, and few data need it.
        from auvid_cli.identification.observation import linearise, observe

        process = process._replace(observe=observe, linearise=linearise)
    parameters = _prior_of_parameters(layout, prepared.dataset)
    gaussians = [initial_gaussian(layout, parameters, segment.measured) for segment in prepared.segments]
    return AugmentedProblem(
        layout=layout,
        known=known,
        held=held,
        coefficients=coefficients,
        process=process,
        sensors=sensors,
        measuring=measuring,
        segments=prepared.segments,
        prior=joint_gaussian(gaussians, process.noise_density.size),
    )


def shortest_interval(measuring: dict[str, SensorRecord]) -> float:
    """Return how often the sensor measures that does so most often, s."""
    return min(
        float(np.median(np.diff(record.time))) if record.time.size > 1 else np.inf for record in measuring.values()
    )


def _check_time_constants(layout: StateLayout, measuring: dict[str, SensorRecord]) -> None:
    """Refuse what fades so soon that little is left of it from one measurement to the next."""
    interval = shortest_interval(measuring)
    for block in layout.blocks:
        if block.error is not None and block.error.time_constant < STEPS_PER_TIME_CONSTANT * interval:
            raise DataError(
                f"identification.estimate.disturbance: {block.name} has a time_constant of "
                f"{block.error.time_constant:g} s, and measurements come every {interval:g} s; expected at least "
                f"{STEPS_PER_TIME_CONSTANT} times that"
            )


def _known_sensors(measuring: dict[str, SensorRecord]) -> KnownSensors:
    row = {name: number for number, name in enumerate(measuring)}
    force, field = measuring.get("accelerometer"), measuring.get("magnetic_field")
    return KnownSensors(
        NOT_USED if force is None else KnownSensor(row["accelerometer"], force.position),
        NOT_USED if field is None else KnownSensor(row["magnetic_field"], field.earth_field),
    )


def _prior_of_parameters(layout: StateLayout, dataset: Dataset) -> Gaussian:
    """Return the prior of the layout, and of the coefficients what the vehicle file or an earlier estimate says."""
    n, coefficients = layout.n_parameters, layout.rows_of("coefficients")
    parameters = Gaussian(np.zeros(n), np.diag(layout.prior_std[:n]))
    symbols, scale, settings = layout.symbols[coefficients], layout.scale[coefficients], dataset.experiment
    priors = coefficient_priors(settings.vehicle, settings.identification.prior)
    refuse_simulated(dataset, {symbol: priors[symbol] for symbol in symbols}, settings.identification.prior.mean)
    mean = np.array([priors[symbol].mean for symbol in symbols]) / scale
    parameters.mean[coefficients] = mean
    if (earlier := settings.identification.prior.from_estimate) is not None:
        known = earlier_gaussian(Path(earlier), dataset, symbols, scale, mean)
        parameters.mean[coefficients], parameters.factor[coefficients, coefficients] = known
    return parameters


def held_coefficients(experiment: RunSettings) -> dict[str, float]:
    """Return the values, SI, of the coefficients that are not estimated.

    Raises
    ------
    ConfigError
        If the vehicle states none for one of them.
    """
    held = experiment.identification.held(experiment.vehicle)
    given = experiment.vehicle.stated_coefficients()
    if missing := [symbol for symbol in held if symbol not in given]:
        raise ConfigError(
            f"identification.coefficients leaves out {', '.join(missing)}, so the vehicle file must state "
            "a value at which to hold each of them"
        )
    return {symbol: given[symbol] for symbol in held}
