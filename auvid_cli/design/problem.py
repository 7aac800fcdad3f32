"""The design problem: parameters drawn from the prior, and requirements on their accuracy."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre, Envelope
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.estimate import Estimate
from auvid_cli.design.envelope import least_speed, with_margin
from auvid_cli.design.posterior import FilterAssumptions, filter_assumptions
from auvid_cli.design.trials import Criterion, Map, Trial, TrialSet, simulate_trial
from auvid_cli.design.variables import SearchSpace, baseline_spiral, search_space, standard_manoeuvres
from auvid_cli.errors import ConfigError, DataError, SimulationError
from auvid_cli.simulation.motion import Truth
from auvid_cli.vehicle.coefficients import DRAG_SYMBOLS

Array = NDArray[np.float64]
# Standard deviation of a value of a vehicle file that states none, as a share of it: with such vehicles the gains of a
# design were measured.
_SPREAD = 0.3
# Of vehicles that the search does not see.
HELD_OUT = 8
# Random streams: of the vehicles that are seen, of those that are not, and of those that the band of a track is from.
_SEEN, _UNSEEN, _BAND = 1, 2, 3
# Fisher information about the vehicle's coefficients, SI, shape (m, m), at values of them by symbol.
EarlierInformation = Callable[[Mapping[str, float]], Array]


class ParameterDistribution(NamedTuple):
    """What is known of the coefficients before a run.

    Attributes
    ----------
    symbols : tuple of str
    mean : ndarray, shape (m,)
        SI.
    covariance : ndarray, shape (m, m)
        Of the value, SI; where `logarithmic` of the logarithm of its size.
    logarithmic : ndarray of bool, shape (m,)
        Of those whose sign is sure.
    origin : str
        Where it comes from, in words.
    """

    symbols: tuple[str, ...]
    mean: Array
    covariance: Array
    logarithmic: NDArray[np.bool_]
    origin: str

    def draw(self, number: int, seed: Sequence[int]) -> list[dict[str, float]]:
        """Draw coefficients of so many vehicles, by symbol, SI."""
        random = np.random.default_rng(seed)
        values, directions = np.linalg.eigh(self.covariance)
        root = directions * np.sqrt(np.clip(values, 0.0, None))
        scatter = random.standard_normal((number, len(self.symbols))) @ root.T
        drawn = np.where(self.logarithmic, self.mean * np.exp(scatter * self.logarithmic), self.mean + scatter)
        return [dict(zip(self.symbols, row.tolist(), strict=True)) for row in drawn]


def distribution_from_estimate(estimate: Estimate, vehicle: VehicleSettings) -> ParameterDistribution:
    """Take what an estimate says; what it held is sure.

    Raises
    ------
    DataError
        If coefficients are neither in the estimate nor in the vehicle file.
    """
    symbols, known = vehicle.coefficient_set.symbols, vehicle.stated_coefficients() | estimate.final_coefficients()
    if missing := [symbol for symbol in symbols if symbol not in known]:
        raise DataError(f"neither the estimate nor the vehicle file has a value of {', '.join(missing)}")
    covariance = np.zeros((len(symbols), len(symbols)))
    estimated = [symbol for symbol in estimate.state if symbol in symbols]
    here, there = [symbols.index(symbol) for symbol in estimated], [estimate.state.index(name) for name in estimated]
    covariance[np.ix_(here, here)] = estimate.final_covariance()[np.ix_(there, there)]
    mean = np.array([known[symbol] for symbol in symbols])
    return ParameterDistribution(
        symbols, mean, covariance, np.zeros(len(symbols), dtype=bool), f"the estimate of {estimate.filter}"
    )


def distribution_from_vehicle(vehicle: VehicleSettings, spread: float | None) -> ParameterDistribution:
    """Take what a vehicle file says: its values, give or take what it states; where it has none, its shape.

    Parameters
    ----------
    vehicle : VehicleSettings
    spread : float or None
        Standard deviation as a share of each value of the file, instead of what it states.

    Raises
    ------
    ConfigError
        If it has neither a value of a coefficient nor a geometry.
    """
    stated, deviations = vehicle.stated_coefficients(), vehicle.stated_deviations()
    derived, symbols = {each.name: each for each in vehicle.derived_values()}, vehicle.coefficient_set.symbols
    if missing := [symbol for symbol in symbols if symbol not in stated and symbol not in derived]:
        raise ConfigError(
            f"vehicle {vehicle.name!r} says nothing of {', '.join(missing)}, so none like it can be drawn: name an "
            "estimate (--at FILE), describe hull and fins (vehicle.geometry), or state values"
        )
    mean, deviation, origins = np.zeros(len(symbols)), np.zeros(len(symbols)), dict[str, None]()
    for place, symbol in enumerate(symbols):
        if symbol not in stated:
            mean[place], deviation[place] = derived[symbol].mean, derived[symbol].standard_deviation
            origins["what follows from hull and fins"] = None
            continue
        mean[place] = stated[symbol]
        if spread is None and symbol in deviations:
            deviation[place] = deviations[symbol]
            origins["the standard deviations of the vehicle file"] = None
        else:
            share = _SPREAD if spread is None else spread
            deviation[place] = share * abs(mean[place])
            origins[f"{share:.0%} of the vehicle file's values"] = None
    share = np.divide(deviation, np.abs(mean), out=np.full(mean.size, np.inf), where=mean != 0.0)
    damping = np.array([symbol in DRAG_SYMBOLS for symbol in symbols])
    logarithmic = (mean != 0.0) & (damping | (share < 1.0))
    # Of a lognormal number whose median is the mean.
    variance = np.where(logarithmic, np.log1p(np.where(logarithmic, share, 0.0) ** 2), deviation**2)
    return ParameterDistribution(symbols, mean, np.diag(variance), logarithmic, " and ".join(origins))


def draw_vehicles(
    vehicle: VehicleSettings, belief: ParameterDistribution, number: int, seed: Sequence[int]
) -> list[VehicleSettings]:
    """Draw so many vehicles, alike in all but their coefficients."""
    return [vehicle.with_coefficients(drawn) for drawn in belief.draw(number, seed)]


class Requirement(NamedTuple):
    """What somebody wants designed.

    Attributes
    ----------
    duration : float
        s.
    envelope : Envelope
    fin_angle, fin_rate : float or None
        rad, rad/s; else the experiment's.
    chosen : tuple of str
        Coefficients that count.
    criterion : {"D", "worst"}
    draws : int
        Vehicles that the search sees.
    spread : float or None
        See `distribution_from_vehicle`.
    """

    duration: float
    envelope: Envelope
    fin_angle: float | None
    fin_rate: float | None
    chosen: tuple[str, ...]
    criterion: Criterion
    draws: int
    spread: float | None


class DesignProblem(NamedTuple):
    """All that a search needs, and what its result is judged by.

    Attributes
    ----------
    experiment : Experiment
    wish : Wish
    belief : Belief
    knowledge : Knowledge
    chosen : tuple of str
        Coefficients that count.
    nominal : VehicleSettings
        The vehicle as it is believed to be.
    space : SearchSpace
    slowest : float
        m/s.
    seen, unseen : Bench
        Vehicles of the search, in an envelope with a margin, and those that its result is judged by.
    usual : dict of Trial
        What is usually sailed, on the vehicles that are seen: ``spiral``, which is the experiment's own, ``doublets``,
        ``zigzag``.
    """

    experiment: Experiment
    requirement: Requirement
    distribution: ParameterDistribution
    assumptions: FilterAssumptions
    chosen: tuple[str, ...]
    nominal: VehicleSettings
    space: SearchSpace
    slowest: float
    search_set: TrialSet
    held_out_set: TrialSet
    standard_trials: dict[str, Trial]

    @property
    def spiral_trial(self) -> Trial:
        """Return the trial of the experiment's own manoeuvre."""
        return self.standard_trials["spiral"]

    def gain_over_spiral(self, trial: Trial) -> float:
        """Return how many times smaller standard deviations are than after the own manoeuvre, on the seen vehicles."""
        return trial.mean_gain_over(self.spiral_trial)


