"""Search for the best manoeuvre, and the conclusion from it."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cma
import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.manoeuvre import AnyManoeuvre
from auvid_cli.design.envelope import options_to_relax, with_margin
from auvid_cli.design.posterior import Posterior, predict_posterior
from auvid_cli.design.problem import DesignProblem
from auvid_cli.design.trials import Trial, TrialSet, simulate_trial, sizes_of
from auvid_cli.design.variables import SearchSpace
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.simulation.motion import Truth

POPULATION, _FIRST_STEP = 12, 0.2
Array = NDArray[np.float64]
# Below this a design is not worth another run in the water.
WORTH_WHILE = 1.1
# Of a coefficient's size, %: what is known worse is named, and so are the worst three unless they are known well.
_BADLY, _WELL, _NAMED = 20.0, 1.0, 3
# So many times surer it has to be without the others for them to be what hides it; so much of its prior is left of one
# that hardly moves the vehicle.
_TOGETHER, _HARDLY = 2.0, 0.5
# Parts of a run after which it is said how much is known, and how many times as long it might be.
_PARTS, _LONGER = 4, (2.0, 4.0)


class SearchProgress(NamedTuple):
    """How far a search has come.

    Attributes
    ----------
    generation, evaluations : int
        Of manoeuvres, from 1.
    best : Trial
        So far.
    costs : tuple of tuple of float
        Of all manoeuvres that were tried, generation by generation: from them a search goes on.
    """

    generation: int
    evaluations: int
    best: Trial
    costs: tuple[tuple[float, ...], ...] = ()


def search(
    space: SearchSpace, bench: TrialSet, seed: int, before: tuple[tuple[float, ...], ...] = ()
) -> Iterator[SearchProgress]:
    """Look for better manoeuvres, generation by generation, without an end.

    Begins with the point nearest to the space's own manoeuvre. Where the search settles it begins anew about the best,
    as wide as at first. The same seed and number of generations give the same manoeuvre, interrupted or not.

    Parameters
    ----------
    space : SearchSpace
    bench : Bench
    seed : int
    before : tuple of tuple of float
        `SearchProgress.costs` of the same search, which was interrupted: how far that came is yielded first.
    """
    random = np.random.default_rng([seed, 1])
    options = {
        "bounds": [0.0, 1.0],
        "popsize": POPULATION,
        # Numbers from a generator of our own: its seed is that of all Python otherwise.
        "seed": np.nan,
        "randn": lambda *shape: random.standard_normal(shape),
        "verbose": -9,
        "verb_log": 0,
    }
    place = space.start()
    best = bench.evaluate(space.manoeuvre(place))
    least, costs = best.cost, list[tuple[float, ...]]()
    while True:
        strategy = cma.CMAEvolutionStrategy(place, _FIRST_STEP, options)
        while not strategy.stop():
            places = [np.asarray(each) for each in strategy.ask()]
            generation, trials = len(costs), list[Trial]()
            if generation < len(before):
                costs.append(before[generation])
            else:
                trials = [bench.evaluate(space.manoeuvre(each)) for each in places]
                costs.append(tuple(trial.cost for trial in trials))
            strategy.tell(places, list(costs[-1]))
            for k, cost in enumerate(costs[-1]):
                if cost < least:
                    least, place = cost, places[k]
                    best = trials[k] if trials else best
            if generation + 1 == len(before):
                best = bench.evaluate(space.manoeuvre(place))
            if generation + 1 >= len(before):
                yield SearchProgress(generation + 1, 1 + sum(map(len, costs)), best, tuple(costs))


class WeakCoefficient(NamedTuple):
    """A coefficient that stays badly known, %, and why."""

    symbol: str
    percent: float
    why: str


class Design(NamedTuple):
    """What came of a search.

    Attributes
    ----------
    manoeuvre : AnyManoeuvre
        To be sailed: the best of those that were tried, or the experiment's own where that is as good.
    chosen : str
        Which of the trials is its.
    gain : float
        Of the best one over the experiment's own: how many times smaller standard deviations are, geometric mean over
        vehicles that the search has not seen.
    trials : dict of Trial
        By name, on these vehicles: ``designed``, ``spiral``, ``doublets``, ``zigzag``.
    poor : tuple of Poor
        Of the manoeuvre that is chosen.
    truth : Truth
        Its motion with the vehicle as it is believed to be.
    posterior : Posterior
        Of that run.
    soonest : float or None
        After so many seconds of that run as much is known as the experiment's own tells in the whole; None if never.
    growth : tuple of (float, float)
        After so many seconds of that run the geometric mean of the standard deviations, %; last, of runs of its kind
        that are twice and four times as long, as far as they can be sailed.
    progress : SearchProgress
    symbols : tuple of str
        Of the coefficients.
    """

    manoeuvre: AnyManoeuvre
    chosen: str
    gain: float
    trials: dict[str, Trial]
    weak_coefficients: tuple[WeakCoefficient, ...]
    truth: Truth
    posterior: Posterior
    time_to_match: float | None
    accuracy_over_time: tuple[tuple[float, float], ...]
    progress: SearchProgress
    symbols: tuple[str, ...]

    @property
    def keeps_spiral(self) -> bool:
        """Return whether the experiment's own manoeuvre is to be sailed."""
        return self.chosen == "spiral"

    @property
    def is_worth_while(self) -> bool:
        """Return whether the best of those that were tried tells clearly more than the experiment's own."""
        return self.gain >= WORTH_WHILE


