"""The design problem: variables of the search, parameters drawn from the prior, and requirements on their accuracy."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre, Autopilot, Doublets, Envelope, Excitation, Spiral, Zigzag
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.estimate import Estimate
from auvid_cli.design.posterior import FilterAssumptions, filter_assumptions
from auvid_cli.design.trials import Criterion, Map, Trial, TrialSet, least_speed, simulate_trial, with_margin
from auvid_cli.errors import ConfigError, DataError, SimulationError
from auvid_cli.simulation.motion import Truth
from auvid_cli.vehicle.coefficients import DRAG_SYMBOLS
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

_MIN_DURATION = 20.0  # s
# A fin signal may exceed the fin limit; a slow vehicle is then excited more by the clipped signal.
_MAX_FIN_RATIO = 1.7  # amplitude relative to the limit of the fin
_MAX_THRUST_RATIO = 0.5  # amplitude relative to the thrust at cruise
_MAX_PITCH_RATIO = 0.8  # pitch as a share of the limit of the envelope
# Relative to speed divided by length.
_MAX_TURN_RATE = 0.3  # rad
_MAX_LOWEST = 0.2
_MAX_HIGHEST = 0.8
_BANDWIDTHS = (0.2, 3.0)
_LINES = 9  # spectral lines of each signal
_DIGITS = 6
_DEFAULT_SPREAD = 0.3  # standard deviation of a value whose file states none, as a share of it
HELD_OUT = 8  # vehicles that judge the result and are not part of the search
# Random streams of the drawn vehicles.
_SEARCH_STREAM = 1
_HELD_OUT_STREAM = 2
_BAND_STREAM = 3
# From values of the coefficients by symbol to the Fisher information about them, SI, shape (m, m).
EarlierInformation = Callable[[Mapping[str, float]], Array]


class Variable(NamedTuple):
    """A setting that varies within bounds, SI."""

    name: str  # path in the manoeuvre's settings
    low: float
    high: float
    logarithmic: bool = False  # whether equal steps are equal ratios

    def at(self, place: float) -> float:
        """Return the value at a place from 0 (`low`) to 1 (`high`)."""
        if self.logarithmic:
            value = self.low * (self.high / self.low) ** place
        else:
            value = self.low + (self.high - self.low) * place
        # Rounded, because the settings reject tiny numbers that are not 0.
        return round(float(value), _DIGITS)

    def place_of(self, value: float) -> float:
        """Return the place of the nearest value within the bounds."""
        if self.high <= self.low:
            return 0.0
        if self.logarithmic:
            place = np.log(max(value, self.low) / self.low) / np.log(self.high / self.low)
        else:
            place = (value - self.low) / (self.high - self.low)
        return float(np.clip(place, 0.0, 1.0))


class SearchSpace(NamedTuple):
    """Spirals around a base that differ in some variables."""

    base: Spiral  # the experiment's own, with the duration and the fin limits of the design
    variables: tuple[Variable, ...]

    def manoeuvre(self, places: Array) -> Spiral:
        """Return the manoeuvre at a point of the unit cube, shape (n,)."""
        at = {v.name: v.at(place) for v, place in zip(self.variables, places, strict=True)}
        channels = [name for name in INPUT_SYMBOLS if f"{name}.lowest" in at]
        narrowest = len(channels) / self.base.duration + 10.0**-_DIGITS
        excitation = dict[str, object]()
        for name in channels:
            lowest = at[f"{name}.lowest"]
            highest = round(max(at[f"{name}.highest"], lowest + narrowest), _DIGITS)
            amplitude = at[f"{name}.amplitude"]
            excitation[name] = {"amplitude": amplitude, "lowest": lowest, "highest": highest, "lines": _LINES}
        settings = {"fade_in": self.base.excitation.fade_in, "orthogonal": True, **excitation}
        changes = {
            "name": "designed",
            "turn_rate": at["turn_rate"],
            "pitch": at["pitch"],
            "autopilot": Autopilot(bandwidth=at["bandwidth"]),
            "excitation": Excitation.model_validate(settings),
        }
        return self.base.model_copy(update=changes)

    def start(self) -> Array:
        """Return the point of the unit cube nearest to the base."""
        base, values = self.base, dict[str, float]()
        values |= {"turn_rate": base.turn_rate, "pitch": base.pitch, "bandwidth": base.autopilot.bandwidth}
        for name, channel in zip(INPUT_SYMBOLS, base.excitation.channels(), strict=True):
            if channel is not None:
                values |= {f"{name}.{field}": getattr(channel, field) for field in ("amplitude", "lowest", "highest")}
        return np.array([v.place_of(values[v.name]) if v.name in values else 0.5 for v in self.variables])


def baseline_spiral(experiment: Experiment, duration: float, fin_angle: float | None, fin_rate: float | None) -> Spiral:
    """Return the spiral of an experiment with the duration, s, and fin limits, rad and rad/s, of the design.

    Raises
    ------
    ConfigError
        If the manoeuvre is not a spiral, or too short.
    """
    manoeuvre = experiment.manoeuvre
    if not isinstance(manoeuvre, Spiral):
        raise ConfigError(
            f"manoeuvre: type {manoeuvre.type}; expected a spiral, with which a design begins and is compared: "
            "--set manoeuvre=manoeuvres/spiral_remus100.yaml, or a similar one with the vehicle's own speed"
        )
    if duration < _MIN_DURATION:
        raise ConfigError(f"--duration {duration:g} s: expected at least {_MIN_DURATION:g} s")
    changed = {"fin_angle": fin_angle, "fin_rate": fin_rate}
    limits = manoeuvre.limits.model_copy(update={name: value for name, value in changed.items() if value is not None})
    # The manoeuvre keeps the limits of the vehicle's fins and propeller.
    fins, _, propeller = experiment.vehicle.actuators.actuators()
    feasible = {
        "fin_angle": min(limits.fin_angle, fins.saturation),
        "fin_rate": min(limits.fin_rate, fins.rate_limit),
        "surge_force": min(limits.surge_force, propeller.saturation),
    }
    limits = limits.model_copy(update=feasible)
    # A long fade-in would leave too little of a short run.
    fade_in = min(manoeuvre.excitation.fade_in, 0.25 * duration)
    excitation = manoeuvre.excitation.model_copy(update={"fade_in": fade_in})
    return manoeuvre.model_copy(update={"duration": duration, "limits": limits, "excitation": excitation})


def search_space(own: Spiral, length: float, drag: float, envelope: Envelope) -> SearchSpace:
    """Return the search space around a spiral.

    Parameters
    ----------
    length : float
        Length of the hull, m.
    drag : float
        Drag divided by the square of the speed, kg/m, for the thrust at cruise.
    """
    pace, thrust = own.speed / length, drag * own.speed**2
    pitch = _MAX_PITCH_RATIO * envelope.pitch
    roll = own.excitation.roll_moment
    surge = own.excitation.surge_force
    fins = _MAX_FIN_RATIO * own.limits.fin_angle
    amplitudes = {
        "rudder": fins,
        "elevator": fins,
        "surge_force": max(_MAX_THRUST_RATIO * thrust, surge.amplitude if surge else 0.0),
        # Only a spiral that excites roll shows that the vehicle can.
        "roll_moment": roll.amplitude if roll else 0.0,
    }
    lowest = 2.0 / own.duration
    bands = [
        variable
        for name, amplitude in amplitudes.items()
        if amplitude > 0.0
        for variable in (
            Variable(f"{name}.amplitude", 0.0, amplitude),
            Variable(f"{name}.lowest", lowest, max(_MAX_LOWEST * pace, 2.0 * lowest), logarithmic=True),
            Variable(f"{name}.highest", 2.0 * lowest, max(_MAX_HIGHEST * pace, 4.0 * lowest), logarithmic=True),
        )
    ]
    return SearchSpace(
        own,
        (
            Variable("turn_rate", 0.0, _MAX_TURN_RATE * pace),
            Variable("pitch", -pitch, pitch),
            Variable("bandwidth", *_BANDWIDTHS, logarithmic=True),
            *bands,
        ),
    )


def standard_manoeuvres(own: Spiral, length: float) -> dict[str, AnyManoeuvre]:
    """Return 3-2-1-1 doublets and a zigzag with the same duration, speed and fin limits."""
    same = {"duration": own.duration, "speed": own.speed, "limits": own.limits}
    angle = min(own.limits.fin_angle, np.deg2rad(20.0))
    step = min(own.limits.fin_angle, np.deg2rad(8.0))
    # The pace of the shipped doublets, scaled to this vehicle.
    unit = 1.8 * length / own.speed
    doublets = Doublets(type="doublets", name="3-2-1-1", rudder=step, elevator=0.75 * step, unit_time=unit, **same)
    zigzag = Zigzag(type="zigzag", name="zigzag", rudder=angle, heading=float(np.deg2rad(20.0)), **same)
    return {"doublets": doublets, "zigzag": zigzag}


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
