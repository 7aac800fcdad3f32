"""The search for the manoeuvre that tells most: CMA-ES, for the cost is rough where vehicles capsize or limits bite."""

from collections.abc import Iterator
from typing import NamedTuple

import cma
import numpy as np

from auvid_cli.design.trials import Bench, Trial
from auvid_cli.design.variables import SearchSpace

_POPULATION, _FIRST_STEP = 12, 0.2


class Reached(NamedTuple):
    """How far a search has come.

    Attributes
    ----------
    generation, evaluations : int
        Of manoeuvres, from 1.
    best : Trial
        So far.
    """

    generation: int
    evaluations: int
    best: Trial


def search(space: SearchSpace, bench: Bench, seed: int) -> Iterator[Reached]:
    """Look for better manoeuvres, generation by generation, without an end.

    Begins with the point nearest to the space's own manoeuvre. Where the search settles it begins anew about the best,
    as wide as at first. The same seed and number of generations give the same manoeuvre.
    """
    random = np.random.default_rng([seed, 1])
    options = {
        "bounds": [0.0, 1.0],
        "popsize": _POPULATION,
        # Numbers from a generator of our own: its seed is that of all Python otherwise.
        "seed": np.nan,
        "randn": lambda *shape: random.standard_normal(shape),
        "verbose": -9,
        "verb_log": 0,
    }
    place = space.start()
    best = bench.try_out(space.manoeuvre(place))
    generation, evaluations = 0, 1
    while True:
        strategy = cma.CMAEvolutionStrategy(place, _FIRST_STEP, options)
        while not strategy.stop():
            places = [np.asarray(each) for each in strategy.ask()]
            trials = [bench.try_out(space.manoeuvre(each)) for each in places]
            strategy.tell(places, [trial.cost for trial in trials])
            for each, trial in zip(places, trials, strict=True):
                if trial.cost < best.cost:
                    best, place = trial, each
            generation, evaluations = generation + 1, evaluations + len(trials)
            yield Reached(generation, evaluations, best)
