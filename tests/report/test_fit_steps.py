"""Sentences and tables on a search for a model."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.fitting.additions import Addition
from auvid_cli.fitting.results import Fit, FitStep
from auvid_cli.report.page.pages import fit_page
from auvid_cli.report.page.render import write_page
from auvid_cli.report.sentences import fit_sentences, measure_next_time, steps_tables

STEPS = (
    FitStep(0, "hold", "coefficients of the vertical plane", "", None, True, "", "", 0.1),
    FitStep(0, "start", "process noise from the data", "", None, True, "", "doubtful", 10.25),
    FitStep(1, "add", Addition("current"), "current_north 0.149 +- 0.001 m/s", 2400.0, True, "doubtful", "sound", 21.0),
    FitStep(1, "add", Addition("thrust"), "", 310.0, False, "doubtful", "", 8.0),
    FitStep(1, "end", "fit to all data", "", None, True, "", "sound", 30.0),
)


@pytest.fixture
def fit(hand_made):
    estimate = hand_made(np.arange(3.0), {"X_u|u|": [-1.0, -2.0, -3.0]})
    trial = "Yaw rate in turns 20 s ahead: 1 deg/s, vehicle file 2: 50 % better."
    return Fit(estimate, Judgement(Grade.SOUND), STEPS, estimate.experiment, ("errors of dvl",), trial)


def test_trial_comes_first_and_every_addition_has_its_size(fit):
    lines = fit_sentences(fit)
    assert lines[:2] == [fit.trial, "Judgement: sound."]
    assert "Added to the model: current." in lines
    assert "current: current_north 0.149 +- 0.001 m/s." in lines
    assert any("vertical plane" in line for line in lines)


def test_tried_and_not_kept_is_a_table_of_its_own(fit):
    kept, tried = steps_tables(fit)
    assert [row[1:3] for row in kept.rows][2] == ["add", "current"]
    assert [row[2] for row in tried.rows] == ["scale of the thrust"]
    headings = [column.header for column in kept.columns]
    assert headings[-3:] == ["judged before", "judged after", "processor time in s"]
    (only,) = steps_tables(Fit(fit.estimate, fit.judgement, STEPS[:1], fit.experiment, ()))
    assert len(only.rows) == 1


def test_next_run_is_advised_by_what_was_held_and_not_recorded(fit):
    advice = " ".join(measure_next_time(fit))
    assert "dive and climb" in advice
    assert "Record a gyroscope" in advice
    assert "thrust" not in advice


@pytest.mark.slow
def test_page_has_steps_and_advice(fit, short_run, tmp_path):
    page = write_page(fit_page(short_run, fit), tmp_path / "fit.html").read_text(encoding="utf-8")
    for text in (
        "How this model was found",
        "X_u|u|",
        "Tried and not kept",
        "advice for the next run",
        "errors of dvl",
        "fit.yaml",
    ):
        assert text in page
    assert page.count("Unexplained") == 1


def test_coefficients_left_at_zero_are_named_if_they_are_kept_there(fit):
    names = "N_r|r|, N_v|v|"
    for is_kept in (True, False):
        step = FitStep(2, "leave at 0", names, "", 8.0 if is_kept else 1.0, is_kept, "", "", 2.0)
        text = " ".join(fit_sentences(replace(fit, steps=(*STEPS, step))))
        assert (names in text) is is_kept


def test_additions_are_the_same_whatever_their_sizes(fit):
    added, removed, again = (
        FitStep(1, action, Addition("delay", "dvl", size), "", 1.0, True, "", "", 1.0)
        for action, size in (("add", 0.1), ("remove", 0.12), ("add", 0.15))
    )
    with_steps = [replace(fit, steps=steps) for steps in ((added,), (added, removed), (added, removed, again))]
    assert [found.added for found in with_steps] == [(str(added.what),), (), (str(again.what),)]
    assert [step.key for step in STEPS] == [None, None, ("current", ""), ("thrust", ""), None]
