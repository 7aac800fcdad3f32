"""Search for the best manoeuvre, and comparison of the result with standard manoeuvres."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cma
import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.manoeuvre import AnyManoeuvre
from auvid_cli.design.posterior import Posterior, predict_posterior
from auvid_cli.design.problem import DesignProblem, SearchSpace
from auvid_cli.design.trials import Trial, TrialSet, options_to_relax, simulate_trial, sizes_of, with_margin
from auvid_cli.errors import ConfigError, SimulationError
from auvid_cli.simulation.motion import Truth

POPULATION = 12  # manoeuvres of a generation
_INITIAL_STEP = 0.2  # as a share of the edge of the unit cube
WORTH_WHILE = 1.1  # gain from which a designed run is better than the spiral
# Standard deviations, % of a coefficient's size. Badly known coefficients are reported, and the `_N_WORST` worst ones
# unless they are well known.
_BADLY_KNOWN = 20.0
_WELL_KNOWN = 1.0
_N_WORST = 3
_CONFOUNDED_FACTOR = 2.0  # gain in accuracy with all others known, from which a coefficient is confounded
_INSENSITIVE_SHARE = 0.5  # share of the prior's standard deviation left, if a coefficient hardly moves the vehicle
_PARTS = 4  # number of times at which the accuracy along the run is reported
_LONGER = (2.0, 4.0)  # durations of longer runs, relative to the run


class SearchProgress(NamedTuple):
    """State of a search after a generation."""

    generation: int  # counted from 1
    evaluations: int  # number of manoeuvres that were tried
    best: Trial
    costs: tuple[tuple[float, ...], ...] = ()  # costs of all manoeuvres, by generation; a search continues from them


def search(
    space: SearchSpace, trial_set: TrialSet, seed: int, before: tuple[tuple[float, ...], ...] = ()
) -> Iterator[SearchProgress]:
    """Yield the best manoeuvre after each generation of CMA-ES, without end.

    The search begins near the space's own manoeuvre. After convergence it starts again from the best point with the
    initial step. The same seed and number of generations give the same manoeuvre, also after an interruption.

    Parameters
    ----------
    before : tuple of tuple of float
        `SearchProgress.costs` of the same search before an interruption; its last state is yielded first.
    """
    random = np.random.default_rng([seed, 1])
    options = {
        "bounds": [0.0, 1.0],
        "popsize": POPULATION,
        # Own generator, because otherwise cma seeds the global one.
        "seed": np.nan,
        "randn": lambda *shape: random.standard_normal(shape),
        "verbose": -9,
        "verb_log": 0,
    }
    point = space.start()
    best = trial_set.evaluate(space.manoeuvre(point))
    least, costs = best.cost, list[tuple[float, ...]]()
    while True:
        strategy = cma.CMAEvolutionStrategy(point, _INITIAL_STEP, options)
        while not strategy.stop():
            points = [np.asarray(candidate) for candidate in strategy.ask()]
            generation, trials = len(costs), list[Trial]()
            if generation < len(before):
                costs.append(before[generation])
            else:
                trials = [trial_set.evaluate(space.manoeuvre(candidate)) for candidate in points]
                costs.append(tuple(trial.cost for trial in trials))
            strategy.tell(points, list(costs[-1]))
            for k, cost in enumerate(costs[-1]):
                if cost < least:
                    least, point = cost, points[k]
                    best = trials[k] if trials else best
            if generation + 1 == len(before):
                best = trial_set.evaluate(space.manoeuvre(point))
            if generation + 1 >= len(before):
                yield SearchProgress(generation + 1, 1 + sum(map(len, costs)), best, tuple(costs))


class WeakCoefficient(NamedTuple):
    """A coefficient with a large standard deviation after the run, % of its size, and the reason."""

    symbol: str
    percent: float
    why: str


class Design(NamedTuple):
    """Result of a search."""

    manoeuvre: AnyManoeuvre  # the recommended manoeuvre: the best of all, or the experiment's own if that is as good
    chosen: str  # its name among the trials
    # Standard deviations after the experiment's own manoeuvre divided by those after the best other one: geometric mean
    # over vehicles that the search has not seen
    gain: float
    trials: dict[str, Trial]  # ``designed``, ``spiral``, ``doublets`` and ``zigzag`` on these vehicles
    weak_coefficients: tuple[WeakCoefficient, ...]
    truth: Truth  # motion of the nominal vehicle in the recommended manoeuvre
    posterior: Posterior  # accuracy along this motion
    # Time, s, until the run is as accurate as the whole of the experiment's own; None if never
    time_to_match: float | None
    # Time, s, and geometric mean of the standard deviations, %: along the run, then for runs of twice and four times
    # its duration if the vehicle can do them
    accuracy_over_time: tuple[tuple[float, float], ...]
    progress: SearchProgress
    symbols: tuple[str, ...]  # coefficients

    @property
    def keeps_spiral(self) -> bool:
        """Whether the experiment's own manoeuvre is recommended."""
        return self.chosen == "spiral"

    @property
    def is_worth_while(self) -> bool:
        """Whether the best other manoeuvre is clearly more accurate than the experiment's own."""
        return self.gain >= WORTH_WHILE


