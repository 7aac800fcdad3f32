"""The estimation problem of a dataset: prior, process and sensors of the augmented state; motions as starts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array, ArrayStore
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import STEPS_PER_TIME_CONSTANT
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import ConfigError, DataError
from auvid_cli.filters.linear_smoother import Trajectory
from auvid_cli.filters.problem import Gaussian, Indices, JointProblem, Process, Sensors, joint_gaussian, segment_indices
from auvid_cli.filters.smoother_forward import THRESHOLD
from auvid_cli.identification.compiled_layout import NOT_USED, KnownSensor, KnownSensors
from auvid_cli.identification.prepared_data import PreparedData, Segment
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.states import StateLayout, earlier_gaussian, refuse_simulated, state_layout
from auvid_cli.identification.timeline import measurement_model
from auvid_cli.vehicle.coefficients import CoefficientSet
from auvid_cli.vehicle.equations import vehicle_constants
from auvid_cli.vehicle.rigid_body import rotation_matrix


def initial_gaussian(layout: StateLayout, parameters: Gaussian, measured: Mapping[str, float]) -> Gaussian:
    """Return the prior of the augmented state: that of the parameters, and moving states as first measured.

    Parameters
    ----------
    layout : StateLayout
    parameters : Gaussian
        Prior of coefficients and constant errors, in scaled units.
    measured : mapping
        First measurements by symbol, SI; the velocity is that over ground.

    Returns
    -------
    Gaussian
        If a current is a state, the velocity is that over ground minus the current, and correlated with it.
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
    to_body = rotation_matrix(mean[layout.rows(("phi", "theta", "psi"))]).T[:, :2]
    velocity = layout.rows("uvw")
    mean[velocity] -= to_body @ mean[current]
    factor[velocity] -= to_body @ factor[current]
    triangle = np.linalg.qr(factor.T)[1]
    return Gaussian(mean, (triangle * np.sign(np.diagonal(triangle))[:, None]).T.copy())


@dataclass(frozen=True)
class AugmentedProblem:
    """Input of the filters, with coefficients as multiples of their prior standard deviations."""

    layout: StateLayout
    known: dict[str, float]  # known parameters of the vehicle by symbol, SI
    known_deviations: dict[str, float]  # their standard deviations, as far as the vehicle file states any
    held: dict[str, float]  # coefficients that are not estimated by symbol, SI
    coefficients: CoefficientSet  # all coefficients of the vehicle
    process: Process  # with the exact transition matrix
    sensors: Sensors
    measuring: dict[str, SensorRecord]  # records by name, in the order of `sensors`
    segments: tuple[Segment, ...]  # in time order
    prior: Gaussian  # prior of the joint state of the segments, see `auvid_cli.filters.problem`

    @property
    def places(self) -> list[Indices]:
        """Return the rows of the joint state that are the state of each segment."""
        return segment_indices(self.prior.mean.size, self.process.noise_density.size, len(self.segments))

    @property
    def joint(self) -> JointProblem:
        """Return the problem of all segments together."""
        return JointProblem(self.process, self.sensors, [segment.timelines for segment in self.segments], self.prior)

    @property
    def span(self) -> tuple[float, float]:
        """Return the first and the last time, s."""
        return self.segments[0].timelines.span[0], self.segments[-1].timelines.span[1]


