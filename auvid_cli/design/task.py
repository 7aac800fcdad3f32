"""What is to be designed, and the vehicles that it is designed for and judged by."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.envelope import Envelope
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.estimate import Estimate
from auvid_cli.design.draws import Belief, belief_of_estimate, belief_of_vehicle, drawn_vehicles
from auvid_cli.design.envelope import least_speed, tightened
from auvid_cli.design.posterior import Knowledge, knowledge_of
from auvid_cli.design.trials import Bench, Criterion, Map, Trial, sail
from auvid_cli.design.variables import SearchSpace, candidates, own_manoeuvre, space_about
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.simulation.true_motion import Truth

Array = NDArray[np.float64]

# Of vehicles that the search does not see.
HELD_OUT = 8
# Random streams: of the vehicles that are seen, of those that are not, and of those that the band of a track is from.
_SEEN, _UNSEEN, _BAND = 1, 2, 3


# Fisher information about the vehicle's coefficients, SI, shape (m, m), at values of them by symbol.
InHand = Callable[[Mapping[str, float]], Array]


class Wish(NamedTuple):
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
        See `belief_of_vehicle`.
    """

    duration: float
    envelope: Envelope
    fin_angle: float | None
    fin_rate: float | None
    chosen: tuple[str, ...]
    criterion: Criterion
    draws: int
    spread: float | None


class Task(NamedTuple):
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
    wish: Wish
    belief: Belief
    knowledge: Knowledge
    chosen: tuple[str, ...]
    nominal: VehicleSettings
    space: SearchSpace
    slowest: float
    seen: Bench
    unseen: Bench
    usual: dict[str, Trial]

    @property
    def own(self) -> Trial:
        """Return the trial of the experiment's own manoeuvre."""
        return self.usual["spiral"]

    def gain_of(self, trial: Trial) -> float:
        """Return how many times smaller standard deviations are than after the own manoeuvre, on the seen vehicles."""
        return trial.mean_gain_over(self.own)


def set_task(
    experiment: Experiment,
    wish: Wish,
    estimate: Estimate | None = None,
    in_hand: InHand | None = None,
    spread: Map = map,
) -> Task:
    """Draw vehicles and lay out what a search may vary.

    Parameters
    ----------
    experiment : Experiment
    wish : Wish
    estimate : Estimate, optional
        Of an earlier run: vehicles are drawn from it.
    in_hand : callable, optional
        What earlier data say of the coefficients, see `InHand`.
    spread : callable
        As `map`, see `Bench`.

    Raises
    ------
    ConfigError, DataError
        If the experiment's manoeuvre is no spiral, no vehicles can be drawn, or limits exclude each other.
    """
    vehicle, envelope = experiment.vehicle, wish.envelope
    own = own_manoeuvre(experiment, wish.duration, wish.fin_angle, wish.fin_rate)
    slowest = least_speed(envelope, own)
    estimated = experiment.identification.estimated(vehicle)
    if odd := [symbol for symbol in wish.chosen if symbol not in estimated]:
        raise ConfigError(f"--for {odd[0]}: is not estimated in this experiment; there are {', '.join(estimated)}")
    belief = belief_of_vehicle(vehicle, wish.spread) if estimate is None else belief_of_estimate(estimate, vehicle)
    mean = dict(zip(belief.symbols, belief.mean.tolist(), strict=True))
    known, chosen = None if in_hand is None else in_hand(mean), wish.chosen or estimated
    knowledge = knowledge_of(experiment, known)

    def bench(number: int, stream: int, limits: Envelope, least: float) -> Bench:
        vehicles = drawn_vehicles(vehicle, belief, number, [experiment.seed, stream])
        return Bench(vehicles, knowledge, chosen, wish.criterion, limits, least, spread)

    seen = bench(wish.draws, _SEEN, *tightened(envelope, slowest))
    usual = {"spiral": own, **candidates(own, vehicle.size.length)}
    return Task(
        experiment,
        wish,
        belief,
        knowledge,
        chosen,
        vehicle.with_coefficients(mean),
        space_about(own, vehicle.size.length, -belief.mean[belief.symbols.index("X_u|u|")], envelope),
        slowest,
        seen,
        bench(HELD_OUT, _UNSEEN, envelope, slowest),
        {name: seen.try_out(manoeuvre) for name, manoeuvre in usual.items()},
    )


def band(task: Task, manoeuvre: AnyManoeuvre, number: int = 40) -> list[Truth]:
    """Let so many further vehicles sail a manoeuvre; those that are lost are left out."""
    runs = []
    for vehicle in drawn_vehicles(task.experiment.vehicle, task.belief, number, [task.experiment.seed, _BAND]):
        try:
            runs.append(sail(vehicle, manoeuvre))
        except SimulationError:
            continue
    return runs