def conclude(task: DesignProblem, progress: SearchProgress) -> Design:
    """Compare the best of a search with what is usually sailed, on vehicles that it has not seen.

    Raises
    ------
    ConfigError
        If it does not even keep the envelope with those that it has seen; names what to relax.
    """
    own, own_keeps = task.spiral_trial.manoeuvre, task.spiral_trial.n_outside == 0
    # By the vehicles that are seen, so that those that are not seen judge it unmoved.
    others = {
        "designed": progress.best,
        **{name: trial for name, trial in task.standard_trials.items() if name != "spiral"},
    }
    name, best = min(others.items(), key=lambda each: (each[1].n_outside > 0, each[1].cost))
    if best.n_outside and not own_keeps:
        raise ConfigError(_nothing_fits(task, progress))
    named = {"designed": progress.best, **task.standard_trials}
    trials = {each: task.held_out_set.evaluate(trial.manoeuvre) for each, trial in named.items()}
    gain = trials[name].mean_gain_over(trials["spiral"])
    is_own = bool(best.n_outside) or (own_keeps and not gain >= WORTH_WHILE)
    taken, manoeuvre = ("spiral", own) if is_own else (name, best.manoeuvre)
    of_own = _nominal_run(task, own)
    truth, posterior = of_own if is_own else _nominal_run(task, manoeuvre)
    chosen = [task.distribution.symbols.index(symbol) for symbol in task.chosen]
    return Design(
        manoeuvre,
        taken,
        gain,
        trials,
        _poor(task, posterior, trials[taken].percent(), chosen),
        truth,
        posterior,
        _soonest(posterior, of_own[1], chosen),
        (*_growth(posterior, sizes_of(task.nominal), chosen), *_longer(task, manoeuvre, chosen)),
        progress,
        task.distribution.symbols,
    )


def _nothing_fits(task: DesignProblem, progress: SearchProgress) -> str:
    best, wish = progress.best, task.requirement
    tried = f"none of {progress.evaluations} manoeuvres keeps the envelope with all {wish.draws} drawn vehicles"
    if best.n_lost:
        return (
            f"{tried}: of the best one {best.n_lost} capsize, stand on their nose or run away; draw vehicles that are "
            "nearer to each other (--spread 15%), or take smaller fins (--fins)"
        )
    extents = [flight.extent for flight in best.runs if flight.extent is not None]
    relaxed = options_to_relax(extents, *with_margin(wish.envelope, task.slowest))
    return f"{tried}: relax {relaxed}, which would let the best one pass, or search for longer (--budget)"


def _nominal_run(task: DesignProblem, manoeuvre: AnyManoeuvre) -> tuple[Truth, Posterior]:
    truth = simulate_trial(task.nominal, manoeuvre)
    return truth, predict_posterior(truth, task.assumptions)


def _soonest(posterior: Posterior, own: Posterior, chosen: Sequence[int]) -> float | None:
    reached = np.log(posterior.deviation[:, chosen]).mean(axis=1) <= np.log(own.deviation[-1, chosen]).mean()
    return float(posterior.time[np.argmax(reached)]) if reached.any() else None


def _growth(posterior: Posterior, sizes: Array, chosen: Sequence[int]) -> tuple[tuple[float, float], ...]:
    last = posterior.time.size - 1
    ticks = [round(last * part / _PARTS) for part in range(1, _PARTS + 1)]
    percent = 100.0 * posterior.deviation[np.ix_(ticks, chosen)] / sizes[chosen]
    means = np.exp(np.log(percent).mean(axis=1))
    return tuple(zip(posterior.time[ticks].tolist(), means.tolist(), strict=True))


def _longer(task: DesignProblem, manoeuvre: AnyManoeuvre, chosen: Sequence[int]) -> Iterator[tuple[float, float]]:
    for times in _LONGER:
        try:
            _, posterior = _nominal_run(task, manoeuvre.model_copy(update={"duration": times * manoeuvre.duration}))
        except SimulationError:
            return
        percent = 100.0 * posterior.deviation[-1, chosen] / sizes_of(task.nominal)[chosen]
        yield float(posterior.time[-1]), float(np.exp(np.log(percent).mean()))


def _poor(
    task: DesignProblem, posterior: Posterior, percent: Array, chosen: Sequence[int]
) -> tuple[WeakCoefficient, ...]:
    worst = sorted(chosen, key=lambda place: -percent[place])
    named = [
        place
        for rank, place in enumerate(worst)
        if percent[place] > _BADLY or (rank < _NAMED and percent[place] > _WELL)
    ]
    return tuple(
        WeakCoefficient(task.distribution.symbols[place], float(percent[place]), _why(task, posterior, place))
        for place in named
    )


def _why(task: DesignProblem, posterior: Posterior, place: int) -> str:
    deviation = np.sqrt(np.diagonal(posterior.covariance))
    if deviation[place] > _HARDLY * task.assumptions.prior_std[place]:
        return "hardly moves the vehicle in this run"
    free = np.flatnonzero(deviation > 0.0)
    correlation = posterior.covariance[np.ix_(free, free)] / np.outer(deviation[free], deviation[free])
    here = int(np.flatnonzero(free == place)[0])
    # How many times surer it would be if all others were known.
    surer = float(np.sqrt(np.linalg.inv(correlation)[here, here]))
    if surer < _TOGETHER:
        return "its share of the forces is small beside the noise"
    beside = np.abs(correlation[here])
    beside[here] = 0.0
    other = int(np.argmax(beside))
    return (
        f"if the others were known it would be {surer:.2g} times surer; it goes most with "
        f"{task.distribution.symbols[free[other]]} (correlation {correlation[here, other]:.2f})"
    )