def augmented_problem(prepared: PreparedData) -> AugmentedProblem:
    """Return the estimation problem of a dataset; its truth is not used.

    Raises
    ------
    ConfigError
        If a coefficient that is not estimated has no value.
    DataError
        If a sensor whose error is to be estimated is missing, the time constant of a disturbance is too short, an
        earlier estimate does not fit, or the prior is the truth of a simulation.
    FileError
        If the file of an earlier estimate is not readable.
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
        # Imported here because it takes long to compile, and few data need it.
        from auvid_cli.identification.sensors import linearise, observe, refuse_unknown

        refuse_unknown(name for name, is_nonlinear in zip(measuring, sensors.nonlinear, strict=True) if is_nonlinear)
        process = process._replace(observe=observe, linearise=linearise)
    parameters = _prior_of_parameters(layout, prepared)
    gaussians = [initial_gaussian(layout, parameters, segment.measured) for segment in prepared.segments]
    return AugmentedProblem(
        layout=layout,
        known=known,
        known_deviations=experiment.vehicle.parameters.deviations(),
        held=held,
        coefficients=coefficients,
        process=process,
        sensors=sensors,
        measuring=measuring,
        segments=prepared.segments,
        prior=joint_gaussian(gaussians, process.noise_density.size),
    )


def shortest_interval(measuring: dict[str, SensorRecord]) -> float:
    """Return the sampling interval of the fastest sensor, s."""
    return min(
        float(np.median(np.diff(record.time))) if record.time.size > 1 else np.inf for record in measuring.values()
    )


def _check_time_constants(layout: StateLayout, measuring: dict[str, SensorRecord]) -> None:
    """Refuse a disturbance that decays between two measurements."""
    interval = shortest_interval(measuring)
    for block in layout.blocks:
        if block.error is not None and block.error.time_constant < STEPS_PER_TIME_CONSTANT * interval:
            raise DataError(
                f"identification.estimate.disturbance: {block.name} has a time_constant of "
                f"{block.error.time_constant:g} s; expected at least {STEPS_PER_TIME_CONSTANT} times the interval of "
                f"the measurements, {interval:g} s"
            )


def _known_sensors(measuring: dict[str, SensorRecord]) -> KnownSensors:
    row = {name: number for number, name in enumerate(measuring)}
    accelerometer, magnetometer = measuring.get("accelerometer"), measuring.get("magnetic_field")
    return KnownSensors(
        NOT_USED if accelerometer is None else KnownSensor(row["accelerometer"], accelerometer.position),
        NOT_USED if magnetometer is None else KnownSensor(row["magnetic_field"], magnetometer.earth_field),
    )


def _prior_of_parameters(layout: StateLayout, prepared: PreparedData) -> Gaussian:
    """Return the prior of coefficients and constant errors in scaled units."""
    n, rows, settings = layout.n_parameters, layout.rows_of("coefficients"), prepared.experiment.identification.prior
    symbols = layout.symbols[rows]
    (block,) = (block for block in layout.blocks if block.name == "coefficients")
    refuse_simulated(prepared.dataset, dict(zip(symbols, block.prior_mean, strict=True)), settings.mean)
    parameters = Gaussian(layout.prior_mean[:n].copy(), np.diag(layout.prior_std[:n]))
    if settings.from_estimate is not None:
        parameters.mean[rows], parameters.factor[rows, rows] = earlier_gaussian(
            Path(settings.from_estimate), prepared.dataset, symbols, layout.scale[rows], parameters.mean[rows]
        )
    return parameters


def held_coefficients(experiment: RunSettings) -> dict[str, float]:
    """Return the coefficients that are not estimated by symbol, SI.

    Raises
    ------
    ConfigError
        If one has no value.
    """
    held = experiment.identification.fixed(experiment.vehicle)
    given = experiment.vehicle.stated_coefficients()
    if missing := [symbol for symbol in held if symbol not in given]:
        raise ConfigError(
            f"identification.coefficients leaves out {', '.join(missing)}: expected a value of each in the vehicle file"
        )
    return {symbol: given[symbol] for symbol in held}


class Motion(NamedTuple):
    """States of an estimate at some times: a start for the estimate of a similar model."""

    state: Sequence[str]  # symbols
    time: Array  # shape (n_events,); s
    mean: Array  # shape (n_events, n); SI

    @classmethod
    def of_estimate(cls, estimate: Estimate) -> "Motion":
        """Return the states of an estimate."""
        return cls(estimate.state, estimate.time, estimate.mean)

    @classmethod
    def of_trajectory(cls, augmented: AugmentedProblem, trajectory: Trajectory) -> "Motion":
        """Return the states of a trajectory."""
        layout = augmented.layout
        moving = np.vstack([chunk for chunks in trajectory.moving for chunk in chunks])
        mean = np.hstack([np.tile(trajectory.parameters, (len(moving), 1)), moving]) * layout.scale
        time = np.concatenate([timeline.time for segment in augmented.segments for timeline in segment.timelines])
        return cls(layout.symbols, time, mean)

    def trajectory(self, augmented: AugmentedProblem) -> Trajectory:
        """Return the trajectory of a problem; unknown states are at the mean of its prior, others interpolated."""
        layout, n, prior = augmented.layout, augmented.layout.n_parameters, augmented.prior.mean
        known = [(row, self.state.index(symbol)) for row, symbol in enumerate(layout.symbols) if symbol in self.state]
        parameters, initial, moving = prior[:n].copy(), list[Array](), list[ArrayStore]()
        for row, column in known:
            if row < n:
                parameters[row] = self.mean[-1, column] / layout.scale[row]
        for segment, place in zip(augmented.segments, augmented.places, strict=True):
            moving.append(ArrayStore())
            for timeline in segment.timelines:
                states = np.tile(prior[place[n:]], (timeline.time.size, 1))
                for row, column in known:
                    if row >= n:
                        states[:, row - n] = np.interp(timeline.time, self.time, self.mean[:, column])
                        states[:, row - n] /= layout.scale[row]
                if not moving[-1]:
                    initial.append(states[0])
                moving[-1].append(states)
        return Trajectory(parameters, initial, moving)
