"""Whether the noise that was found is recommended."""

import pytest

from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.report.screens import objection_to_tuning


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
    objection = objection_to_tuning(Judgement(before), Judgement(after, "why", "raise max_passes"))
    assert (objection == "") is is_recommended
    assert is_recommended or objection.endswith("raise max_passes")
