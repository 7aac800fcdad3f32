"""Search for the model of a dataset."""

from dataclasses import replace

import numpy as np
import pytest

import auvid_cli as auvid
from auvid_cli.config.enums import JUDGE
from auvid_cli.errors import ConfigError
from auvid_cli.evaluation.judgement import Grade
from auvid_cli.fitting.quick_fits import thinned
from auvid_cli.fitting.search import FitLimits, fit_model
from auvid_cli.identification.run import identify

TRIM = 0.02  # rad


@pytest.fixture(scope="module")
def trimmed(multisine_with):
    """A multisine with a trimmed rudder, which the settings do not know."""
    return multisine_with(f"manoeuvre.fin_trim.rudder={TRIM}")


def test_thinned_data_keep_every_sample_of_slow_sensors(short_run):
    few = thinned(short_run)
    # Every third of 25 Hz.
    assert np.diff(few.sensors["gyroscope"].time) == pytest.approx(0.12)
    assert few.sensors["dvl"].time.size == short_run.sensors["dvl"].time.size


def test_unknown_kind_of_addition_is_refused(short_run):
    with pytest.raises(ConfigError, match="tide"):
        auvid.fit(short_run, only=["tide"])


@pytest.mark.slow
def test_trimmed_rudder_is_found_and_nothing_else(multisine_with):
    # Long enough for a prediction of the last third.
    trimmed, steps = multisine_with(f"manoeuvre.fin_trim.rudder={TRIM}", "manoeuvre.duration=40 s"), list[str]()
    # The truth must not matter.
    fit = fit_model(replace(trimmed, truth=None), FitLimits(), steps.append)
    assert [step.partition(",")[0] for step in steps if "kept" in step] == ["look 1: kept trim of the fins"]
    assert fit.judgement.grade is Grade.SOUND
    assert fit.added == ("trim of the fins",)
    row = fit.estimate.state.index("rudder_trim")
    found, deviation = fit.estimate.mean[-1, row], fit.estimate.standard_deviation[-1, row]
    assert abs(found - TRIM) < 4.0 * deviation
    assert "vehicle file" in fit.trial
    again = identify(replace(trimmed, experiment=fit.experiment), JUDGE)
    assert np.array_equal(again.mean, fit.estimate.mean)


@pytest.mark.slow
def test_last_fit_gets_more_passes_if_it_does_not_converge(multisine_with):
    few = 2
    dataset = multisine_with(f"manoeuvre.fin_trim.rudder={TRIM}", f"identification.smoother.max_passes={few}")
    fit = fit_model(dataset, FitLimits(only=("fin_trim",)))
    assert fit.estimate.completed
    assert fit.experiment.identification.smoother.max_passes > few
    again = identify(replace(dataset, experiment=fit.experiment), JUDGE)
    assert np.array_equal(again.mean, fit.estimate.mean)


@pytest.mark.slow
def test_nothing_is_added_without_a_fault(multisine_with):
    dataset = multisine_with()
    fit = fit_model(dataset, FitLimits())
    assert fit.judgement.grade is Grade.SOUND
    assert fit.added == ()
    assert fit.experiment == dataset.experiment


@pytest.mark.slow
def test_errors_that_the_settings_ask_for_are_stated_but_not_added(multisine_with):
    fit = fit_model(multisine_with("identification.estimate.biases=[thrust]"), FitLimits())
    assert fit.added == ()
    (asked,) = [step for step in fit.steps if step.action == "as asked"]
    assert str(asked.what) == "scale of the thrust"
    assert asked.size.startswith("thrust_scale ")


@pytest.mark.slow
def test_interrupt_keeps_the_best_model_so_far(trimmed):
    def interrupt(step: str) -> None:
        if step.startswith("look 1"):
            raise KeyboardInterrupt

    fit = fit_model(trimmed, FitLimits(), interrupt)
    assert fit.stopped == "interrupted"
    assert fit.added == ()
    assert fit.judgement.is_against


@pytest.mark.slow
@pytest.mark.parametrize("stage", ["fit of the model to all data", "predict the last third"])
def test_interrupt_of_the_last_stages_keeps_the_model(multisine_with, stage):
    def interrupt(step: str) -> None:
        if step.startswith(stage):
            raise KeyboardInterrupt

    dataset = multisine_with()
    fit = fit_model(dataset, FitLimits(), interrupt)
    assert fit.stopped.startswith("interrupted")
    assert fit.judgement.grade is Grade.SOUND
    assert fit.experiment == dataset.experiment
    assert fit.trial == ""


@pytest.mark.slow
def test_interrupt_of_the_fit_to_all_data_keeps_the_additions(trimmed):
    def interrupt(step: str) -> None:
        if step.startswith("fit of the model to all data"):
            raise KeyboardInterrupt

    fit = fit_model(trimmed, FitLimits(only=("fin_trim",)), interrupt)
    assert fit.stopped.startswith("interrupted")
    assert fit.added == ("trim of the fins",)
    assert "rudder_trim" in fit.estimate.state


@pytest.mark.slow
def test_interrupt_within_a_look_keeps_the_best_candidate(trimmed):
    steps: list[str] = []

    def interrupt(step: str) -> None:
        steps.append(step)
        if "candidate 2" in step:
            raise KeyboardInterrupt

    fit = fit_model(trimmed, FitLimits(), interrupt)
    assert fit.stopped == "interrupted"
    tried = [str(step.what) for step in fit.steps if step.action == "add"]
    assert len(tried) == 1
    assert fit.added == tuple(tried)


@pytest.mark.slow
@pytest.mark.parametrize(("sensor", "factor"), [("gyroscope", 2.0), ("dvl", 0.5)])
def test_noise_twice_or_half_as_stated_is_found(multisine_with, sensor, factor):
    dataset = multisine_with()
    record = dataset.sensors[sensor]
    stated = replace(record, standard_deviation=record.standard_deviation / factor)
    fit = fit_model(replace(dataset, sensors={**dataset.sensors, sensor: stated}), FitLimits())
    assert fit.judgement.grade is Grade.SOUND
    assert fit.added == (f"noise of the {sensor}",)
    assert fit.experiment.identification.measurement_noise[sensor] == pytest.approx(factor, rel=0.1)


@pytest.mark.slow
def test_prior_that_excludes_the_coefficients_is_widened(multisine_with):
    # Sixty times as narrow as by default: the true coefficients are far outside.
    dataset = multisine_with("identification.prior.factor=0.05")
    fit = fit_model(dataset, FitLimits())
    assert fit.judgement.grade is Grade.SOUND
    assert fit.added == ("width of the prior",)


@pytest.mark.slow
def test_excluded_addition_is_not_tried(trimmed):
    def interrupt(step: str) -> None:
        # The second interrupt leaves out the fit to all data.
        if step.startswith(("look 2", "fit of the model to all data")):
            raise KeyboardInterrupt

    # Without the exclusion, the first look tries it and keeps it.
    fit = fit_model(trimmed, FitLimits(excluded=("fin_trim",)), interrupt)
    tried = [str(step.what) for step in fit.steps]
    assert tried
    assert "trim of the fins" not in tried
