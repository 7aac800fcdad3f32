"""A manoeuvre tried on many drawn vehicles: accuracy after the run, and limits of the envelope."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from math import ceil, floor
from typing import Any, Literal, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.manoeuvre import AnyManoeuvre, Envelope, ManoeuvreSettings
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.design.posterior import FilterAssumptions, predict_posterior
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.identification.states import natural_magnitude
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import Truth, simulate_motion
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Criterion = Literal["D", "worst"]

# A torpedo moves slowly, and a search simulates it thousands of times.
RATE = 20.0  # Hz
_MAX_STEP = 0.025  # s
_WORST_WEIGHT = 0.2  # weight of the worst vehicle in the cost; the rest is the mean
# Penalties in units of the logarithm of a standard deviation.
_EXCESS_PENALTY = 10.0  # for a limit exceeded by 100 %
_LOSS_PENALTY = 100.0  # for a lost vehicle
_LEAST_SHARE_OF_CRUISE = 0.4  # default limit of the speed
_MARGIN = 0.05  # share of each limit kept in reserve, because vehicles that were not drawn may go further
_THRUST = INPUT_SYMBOLS.index("surge_force")
_UPPER_LIMITS = ("box", "depth", "pitch", "roll", "energy")
# Unit of each limit on the command line, and its size in SI.
_UNITS = {
    "box": ("m", 1.0),
    "depth": ("m", 1.0),
    "pitch": ("deg", np.pi / 180.0),
    "roll": ("deg", np.pi / 180.0),
    "speed": ("m/s", 1.0),
    "energy": ("kJ", 1e3),
}


class Extent(NamedTuple):
    """Extremes of a run, SI, one for each limit of an envelope; `speed` is the minimum."""

    box: float
    depth: float
    pitch: float
    roll: float
    speed: float
    energy: float


def least_speed(envelope: Envelope, manoeuvre: ManoeuvreSettings) -> float:
    """Return the lower limit of the speed, m/s.

    Raises
    ------
    ConfigError
        If the manoeuvre's own speed is not above it.
    """
    if envelope.speed is None:
        return _LEAST_SHARE_OF_CRUISE * manoeuvre.speed
    if envelope.speed >= manoeuvre.speed:
        raise ConfigError(
            f"the least speed of {envelope.speed:g} m/s is not below the {manoeuvre.speed:g} m/s of the manoeuvre: "
            "lower --speed, or go faster (--set manoeuvre.speed=...)"
        )
    return envelope.speed


def with_margin(envelope: Envelope, slowest: float) -> tuple[Envelope, float]:
    """Return a stricter envelope and least speed, m/s, so that vehicles that were not drawn keep the limits too."""
    stricter = {name: (1.0 - _MARGIN) * limit for name, limit in _upper_limits(envelope).items()}
    return envelope.model_copy(update=stricter), (1.0 + _MARGIN) * slowest


def _upper_limits(envelope: Envelope) -> dict[str, float]:
    limits = {name: getattr(envelope, name) for name in _UPPER_LIMITS}
    return {name: limit for name, limit in limits.items() if limit is not None}


def measure_extent(truth: Truth, fade_in: float) -> Extent:
    """Return the extremes of a run; the speed counts after `fade_in` s, and thrust in either direction costs energy."""
    ground = truth.position.max(axis=0) - truth.position.min(axis=0)
    after_start = truth.time >= min(fade_in, truth.time[-1])
    return Extent(
        float(ground[:2].max()),
        float(ground[2]),
        float(np.abs(truth.motion[:, 7]).max()),
        float(np.abs(truth.motion[:, 6]).max()),
        float(truth.motion[after_start, 0].min()),
        float(np.abs(truth.inputs[:-1, _THRUST] * truth.motion[:-1, 0]) @ np.diff(truth.time)),
    )


def limit_excess(extent: Extent, envelope: Envelope, slowest: float) -> dict[str, float]:
    """Return the share by which each limit is exceeded; 0 if it is kept."""
    shares = {name: getattr(extent, name) / limit - 1.0 for name, limit in _upper_limits(envelope).items()}
    shares["speed"] = 1.0 - extent.speed / slowest
    return {name: max(share, 0.0) for name, share in shares.items()}


def options_to_relax(extents: Sequence[Extent], envelope: Envelope, slowest: float) -> str:
    """Return the command-line options with limits that all these runs keep, for each limit that one exceeds."""
    options = []
    for name, (unit, size) in _UNITS.items():
        if any(limit_excess(extent, envelope, slowest).get(name) for extent in extents):
            values = [getattr(extent, name) / size for extent in extents]
            enough = floor(100.0 * min(values)) / 100.0 if name == "speed" else ceil(10.0 * max(values)) / 10.0
            options.append(f"--{name} '{enough:g} {unit}'")
    return ", ".join(options)


class TrialRun(NamedTuple):
    """A manoeuvre on one vehicle."""

    # Shape (m,); standard deviation of each coefficient after the run, % of its size; NaN if the vehicle is lost
    percent: Array
    extent: Extent | None  # none if the vehicle is lost


class Trial(NamedTuple):
    """A manoeuvre on all vehicles."""

    manoeuvre: AnyManoeuvre
    runs: list[TrialRun]
    # Shape (n,); logarithm of the standard deviation by the criterion, for each vehicle; infinite if it is lost
    measure: Array
    excess: list[dict[str, float]]  # for each vehicle that is not lost, the share by which each limit is exceeded

    @property
    def n_lost(self) -> int:
        """Return the number of vehicles that capsize, pitch to the vertical or run away."""
        return sum(run.extent is None for run in self.runs)

    @property
    def n_outside(self) -> int:
        """Return the number of vehicles that are lost or leave the envelope."""
        return self.n_lost + sum(any(share > 0.0 for share in shares.values()) for shares in self.excess)

    @property
    def cost(self) -> float:
        """Return the cost that a search minimises."""
        if self.n_lost:
            return _LOSS_PENALTY * (1.0 + self.n_lost / len(self.runs))
        measure = self.measure + _EXCESS_PENALTY * np.array([sum(shares.values()) for shares in self.excess])
        return float((1.0 - _WORST_WEIGHT) * measure.mean() + _WORST_WEIGHT * measure.max())

    def gain_over(self, other: "Trial") -> Array:
        """Return the ratio of the other trial's standard deviation to this one's, for vehicles lost in neither."""
        both = np.isfinite(self.measure) & np.isfinite(other.measure)
        return np.exp(other.measure[both] - self.measure[both])

    def mean_gain_over(self, other: "Trial") -> float:
        """Return the geometric mean of `gain_over`; NaN if there is no common vehicle."""
        gains = self.gain_over(other)
        return float(np.exp(np.log(gains).mean())) if gains.size else float("nan")

    def percent(self) -> Array:
        """Return the standard deviation of each coefficient, %, geometric mean over vehicles; 0 if it is fixed."""
        finished = np.array([run.percent for run in self.runs if run.extent is not None])
        if not finished.size:
            return np.full(self.runs[0].percent.size, np.nan)
        with np.errstate(divide="ignore"):
            return np.exp(np.log(finished).mean(axis=0))


# Like the built-in `map`, possibly on several threads or machines.
Map = Callable[[Callable[[Any], TrialRun], Iterable[Any]], Iterable[TrialRun]]


class TrialSet:
    """Vehicles on which manoeuvres are tried.

    Parameters
    ----------
    chosen : sequence of str
        Coefficients that count in the criterion.
    criterion : {"D", "worst"}
        Mean of the logarithms of their standard deviations, or the largest.
    slowest : float
        Least speed, m/s.
    map_function : callable
        Like `map`. The compiled core releases the lock of the interpreter, and all arguments can be pickled.
    """

    def __init__(
        self,
        vehicles: Sequence[VehicleSettings],
        assumptions: FilterAssumptions,
        chosen: Sequence[str],
        criterion: Criterion,
        envelope: Envelope,
        slowest: float,
        map_function: Map = map,
    ) -> None:
        self._assumptions, self._criterion, self._map = assumptions, criterion, map_function
        self._envelope, self._slowest = envelope, slowest
        self._chosen = [vehicles[0].coefficient_set.symbols.index(symbol) for symbol in chosen]
        self._vehicles = [(vehicle, sizes_of(vehicle)) for vehicle in vehicles]

    def evaluate(self, manoeuvre: AnyManoeuvre) -> Trial:
        """Simulate a manoeuvre with all vehicles and predict the accuracy after it."""
        work = partial(run_trial, manoeuvre=manoeuvre, assumptions=self._assumptions)
        runs = list(self._map(work, self._vehicles))
        extents = [run.extent for run in runs if run.extent is not None]
        excess = [limit_excess(extent, self._envelope, self._slowest) for extent in extents]
        return Trial(manoeuvre, runs, np.array([self._measure(run) for run in runs]), excess)

    def _measure(self, run: TrialRun) -> float:
        if run.extent is None:
            return np.inf
        logarithms = np.log(run.percent[self._chosen])
        return float(logarithms.mean() if self._criterion == "D" else logarithms.max())


def run_trial(
    drawn: tuple[VehicleSettings, Array], manoeuvre: AnyManoeuvre, assumptions: FilterAssumptions
) -> TrialRun:
    """Simulate a manoeuvre with one vehicle and predict the accuracy of its coefficients.

    Parameters
    ----------
    drawn : tuple of VehicleSettings and ndarray
        The vehicle and the sizes of its coefficients, see `sizes_of`.

    Raises
    ------
    SimulationError
        If rounding spoils the covariance.
    """
    vehicle, sizes = drawn
    try:
        truth = simulate_trial(vehicle, manoeuvre)
    except SimulationError:
        return TrialRun(np.full(sizes.size, np.nan), None)
    percent = 100.0 * predict_posterior(truth, assumptions).deviation[-1] / sizes
    if not np.isfinite(percent).all():
        raise SimulationError(f"{vehicle.name}: covariance lost to rounding; state a narrower prior")
    return TrialRun(percent, measure_extent(truth, manoeuvre.excitation.fade_in))


def simulate_trial(vehicle: VehicleSettings, manoeuvre: AnyManoeuvre) -> Truth:
    """Simulate a manoeuvre at `RATE` without disturbances.

    Raises
    ------
    SimulationError
        If the vehicle leaves the validity of the model.
    """
    coarse = manoeuvre.model_copy(update={"input_rate": RATE})
    plan = make_plan(coarse)
    return simulate_motion(vehicle, coarse, plan, np.zeros((plan.time.size, 6)), _MAX_STEP)


def sizes_of(vehicle: VehicleSettings) -> Array:
    """Return the size of each coefficient; for a coefficient of 0, its natural magnitude for this hull."""
    values = vehicle.all_coefficients()
    return np.array([abs(values[c.symbol]) or natural_magnitude(c, vehicle.size) for c in vehicle.coefficient_set])
