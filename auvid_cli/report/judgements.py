"""Judgements of several filters in words."""

from collections.abc import Iterable, Mapping

from auvid_cli.data.check import Check
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.report.notation import filter_label
from auvid_cli.report.sentence import sentence


def judgement_sentences(judgements: Mapping[str, Judgement], with_sound: bool) -> list[str]:
    """Say what filters are worth, what stands against them and what to do, all with the same in one sentence.

    Parameters
    ----------
    judgements : mapping of Judgement
        By filter.
    with_sound : bool
        Whether those that are sound are named as well.
    """
    labels: dict[Judgement, list[str]] = {}
    for name, judgement in judgements.items():
        if with_sound or judgement.grade is not Grade.SOUND:
            labels.setdefault(judgement, []).append(filter_label(name))
    return [sentence(f"{', '.join(of_same)} {judgement}") for judgement, of_same in labels.items()]


def contradiction_sentences(checks: Iterable[Check]) -> list[str]:
    """Say of verdicts on an accelerometer that nothing listened to that it contradicts what was used."""
    found = ", ".join(f"{check.check}: {check.statistic}" for check in checks)
    said = "the accelerometer, which was not used, contradicts the DVL ({}): see `auvid inspect` before it is used"
    return [sentence(said.format(found))] if found else []
