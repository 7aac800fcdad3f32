"""What stands at the head of a page: whether estimates may be used, and what checks have to say."""

import pytest

from auvid_cli.data.checks import Check
from auvid_cli.report.page.parts import Cards, TablePart, Words
from auvid_cli.report.page.sections import check_parts, judgement_parts


def verdict(name, check, passed, advice="Mend it."):
    return Check.of(name, "dvl", check, statistic="K_p|p| 9 sd", threshold="2", passed=passed, advice=advice)


def cards_and_words(evaluation, checks):
    cards, *words = judgement_parts(evaluation, checks)
    assert isinstance(cards, Cards)
    return {card.look: card for card in cards.cards}, [text for part in words for text in part.sentences]


@pytest.mark.parametrize(
    ("passed", "says"),
    [
        ([True], "Use the estimate."),
        ([None, True, None], "Use the estimate, and read the 2 notes of its checks below."),
        ([None, False], "Judged sound, but 1 check failed: follow the advice below first."),
    ],
)
def test_card_of_sound_estimate_mentions_notes_and_failures(evaluation, passed, says):
    checks = [verdict("ckf", f"check {place}", each) for place, each in enumerate(passed)]
    cards, _ = cards_and_words(evaluation, checks)
    assert (cards["ckf"].grade, cards["ckf"].says) == ("sound", says)
    assert cards["ekf"].says == "Use the estimate."


def test_shared_note_is_listed_once_with_advice(evaluation):
    checks = [verdict(name, check, None) for name in ("ekf", "ckf", "tukf") for check in ("NIS", "whiteness")]
    checks += [verdict("ckf", "size", False, "Look at units."), verdict("ekf", "sound", False, "It is far off.")]
    _, words = cards_and_words(evaluation, checks)
    assert words[:-1] == [
        "Failed for CKF: dvl (size): K_p|p| 9 sd. Look at units.",
        "Note for all filters: dvl (NIS, whiteness). Mend it.",
    ]
    assert words[-1].startswith("NIS: ")


def test_many_advices_are_cut_and_counted(evaluation):
    checks = [verdict("ckf", f"check {place}", False, f"Mend {place}.") for place in range(9)]
    _, words = cards_and_words(evaluation, checks)
    assert words[6] == "3 more are in the list of checks below."


def test_the_nis_of_a_card_is_told_by_sensor(evaluation):
    cards, _ = cards_and_words(evaluation, [])
    sensors = [name for name in cards["ckf"].numbers if name.startswith("NIS of ")]
    assert sensors == [f"NIS of {row.sensor}" for row in evaluation.consistency if row.filter == "ckf"]
    assert "mean NIS" not in cards["ckf"].numbers


def test_the_list_of_checks_has_a_row_for_all_that_share_a_verdict():
    checks = [verdict(name, "NIS", None) for name in ("ckf", "smoother")]
    checks += [verdict("ckf", "gap", False), verdict("smoother", "gap", True)]
    words, told, passed = check_parts(checks)
    assert isinstance(words, Words)
    assert isinstance(told, TablePart)
    assert [row[:4] for row in told.table.rows] == [["FAIL", "CKF", "dvl", "gap"], ["note", "all", "dvl", "NIS"]]
    assert isinstance(passed, TablePart)
    assert (passed.folded, len(passed.table.rows)) == (True, 1)
