"""The design problem: parameters drawn from the prior, and requirements on their accuracy."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre, Envelope
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.estimate import Estimate
from auvid_cli.design.posterior import FilterAssumptions, filter_assumptions
from auvid_cli.design.trials import Criterion, Map, Trial, TrialSet, least_speed, simulate_trial, with_margin
from auvid_cli.design.variables import SearchSpace, baseline_spiral, search_space, standard_manoeuvres
from auvid_cli.errors import ConfigError, DataError, SimulationError
from auvid_cli.simulation.motion import Truth
from auvid_cli.vehicle.coefficients import DRAG_SYMBOLS

_DEFAULT_SPREAD = 0.3  # standard deviation of a value whose file states none, as a share of it
HELD_OUT = 8  # vehicles that judge the result and are not part of the search
# Random streams of the drawn vehicles.
_SEARCH_STREAM = 1
_HELD_OUT_STREAM = 2
_BAND_STREAM = 3
# From values of the coefficients by symbol to the Fisher information about them, SI, shape (m, m).
EarlierInformation = Callable[[Mapping[str, float]], Array]


class ParameterDistribution(NamedTuple):
    """Distribution of the coefficients before a run."""

    symbols: tuple[str, ...]
    mean: Array  # shape (m,); mean of a normal coefficient, median of a lognormal one, SI
    # Shape (m, m); covariance of the values, SI, or of the logarithm of a lognormal coefficient's size
    covariance: Array
    logarithmic: NDArray[np.bool_]  # shape (m,); coefficients that are lognormal, because their sign is certain
    origin: str  # source of the distribution, in words

    def draw(self, number: int, seed: Sequence[int]) -> list[dict[str, float]]:
        """Draw the coefficients of `number` vehicles, by symbol, SI."""
        random = np.random.default_rng(seed)
        values, directions = np.linalg.eigh(self.covariance)
        root = directions * np.sqrt(np.clip(values, 0.0, None))
        scatter = random.standard_normal((number, len(self.symbols))) @ root.T
        drawn = np.where(self.logarithmic, self.mean * np.exp(scatter * self.logarithmic), self.mean + scatter)
        return [dict(zip(self.symbols, row.tolist(), strict=True)) for row in drawn]


def distribution_from_estimate(estimate: Estimate, vehicle: VehicleSettings) -> ParameterDistribution:
    """Return the distribution that an estimate reports; fixed coefficients do not vary.

    Raises
    ------
    DataError
        If a coefficient is neither in the estimate nor in the vehicle file.
    """
    symbols = vehicle.coefficient_set.symbols
    values = vehicle.stated_coefficients() | estimate.final_coefficients()
    if missing := [symbol for symbol in symbols if symbol not in values]:
        raise DataError(f"neither the estimate nor the vehicle file has a value of {', '.join(missing)}")
    estimated = [symbol for symbol in estimate.state if symbol in symbols]
    rows, states = [symbols.index(symbol) for symbol in estimated], [estimate.state.index(name) for name in estimated]
    covariance = np.zeros((len(symbols), len(symbols)))
    covariance[np.ix_(rows, rows)] = estimate.final_covariance()[np.ix_(states, states)]
    mean = np.array([values[symbol] for symbol in symbols])
    normal = np.zeros(len(symbols), dtype=bool)
    return ParameterDistribution(symbols, mean, covariance, normal, f"the estimate of {estimate.filter}")


def distribution_from_vehicle(vehicle: VehicleSettings, spread: float | None) -> ParameterDistribution:
    """Return the distribution of a vehicle file: values with their standard deviations, others from hull and fins.

    Parameters
    ----------
    spread : float or None
        Standard deviation as a share of each value of the file. None: the one that the file states.

    Raises
    ------
    ConfigError
        If there is neither a value of a coefficient nor a geometry.
    """
    stated, deviations = vehicle.stated_coefficients(), vehicle.stated_deviations()
    derived, symbols = {value.name: value for value in vehicle.derived_values()}, vehicle.coefficient_set.symbols
    if missing := [symbol for symbol in symbols if symbol not in stated and symbol not in derived]:
        raise ConfigError(
            f"vehicle {vehicle.name!r}: no value of {', '.join(missing)}; expected one to draw vehicles from: name an "
            "estimate (--at FILE), describe hull and fins (vehicle.geometry), or state values"
        )
    mean, deviation, origins = np.zeros(len(symbols)), np.zeros(len(symbols)), dict[str, None]()
    for k, symbol in enumerate(symbols):
        if symbol not in stated:
            mean[k], deviation[k] = derived[symbol].mean, derived[symbol].standard_deviation
            origins["values derived from hull and fins"] = None
            continue
        mean[k] = stated[symbol]
        if spread is None and symbol in deviations:
            deviation[k] = deviations[symbol]
            origins["the standard deviations of the vehicle file"] = None
        else:
            share = _DEFAULT_SPREAD if spread is None else spread
            deviation[k] = share * abs(mean[k])
            origins[f"the vehicle file's values (standard deviation {100.0 * share:.0f} %)"] = None
    share = np.divide(deviation, np.abs(mean), out=np.full(mean.size, np.inf), where=mean != 0.0)
    damping = np.array([symbol in DRAG_SYMBOLS for symbol in symbols])
    logarithmic = (mean != 0.0) & (damping | (share < 1.0))
    variance = np.where(logarithmic, np.log1p(np.where(logarithmic, share, 0.0) ** 2), deviation**2)
    return ParameterDistribution(symbols, mean, np.diag(variance), logarithmic, " and ".join(origins))


def draw_vehicles(
    vehicle: VehicleSettings, distribution: ParameterDistribution, number: int, seed: Sequence[int]
) -> list[VehicleSettings]:
    """Draw `number` vehicles that differ only in their coefficients."""
    return [vehicle.with_coefficients(drawn) for drawn in distribution.draw(number, seed)]


class Requirement(NamedTuple):
    """Requirements on a designed run."""

    duration: float  # s
    envelope: Envelope
    fin_angle: float | None  # limit of the fin angle, rad; none: that of the experiment
    fin_rate: float | None  # limit of the fin rate, rad/s; none: that of the experiment
    chosen: tuple[str, ...]  # coefficients that count; all if empty
    criterion: Criterion
    draws: int  # number of vehicles in the search
    spread: float | None  # see `distribution_from_vehicle`


class DesignProblem(NamedTuple):
    """Input of a search, and the vehicles that judge its result."""

    experiment: Experiment
    requirement: Requirement
    distribution: ParameterDistribution
    assumptions: FilterAssumptions
    chosen: tuple[str, ...]  # coefficients that count
    nominal: VehicleSettings  # the vehicle with the mean coefficients
    space: SearchSpace
    slowest: float  # least speed, m/s
    search_set: TrialSet  # vehicles of the search, in an envelope with a margin
    held_out_set: TrialSet  # vehicles that judge the result
    # Standard manoeuvres on the vehicles of the search: ``spiral`` (the experiment's own), ``doublets``, ``zigzag``
    standard_trials: dict[str, Trial]

    @property
    def spiral_trial(self) -> Trial:
        """Return the trial of the experiment's own manoeuvre."""
        return self.standard_trials["spiral"]

    def gain_over_spiral(self, trial: Trial) -> float:
        """Return the ratio of the spiral's standard deviations to the trial's, mean over the vehicles of the search."""
        return trial.mean_gain_over(self.spiral_trial)