def conclude(problem: DesignProblem, progress: SearchProgress) -> Design:
    """Compare the best manoeuvre of a search with standard ones, on vehicles that the search has not seen.

    Raises
    ------
    ConfigError
        If no manoeuvre keeps the envelope with the vehicles of the search; names limits to relax.
    """
    spiral, spiral_keeps_envelope = problem.spiral_trial.manoeuvre, problem.spiral_trial.n_outside == 0
    candidates = {"designed": progress.best, **problem.standard_trials}
    # Chosen on the vehicles of the search, so that the held-out vehicles give an unbiased gain.
    others = [(name, trial) for name, trial in candidates.items() if name != "spiral"]
    name, best = min(others, key=lambda other: (other[1].n_outside > 0, other[1].cost))
    if best.n_outside and not spiral_keeps_envelope:
        raise ConfigError(_no_manoeuvre_fits(problem, progress))
    trials = {key: problem.held_out_set.evaluate(trial.manoeuvre) for key, trial in candidates.items()}
    gain = trials[name].mean_gain_over(trials["spiral"])
    keeps_spiral = bool(best.n_outside) or (spiral_keeps_envelope and not gain >= WORTH_WHILE)
    name, manoeuvre = ("spiral", spiral) if keeps_spiral else (name, best.manoeuvre)
    of_spiral = _nominal_run(problem, spiral)
    truth, posterior = of_spiral if keeps_spiral else _nominal_run(problem, manoeuvre)
    chosen = [problem.distribution.symbols.index(symbol) for symbol in problem.chosen]
    return Design(
        manoeuvre,
        name,
        gain,
        trials,
        _weak_coefficients(problem, posterior, trials[name].percent(), chosen),
        truth,
        posterior,
        _time_to_match(posterior, of_spiral[1], chosen),
        (*_accuracy_along(problem, posterior, chosen), *_accuracy_of_longer(problem, manoeuvre, chosen)),
        progress,
        problem.distribution.symbols,
    )


def _no_manoeuvre_fits(problem: DesignProblem, progress: SearchProgress) -> str:
    best, requirement = progress.best, problem.requirement
    tried = (
        f"none of {progress.evaluations} manoeuvres stays within the limits with all {requirement.draws} trial vehicles"
    )
    if best.n_lost:
        return (
            f"{tried}: even in the best one {best.n_lost} went out of control; draw vehicles "
            "from a smaller --spread (15%), or limit the fins (--fins)"
        )
    extents = [run.extent for run in best.runs if run.extent is not None]
    relaxed = options_to_relax(extents, *with_margin(requirement.envelope, problem.slowest))
    return f"{tried}: relax {relaxed}, so that the best one fits, or search longer (--budget)"


def _nominal_run(problem: DesignProblem, manoeuvre: AnyManoeuvre) -> tuple[Truth, Posterior]:
    truth = simulate_trial(problem.nominal, manoeuvre)
    return truth, predict_posterior(truth, problem.assumptions)


def _time_to_match(posterior: Posterior, of_spiral: Posterior, chosen: Sequence[int]) -> float | None:
    goal = np.log(of_spiral.deviation[-1, chosen]).mean()
    reached = np.log(posterior.deviation[:, chosen]).mean(axis=1) <= goal
    return float(posterior.time[np.argmax(reached)]) if reached.any() else None


def _accuracy_along(
    problem: DesignProblem, posterior: Posterior, chosen: Sequence[int]
) -> Iterator[tuple[float, float]]:
    last = posterior.time.size - 1
    for part in range(1, _PARTS + 1):
        yield _accuracy_at(problem, posterior, round(last * part / _PARTS), chosen)


def _accuracy_of_longer(
    problem: DesignProblem, manoeuvre: AnyManoeuvre, chosen: Sequence[int]
) -> Iterator[tuple[float, float]]:
    for times in _LONGER:
        try:
            _, posterior = _nominal_run(problem, manoeuvre.model_copy(update={"duration": times * manoeuvre.duration}))
        except SimulationError:
            return
        yield _accuracy_at(problem, posterior, -1, chosen)


def _accuracy_at(problem: DesignProblem, posterior: Posterior, tick: int, chosen: Sequence[int]) -> tuple[float, float]:
    """Return the time, s, of a tick and the geometric mean of the standard deviations, %."""
    percent = 100.0 * posterior.deviation[tick, chosen] / sizes_of(problem.nominal)[chosen]
    return float(posterior.time[tick]), float(np.exp(np.log(percent).mean()))


def _weak_coefficients(
    problem: DesignProblem, posterior: Posterior, percent: Array, chosen: Sequence[int]
) -> tuple[WeakCoefficient, ...]:
    worst_first = sorted(chosen, key=lambda k: -percent[k])
    return tuple(
        WeakCoefficient(problem.distribution.symbols[k], float(percent[k]), _why(problem, posterior, k))
        for rank, k in enumerate(worst_first)
        if percent[k] > _BADLY_KNOWN or (rank < _N_WORST and percent[k] > _WELL_KNOWN)
    )


def _why(problem: DesignProblem, posterior: Posterior, k: int) -> str:
    """Return the reason for the large standard deviation of coefficient `k`."""
    deviation = np.sqrt(np.diagonal(posterior.covariance))
    if deviation[k] > _INSENSITIVE_SHARE * problem.assumptions.prior_std[k]:
        return "it hardly moves the vehicle in this run"
    free = np.flatnonzero(deviation > 0.0)
    correlation = posterior.covariance[np.ix_(free, free)] / np.outer(deviation[free], deviation[free])
    row = int(np.flatnonzero(free == k)[0])
    # Ratio of its standard deviation to the one if all others were known.
    factor = float(np.sqrt(np.linalg.inv(correlation)[row, row]))
    if factor < _CONFOUNDED_FACTOR:
        return "its share of the forces is small compared with the noise"
    others = np.abs(correlation[row])
    others[row] = 0.0
    other = int(np.argmax(others))
    return (
        f"it would be {factor:.2g} times more accurate if the others were known; it is confounded most with "
        f"{problem.distribution.symbols[free[other]]} (correlation {correlation[row, other]:.2f})"
    )