def make_problem(
    experiment: Experiment,
    requirement: Requirement,
    estimate: Estimate | None = None,
    earlier_information: EarlierInformation | None = None,
    map_function: Map = map,
) -> DesignProblem:
    """Draw vehicles and lay out what a search may vary.

    Parameters
    ----------
    experiment : Experiment
    wish : Wish
    estimate : Estimate, optional
        Of an earlier run: vehicles are drawn from it.
    in_hand : callable, optional
        What earlier data say of the coefficients, see `EarlierInformation`.
    spread : callable
        As `map`, see `TrialSet`.

    Raises
    ------
    ConfigError, DataError
        If the experiment's manoeuvre is no spiral, no vehicles can be drawn, or limits exclude each other.
    """
    vehicle, envelope = experiment.vehicle, requirement.envelope
    own = baseline_spiral(experiment, requirement.duration, requirement.fin_angle, requirement.fin_rate)
    slowest = least_speed(envelope, own)
    estimated = experiment.identification.estimated(vehicle)
    if odd := [symbol for symbol in requirement.chosen if symbol not in estimated]:
        raise ConfigError(f"--for {odd[0]}: is not estimated in this experiment; there are {', '.join(estimated)}")
    belief = (
        distribution_from_vehicle(vehicle, requirement.spread)
        if estimate is None
        else distribution_from_estimate(estimate, vehicle)
    )
    mean = dict(zip(belief.symbols, belief.mean.tolist(), strict=True))
    known, chosen = None if earlier_information is None else earlier_information(mean), requirement.chosen or estimated
    knowledge = filter_assumptions(experiment, known)

    def bench(number: int, stream: int, limits: Envelope, least: float) -> TrialSet:
        vehicles = draw_vehicles(vehicle, belief, number, [experiment.seed, stream])
        return TrialSet(vehicles, knowledge, chosen, requirement.criterion, limits, least, map_function)

    seen = bench(requirement.draws, _SEEN, *with_margin(envelope, slowest))
    usual = {"spiral": own, **standard_manoeuvres(own, vehicle.size.length)}
    return DesignProblem(
        experiment,
        requirement,
        belief,
        knowledge,
        chosen,
        vehicle.with_coefficients(mean),
        search_space(own, vehicle.size.length, -belief.mean[belief.symbols.index("X_u|u|")], envelope),
        slowest,
        seen,
        bench(HELD_OUT, _UNSEEN, envelope, slowest),
        {name: seen.evaluate(manoeuvre) for name, manoeuvre in usual.items()},
    )


def simulate_draws(task: DesignProblem, manoeuvre: AnyManoeuvre, number: int = 40) -> list[Truth]:
    """Let so many further vehicles sail a manoeuvre; those that are lost are left out."""
    runs = []
    for vehicle in draw_vehicles(task.experiment.vehicle, task.distribution, number, [task.experiment.seed, _BAND]):
        try:
            runs.append(simulate_trial(vehicle, manoeuvre))
        except SimulationError:
            continue
    return runs