def make_problem(
    experiment: Experiment,
    requirement: Requirement,
    estimate: Estimate | None = None,
    earlier_information: EarlierInformation | None = None,
    map_function: Map = map,
) -> DesignProblem:
    """Draw vehicles, define the search space, and try the standard manoeuvres.

    Parameters
    ----------
    estimate : Estimate, optional
        Estimate of an earlier run, from which vehicles are drawn.
    earlier_information : callable, optional
        Information of earlier data about the coefficients, see `EarlierInformation`.
    map_function : callable
        Like `map`, see `TrialSet`.

    Raises
    ------
    ConfigError, DataError
        If the experiment's manoeuvre is not a spiral, no vehicles can be drawn, or limits exclude each other.
    """
    vehicle, envelope = experiment.vehicle, requirement.envelope
    spiral = baseline_spiral(experiment, requirement.duration, requirement.fin_angle, requirement.fin_rate)
    slowest = least_speed(envelope, spiral)
    estimated = experiment.identification.estimated(vehicle)
    if unknown := [symbol for symbol in requirement.chosen if symbol not in estimated]:
        raise ConfigError(f"--for {unknown[0]}: not estimated in this experiment; expected {', '.join(estimated)}")
    if estimate is None:
        distribution = distribution_from_vehicle(vehicle, requirement.spread)
    else:
        distribution = distribution_from_estimate(estimate, vehicle)
    mean = dict(zip(distribution.symbols, distribution.mean.tolist(), strict=True))
    assumptions = filter_assumptions(experiment, None if earlier_information is None else earlier_information(mean))
    chosen = requirement.chosen or estimated

    def trial_set(number: int, stream: int, limits: Envelope, least: float) -> TrialSet:
        vehicles = draw_vehicles(vehicle, distribution, number, [experiment.seed, stream])
        return TrialSet(vehicles, assumptions, chosen, requirement.criterion, limits, least, map_function)

    search_set = trial_set(requirement.draws, _SEARCH_STREAM, *with_margin(envelope, slowest))
    standard = {"spiral": spiral, **standard_manoeuvres(spiral, vehicle.size.length)}
    return DesignProblem(
        experiment,
        requirement,
        distribution,
        assumptions,
        chosen,
        vehicle.with_coefficients(mean),
        search_space(spiral, vehicle.size.length, -mean["X_u|u|"], envelope),
        slowest,
        search_set,
        trial_set(HELD_OUT, _HELD_OUT_STREAM, envelope, slowest),
        {name: search_set.evaluate(manoeuvre) for name, manoeuvre in standard.items()},
    )


def simulate_draws(problem: DesignProblem, manoeuvre: AnyManoeuvre, number: int = 40) -> list[Truth]:
    """Simulate a manoeuvre with `number` other vehicles; lost ones are left out."""
    seed, runs = [problem.experiment.seed, _BAND_STREAM], []
    for vehicle in draw_vehicles(problem.experiment.vehicle, problem.distribution, number, seed):
        try:
            runs.append(simulate_trial(vehicle, manoeuvre))
        except SimulationError:
            continue
    return runs
