"""A manoeuvre tried on many drawn vehicles: what it would tell of each, and whether it stays in its envelope."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.manoeuvre import AnyManoeuvre, Envelope
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.design.envelope import Extent, limit_excess, measure_extent
from auvid_cli.design.posterior import FilterAssumptions, predict_posterior
from auvid_cli.errors import SimulationError
from auvid_cli.identification.states import natural_magnitude
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import Truth, simulate_motion

Array = NDArray[np.float64]
Criterion = Literal["D", "worst"]

# Hz, and s: a torpedo's motion is slow, and a search tries it thousands of times.
RATE, _LONGEST_STEP = 20.0, 0.025
# How much the worst of the draws counts beside their mean.
_OF_THE_WORST = 0.2
# In units of a logarithm of a standard deviation: of a limit passed by 100 %, and of a vehicle that is lost.
_EXCESS, _LOST = 10.0, 100.0


class TrialRun(NamedTuple):
    """One vehicle under a manoeuvre.

    Attributes
    ----------
    percent : ndarray, shape (m,)
        Standard deviation of each coefficient after it, of its size; NaN where the vehicle is lost.
    extent : Extent or None
    """

    percent: Array
    extent: Extent | None


class Trial(NamedTuple):
    """A manoeuvre on all vehicles.

    Attributes
    ----------
    manoeuvre : AnyManoeuvre
    flights : list of TrialRun
    measure : ndarray, shape (n,)
        Logarithm of the standard deviation by the criterion, on each vehicle; infinite where it is lost.
    excess : list of dict
        On each vehicle the share by which each limit is passed.
    """

    manoeuvre: AnyManoeuvre
    runs: list[TrialRun]
    measure: Array
    excess: list[dict[str, float]]

    @property
    def n_lost(self) -> int:
        """Count the vehicles that capsize, stand on their nose or run away."""
        return sum(flight.extent is None for flight in self.runs)

    @property
    def n_outside(self) -> int:
        """Count the vehicles that are lost or leave the envelope."""
        return self.n_lost + sum(any(share > 0.0 for share in shares.values()) for shares in self.excess)

    @property
    def cost(self) -> float:
        """Return what a search minimises."""
        if self.n_lost:
            return _LOST * (1.0 + self.n_lost / len(self.runs))
        passed = np.array([sum(shares.values()) for shares in self.excess])
        measure = self.measure + _EXCESS * passed
        return float((1.0 - _OF_THE_WORST) * measure.mean() + _OF_THE_WORST * measure.max())

    def gain_over(self, other: "Trial") -> Array:
        """Return how many times smaller standard deviations are, by the criterion, on vehicles that both bring home."""
        both = np.isfinite(self.measure) & np.isfinite(other.measure)
        return np.exp(other.measure[both] - self.measure[both])

    def mean_gain_over(self, other: "Trial") -> float:
        """Return the geometric mean of these gains; NaN if no vehicle comes home from both."""
        gains = self.gain_over(other)
        return float(np.exp(np.log(gains).mean())) if gains.size else float("nan")

    def percent(self) -> Array:
        """Return the geometric mean of each coefficient's standard deviation over the vehicles that come home, %.

        0 of those that are held.
        """
        home = np.array([flight.percent for flight in self.runs if flight.extent is not None])
        if not home.size:
            return np.full(self.runs[0].percent.size, np.nan)
        with np.errstate(divide="ignore"):
            return np.exp(np.log(home).mean(axis=0))


# As the built-in `map`, perhaps by several threads or machines.
Map = Callable[[Callable[[Any], TrialRun], Iterable[Any]], Iterable[TrialRun]]


class TrialSet:
    """Vehicles on which manoeuvres are tried.

    Parameters
    ----------
    vehicles : sequence of VehicleSettings
    knowledge : Knowledge
    chosen : sequence of str
        Coefficients that count.
    criterion : {"D", "worst"}
        Mean of the logarithms of their standard deviations, or the largest.
    envelope : Envelope
    slowest : float
        m/s.
    spread : callable
        As `map`; the compiled core lets other threads run, and all that it is given can travel to other machines.
    """

    def __init__(
        self,
        vehicles: Sequence[VehicleSettings],
        knowledge: FilterAssumptions,
        chosen: Sequence[str],
        criterion: Criterion,
        envelope: Envelope,
        slowest: float,
        spread: Map = map,
    ) -> None:
        self._knowledge, self._criterion, self._envelope, self._slowest = knowledge, criterion, envelope, slowest
        self._chosen = [vehicles[0].coefficient_set.symbols.index(symbol) for symbol in chosen]
        self._vehicles = [(vehicle, sizes_of(vehicle)) for vehicle in vehicles]
        self._map = spread

    def evaluate(self, manoeuvre: AnyManoeuvre) -> Trial:
        """Let all vehicles sail a manoeuvre."""
        flights = list(self._map(partial(run_trial, manoeuvre=manoeuvre, knowledge=self._knowledge), self._vehicles))
        home = [flight.extent for flight in flights if flight.extent is not None]
        return Trial(
            manoeuvre,
            flights,
            np.array([self._measure(flight) for flight in flights]),
            [limit_excess(extent, self._envelope, self._slowest) for extent in home],
        )

    def _measure(self, flight: TrialRun) -> float:
        if flight.extent is None:
            return np.inf
        logarithms = np.log(flight.percent[self._chosen])
        return float(logarithms.mean() if self._criterion == "D" else logarithms.max())


def run_trial(drawn: tuple[VehicleSettings, Array], manoeuvre: AnyManoeuvre, knowledge: FilterAssumptions) -> TrialRun:
    """Let one vehicle, with the sizes of its coefficients, sail a manoeuvre, and say what that would tell.

    Raises
    ------
    SimulationError
        If rounding has the last word.
    """
    vehicle, sizes = drawn
    try:
        truth = simulate_trial(vehicle, manoeuvre)
    except SimulationError:
        return TrialRun(np.full(sizes.size, np.nan), None)
    posterior = predict_posterior(truth, knowledge)
    percent = 100.0 * posterior.deviation[-1] / sizes
    if not np.isfinite(percent).all():
        raise SimulationError(f"the covariance of {vehicle.name} was lost to rounding; state a narrower prior")
    return TrialRun(percent, measure_extent(truth, manoeuvre.excitation.fade_in))


def simulate_trial(vehicle: VehicleSettings, manoeuvre: AnyManoeuvre) -> Truth:
    """Simulate a manoeuvre at `RATE`, undisturbed.

    Raises
    ------
    SimulationError
        If the vehicle leaves the model's validity.
    """
    coarse = manoeuvre.model_copy(update={"input_rate": RATE})
    plan = make_plan(coarse)
    return simulate_motion(vehicle, coarse, plan, np.zeros((plan.time.size, 6)), _LONGEST_STEP)


def sizes_of(vehicle: VehicleSettings) -> Array:
    """Return what percentages are of: each coefficient's size, or where it is zero what it would be on a plain body."""
    values = vehicle.all_coefficients()
    return np.array([abs(values[c.symbol]) or natural_magnitude(c, vehicle.size) for c in vehicle.coefficient_set])
