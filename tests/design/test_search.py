"""Search for a manoeuvre, and its conclusion."""

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
    """A problem and the progress of two generations."""
    problem = make_problem(remus(), Requirement(20.0, Envelope(), None, None, (), "D", 2, None))
    return problem, list(islice(search(problem.space, problem.search_set, 1), 2))


@pytest.mark.slow
def test_search_improves_and_repeats_with_seed(reached):
    problem, steps = reached
    assert [step.evaluations for step in steps] == [13, 25]
    start = problem.search_set.evaluate(problem.space.manoeuvre(problem.space.start()))
    assert steps[1].best.cost <= steps[0].best.cost <= start.cost
    again = next(search(problem.space, problem.search_set, 1))
    assert again.best.manoeuvre == steps[0].best.manoeuvre


@pytest.mark.slow
def test_interrupted_search_continues_alike(reached):
    problem, steps = reached
    tried = []

    class Counting:
        def evaluate(self, manoeuvre):
            tried.append(manoeuvre)
            return problem.search_set.evaluate(manoeuvre)

    resumed = search(problem.space, Counting(), 1, steps[0].costs)
    where_it_was, next_step = next(resumed), next(resumed)
    assert (where_it_was.generation, where_it_was.evaluations) == (1, 13)
    assert where_it_was.best.manoeuvre == steps[0].best.manoeuvre
    assert next_step.costs == steps[1].costs
    assert next_step.best.manoeuvre == steps[1].best.manoeuvre
    # The start, the best again, and the second generation.
    assert len(tried) == 14


@pytest.mark.slow
def test_result_is_compared_with_standard_manoeuvres_on_held_out_vehicles(reached):
    problem, steps = reached
    design = conclude(problem, steps[-1])
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


@pytest.mark.slow
def test_spiral_is_kept_without_improvement(reached):
    problem, _ = reached
    design = conclude(problem, SearchProgress(1, 1, problem.spiral_trial))
    assert design.keeps_spiral
    assert design.gain == pytest.approx(1.0)
    assert design.manoeuvre == problem.space.base
    assert design.time_to_match == pytest.approx(20.0, abs=0.1)


@pytest.mark.slow
def test_impossible_envelope_raises_config_error_with_limits_to_relax(remus, requirement):
    problem = make_problem(remus(), requirement({"box": 5.0, "roll": 0.02, "speed": 1.5}))
    found = next(search(problem.space, problem.search_set, 1))
    with pytest.raises(ConfigError, match=r"none of 13 manoeuvres stays .* relax --box '\d.* m', .*--roll '\d.* deg'"):
        conclude(problem, found)


def test_coefficient_that_is_not_estimated_raises_config_error(remus, requirement):
    with pytest.raises(ConfigError, match=r"--for N_x: not estimated.*X_u\|u\|"):
        make_problem(remus(), requirement(chosen=("N_x",)))


def trial_of(*measures):
    """A trial with the given standard deviation, %, on each vehicle; None is a lost vehicle."""
    runs = [TrialRun(np.full(len(SYMBOLS), value or np.nan), None) for value in measures]
    logarithms = np.array([np.inf if value is None else np.log(value) for value in measures])
    return Trial(None, runs, logarithms, [])


def test_gain_counts_vehicles_lost_in_neither_trial():
    gains = trial_of(1.0, 2.0, None).gain_over(trial_of(3.0, None, 5.0))
    assert gains == pytest.approx([3.0])
    assert trial_of(2.0, 1.0).mean_gain_over(trial_of(4.0, 8.0)) == pytest.approx(4.0)
    assert np.isnan(trial_of(None).mean_gain_over(trial_of(1.0)))


def test_criterion_worst_and_chosen_coefficients_set_measure(remus, requirement):
    problem = make_problem(remus(), requirement(criterion="worst"))
    few = make_problem(remus(), requirement(chosen=("N_uudr", "N_uvl")))
    for run, worst, named in zip(
        problem.spiral_trial.runs, problem.spiral_trial.measure, few.spiral_trial.measure, strict=True
    ):
        assert worst == pytest.approx(np.log(run.percent.max()))
        rows = [SYMBOLS.index("N_uudr"), SYMBOLS.index("N_uvl")]
        assert named == pytest.approx(np.log(run.percent[rows]).mean())


@pytest.mark.slow
def test_best_standard_manoeuvre_is_recommended(remus, requirement):
    """A zigzag is twice as accurate as the spiral for these coefficients of a REMUS 100."""
    problem = make_problem(remus(), requirement(chosen=("Y_v|v|", "Y_r|r|", "K_p|p|"), duration=60.0))
    design = conclude(problem, SearchProgress(1, 1, problem.spiral_trial))
    assert design.chosen == "zigzag"
    assert design.manoeuvre == problem.standard_trials["zigzag"].manoeuvre
    assert design.gain == pytest.approx(design.trials["zigzag"].mean_gain_over(design.trials["spiral"]))
    assert not design.keeps_spiral


@pytest.mark.slow
def test_weak_coefficient_is_confounded_or_small(remus, requirement):
    """The factor equals the gain of a run in which all other coefficients are fixed."""
    problem = make_problem(remus(), requirement(chosen=("Y_r|r|",)))
    own = conclude(problem, SearchProgress(1, 1, problem.spiral_trial))
    held = make_problem(remus("identification.coefficients=['Y_r|r|']"), requirement())
    alone = conclude(held, SearchProgress(1, 1, held.spiral_trial)).posterior.deviation[-1, SYMBOLS.index("Y_r|r|")]
    words = own.weak_coefficients[0].why
    assert "confounded most with Y_" in words
    factor = own.posterior.deviation[-1, SYMBOLS.index("Y_r|r|")] / alone
    assert float(words.split("would be ")[1].split()[0]) == pytest.approx(factor, rel=0.05)
    lauv = make_problem(load_experiment(find_experiment("lauv")), requirement(chosen=("K_p|p|",)))
    assert (
        conclude(lauv, SearchProgress(1, 1, lauv.spiral_trial)).weak_coefficients[0].why
        == "its share of the forces is small compared with the noise"
    )
