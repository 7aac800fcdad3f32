"""The search for the manoeuvre that tells most: CMA-ES, for the cost is rough where vehicles capsize or limits bite."""

from collections.abc import Iterator
from typing import NamedTuple

import cma
import numpy as np

from auvid_cli.design.trials import Bench, Trial
from auvid_cli.design.variables import SearchSpace

POPULATION, _FIRST_STEP = 12, 0.2


class Reached(NamedTuple):
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
    space: SearchSpace, bench: Bench, seed: int, before: tuple[tuple[float, ...], ...] = ()
) -> Iterator[Reached]:
    """Look for better manoeuvres, generation by generation, without an end.

    Begins with the point nearest to the space's own manoeuvre. Where the search settles it begins anew about the best,
    as wide as at first. The same seed and number of generations give the same manoeuvre, interrupted or not.

    Parameters
    ----------
    space : SearchSpace
    bench : Bench
    seed : int
    before : tuple of tuple of float
        `Reached.costs` of the same search, which was interrupted: how far that came is yielded first.
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
    best = bench.try_out(space.manoeuvre(place))
    least, costs = best.cost, list[tuple[float, ...]]()
    while True:
        strategy = cma.CMAEvolutionStrategy(place, _FIRST_STEP, options)
        while not strategy.stop():
            places = [np.asarray(each) for each in strategy.ask()]
            generation, trials = len(costs), list[Trial]()
            if generation < len(before):
                costs.append(before[generation])
            else:
                trials = [bench.try_out(space.manoeuvre(each)) for each in places]
                costs.append(tuple(trial.cost for trial in trials))
            strategy.tell(places, list(costs[-1]))
            for k, cost in enumerate(costs[-1]):
                if cost < least:
                    least, place = cost, places[k]
                    best = trials[k] if trials else best
            if generation + 1 == len(before):
                best = bench.try_out(space.manoeuvre(place))
            if generation + 1 >= len(before):
                yield Reached(generation + 1, 1 + sum(map(len, costs)), best, tuple(costs))
