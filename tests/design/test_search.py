"""The search, and what came of it."""

from itertools import islice

import numpy as np
import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.manoeuvre import Envelope
from auvid_cli.design.problem import Requirement, make_problem
from auvid_cli.design.search import WORTH_WHILE, SearchProgress, conclude, search
from auvid_cli.design.trials import Trial, TrialRun
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.coefficients import SYMBOLS


@pytest.fixture(scope="module")
def reached(remus):
    """A task, and how far two generations of a search come."""
    task = make_problem(remus(), Requirement(20.0, Envelope(), None, None, (), "D", 2, None))
    return task, list(islice(search(task.space, task.search_set, 1), 2))


def test_a_search_never_loses_ground_and_the_same_seed_finds_the_same(reached):
    task, steps = reached
    assert [step.evaluations for step in steps] == [13, 25]
    start = task.search_set.evaluate(task.space.manoeuvre(task.space.start()))
    assert steps[1].best.cost <= steps[0].best.cost <= start.cost
    again = next(search(task.space, task.search_set, 1))
    assert again.best.manoeuvre == steps[0].best.manoeuvre


def test_a_search_that_was_interrupted_goes_on_as_if_it_had_not_been(reached):
    task, steps = reached
    tried = []

    class Counting:
        def evaluate(self, manoeuvre):
            tried.append(manoeuvre)
            return task.search_set.evaluate(manoeuvre)

    resumed = search(task.space, Counting(), 1, steps[0].costs)
    where_it_was, next_step = next(resumed), next(resumed)
    assert (where_it_was.generation, where_it_was.evaluations) == (1, 13)
    assert where_it_was.best.manoeuvre == steps[0].best.manoeuvre
    assert next_step.costs == steps[1].costs
    assert next_step.best.manoeuvre == steps[1].best.manoeuvre
    # The start, the best again, and the second generation.
    assert len(tried) == 14


def test_what_is_found_is_judged_on_other_vehicles_beside_what_is_usually_sailed(reached):
    task, steps = reached
    design = conclude(task, steps[-1])
    assert {*design.trials} == {"designed", "spiral", "doublets", "zigzag"}
    assert all(len(trial.runs) == 8 for trial in design.trials.values())
    percents = [np.log(design.trials[name].percent()).mean() for name in ("spiral", "designed")]
    assert design.gain == pytest.approx(np.exp(percents[0] - percents[1]))
    assert design.keeps_spiral == (design.gain < WORTH_WHILE)
    assert [poor.percent for poor in design.weak_coefficients[:3]] == sorted(
        (poor.percent for poor in design.weak_coefficients[:3]), reverse=True
    )
    times, means = zip(*design.accuracy_over_time, strict=True)
    assert times == pytest.approx((5.0, 10.0, 15.0, 20.0, 40.0, 80.0), abs=0.1)
    assert sorted(means, reverse=True) == [*means]
    worst = design.trials["spiral" if design.keeps_spiral else "designed"].percent()
    assert design.weak_coefficients[0].percent == worst.max()


def test_where_the_search_finds_nothing_better_the_spiral_is_what_comes_out(reached):
    task, _ = reached
    design = conclude(task, SearchProgress(1, 1, task.own))
    assert design.keeps_spiral
    assert design.gain == pytest.approx(1.0)
    assert design.manoeuvre == task.space.base
    assert design.time_to_match == pytest.approx(20.0, abs=0.1)


def test_an_envelope_that_nothing_fits_is_refused_with_what_to_relax(remus, wish):
    task = make_problem(remus(), wish({"box": 5.0, "roll": 0.02, "speed": 1.5}))
    found = next(search(task.space, task.search_set, 1))
    with pytest.raises(ConfigError, match=r"none of 13 manoeuvres keeps .* relax --box '\d.* m', .*--roll '\d.* deg'"):
        conclude(task, found)


def test_only_what_is_estimated_can_be_asked_for(remus, wish):
    with pytest.raises(ConfigError, match=r"--for N_x: is not estimated .* there are X_u\|u\|"):
        make_problem(remus(), wish(chosen=("N_x",)))


def trial_of(*measures):
    """A trial with one coefficient's percent on each vehicle; None is lost."""
    flights = [TrialRun(np.full(len(SYMBOLS), value or np.nan), None) for value in measures]
    logarithms = np.array([np.inf if value is None else np.log(value) for value in measures])
    return Trial(None, flights, logarithms, [])


def test_a_gain_is_of_the_vehicles_that_both_bring_home():
    gains = trial_of(1.0, 2.0, None).gain_over(trial_of(3.0, None, 5.0))
    assert gains == pytest.approx([3.0])
    assert trial_of(2.0, 1.0).mean_gain_over(trial_of(4.0, 8.0)) == pytest.approx(4.0)
    assert np.isnan(trial_of(None).mean_gain_over(trial_of(1.0)))


def test_worst_looks_at_the_largest_and_for_at_those_that_are_named(remus, wish):
    task = make_problem(remus(), wish(criterion="worst"))
    few = make_problem(remus(), wish(chosen=("N_uudr", "N_uvl")))
    for flight, worst, named in zip(
        task.spiral_trial.runs, task.spiral_trial.measure, few.spiral_trial.measure, strict=True
    ):
        assert worst == pytest.approx(np.log(flight.percent.max()))
        here = [SYMBOLS.index("N_uudr"), SYMBOLS.index("N_uvl")]
        assert named == pytest.approx(np.log(flight.percent[here]).mean())


def test_where_what_is_usually_sailed_tells_most_it_is_what_comes_out(remus, wish):
    """A zigzag tells twice as much of what a REMUS 100's sway alone owes to as its spiral does before any search."""
    task = make_problem(remus(), wish(chosen=("Y_v|v|", "Y_r|r|", "K_p|p|"), duration=60.0))
    design = conclude(task, SearchProgress(1, 1, task.spiral_trial))
    assert design.chosen == "zigzag"
    assert design.manoeuvre == task.standard_trials["zigzag"].manoeuvre
    assert design.gain == pytest.approx(design.trials["zigzag"].mean_gain_over(design.trials["spiral"]))
    assert not design.keeps_spiral


def test_a_coefficient_that_stays_bad_hides_behind_others_or_is_small(remus, wish):
    """How much surer it would be is what a run tells in which all others are held."""
    task = make_problem(remus(), wish(chosen=("Y_r|r|",)))
    own = conclude(task, SearchProgress(1, 1, task.spiral_trial))
    held = make_problem(remus("identification.coefficients=['Y_r|r|']"), wish())
    alone = conclude(held, SearchProgress(1, 1, held.spiral_trial)).posterior.deviation[-1, SYMBOLS.index("Y_r|r|")]
    words = own.weak_coefficients[0].why
    assert "times surer; it goes most with Y_" in words
    surer = own.posterior.deviation[-1, SYMBOLS.index("Y_r|r|")] / alone
    assert float(words.split("would be ")[1].split()[0]) == pytest.approx(surer, rel=0.05)
    lauv = make_problem(load_experiment(find_experiment("lauv")), wish(chosen=("K_p|p|",)))
    assert (
        conclude(lauv, SearchProgress(1, 1, lauv.spiral_trial)).weak_coefficients[0].why
        == "its share of the forces is small beside the noise"
    )
