"""The screen of tuned noise, and whether the noise is recommended."""

import io
from dataclasses import replace

import pytest
from rich.console import Console

from auvid_cli.data.findings import Tuning
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.report.screens import objection_to_tuning, print_tuning


@pytest.mark.parametrize(
    ("before", "after", "is_recommended"),
    [
        (Grade.INCONSISTENT, Grade.DIVERGED, False),
        (Grade.SOUND, Grade.INCONSISTENT, False),
        (Grade.DIVERGED, Grade.INCONSISTENT, True),
        (Grade.DIVERGED, Grade.DIVERGED, True),
        (Grade.SOUND, Grade.DOUBTFUL, True),
        (Grade.INCONSISTENT, Grade.SOUND, True),
    ],
)
def test_noise_with_a_worse_judgement_is_not_recommended(before, after, is_recommended):
    objection = objection_to_tuning([Judgement(before), Judgement(after, "why", "raise max_passes")])
    assert (objection == "") is is_recommended
    assert is_recommended or objection.endswith("raise max_passes")


@pytest.mark.parametrize(("source", "is_explained"), [("ahrs", True), ("direct", False)])
def test_errors_of_an_ahrs_are_explained(estimates, experiment_with, source, is_explained):
    experiment = experiment_with(f"sensors.attitude={{source: {source}}}")
    judged = replace(estimates[0], experiment=experiment), Judgement(Grade.SOUND)
    screen = io.StringIO()
    print_tuning(Console(file=screen, width=80), Tuning((), 0.0, 0.0, True, experiment), [judged, judged])
    assert ("AHRS" in screen.getvalue()) is is_explained
