"""A dataset as an estimation problem: the augmented state, its prior, process, sensors and timeline."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import RunSettings
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.errors import ConfigError
from auvid_cli.filters.problem import Belief, Indices, Process, Sensors
from auvid_cli.filters.stretches import joint_belief, places
from auvid_cli.identification.biases import constant_errors, sensor_errors, walking_errors
from auvid_cli.identification.prior import earlier_belief, prior_standard_deviations
from auvid_cli.identification.process import vehicle_process
from auvid_cli.identification.segments import Stretch, stretches
from auvid_cli.identification.start import starting_belief
from auvid_cli.identification.timeline import DEPTH, PART, measurement_model, measuring_sensors
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.dynamics import vehicle_constants
from auvid_cli.vehicle.parameters import MOTION

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AugmentedProblem:
    """What filters are given, coefficients as multiples of their priors, and what it is in SI.

    Attributes
    ----------
    state, unit : tuple of str
        Symbols of the estimated coefficients, of constant sensor errors, of the nine motion states, of the depth where
        it is measured, and of walking sensor errors; SI units.
    scale : ndarray, shape (n,)
        SI value of one unit of each.
    held : dict
        Coefficients that are not estimated, SI.
    process : Process
        With the exact transition.
    sensors : Sensors
    measuring : dict of SensorRecord
        Records of these sensors by name, in their order.
    stretches : list of Stretch
        In time order.
    prior : Belief
        About the joint state of the stretches, see `auvid_cli.filters.stretches`.
    """

    state: tuple[str, ...]
    unit: tuple[str, ...]
    scale: Array
    held: dict[str, float]
    process: Process
    sensors: Sensors
    measuring: dict[str, SensorRecord]
    stretches: list[Stretch]
    prior: Belief

    @property
    def places(self) -> list[Indices]:
        """Where in the joint state the state of each stretch stands."""
        return places(self.prior.mean.size, self.process.noise_density.size, len(self.stretches))

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""
        return self.stretches[0].timelines.span[0], self.stretches[-1].timelines.span[1]


def augmented_problem(dataset: Dataset, part: int = PART) -> AugmentedProblem:
    """Set up the estimation of a dataset's coefficients; no truth is looked at.

    Parameters
    ----------
    dataset : Dataset
    part : int
        Most readings of one sensor that are worked on at once.

    Raises
    ------
    ConfigError
        If a coefficient that is to be held has no value.
    DataError
        If no sensor measures motion, a sensor whose error is asked for is missing, or an earlier estimate does not fit.
    FileError
        If an earlier estimate cannot be read.
    """
    experiment = dataset.experiment
    settings = experiment.identification
    estimated = settings.estimated()
    held = held_coefficients(experiment)
    errors = sensor_errors(settings.estimate)
    constant, walking = constant_errors(errors), walking_errors(errors)
    measuring = measuring_sensors(dataset)
    has_depth = "depth" in measuring
    units = {c.symbol: c.unit for c in COEFFICIENTS}
    blocks = [(symbol, units[symbol]) for symbol in estimated]
    blocks += [(error.symbol, error.unit) for error in constant]
    blocks += [(quantity.symbol, quantity.unit) for quantity in (*MOTION, *([DEPTH] * has_depth))]
    blocks += [(error.symbol, error.unit) for error in walking]
    state, unit = zip(*blocks, strict=True)
    priors = prior_standard_deviations(
        experiment.vehicle.size, settings.prior.factor, settings.prior.standard_deviation
    )
    scale = np.array([priors[symbol] for symbol in estimated])
    known, factor = np.zeros(len(estimated)), np.eye(len(estimated))
    if settings.prior.from_estimate is not None:
        known, factor = earlier_belief(Path(settings.prior.from_estimate), dataset, estimated, scale)
    parameters = Belief(
        np.concatenate([known, np.zeros(len(constant))]),
        np.diag([*np.zeros(len(estimated)), *(error.spread for error in constant)]),
    )
    parameters.factor[: len(estimated), : len(estimated)] = factor
    process = vehicle_process(
        vehicle_constants(experiment.vehicle.known_parameters()),
        np.array([held.get(symbol, 0.0) for symbol in SYMBOLS]),
        np.array([SYMBOLS.index(symbol) for symbol in estimated], dtype=np.int64),
        scale,
        settings.process_noise,
        errors,
        has_depth,
    )
    found = stretches(dataset, part)
    beliefs = [
        starting_belief(parameters, stretch.motion, stretch.depth, errors, settings.initial_motion) for stretch in found
    ]
    return AugmentedProblem(
        state=state,
        unit=unit,
        scale=np.concatenate([scale, np.ones(len(state) - len(estimated))]),
        held=held,
        process=process,
        sensors=measurement_model(measuring, state, errors, np.inf if settings.gate is None else settings.gate),
        measuring=measuring,
        stretches=found,
        prior=joint_belief(beliefs, process.noise_density.size),
    )


def held_coefficients(experiment: RunSettings) -> dict[str, float]:
    """Values, SI, of the coefficients that are not estimated.

    Raises
    ------
    ConfigError
        If the vehicle states none for one of them.
    """
    estimated = experiment.identification.estimated()
    given = experiment.vehicle.coefficients.by_symbol()
    missing = [symbol for symbol in SYMBOLS if symbol not in estimated and symbol not in given]
    if missing:
        raise ConfigError(
            f"identification.coefficients leaves out {', '.join(missing)}, so the vehicle file must state "
            "a value at which to hold each of them"
        )
    return {symbol: given[symbol] for symbol in SYMBOLS if symbol not in estimated}
