"""Verdicts of several estimates, told once."""

import pytest

from auvid_cli.data.checks import Check
from auvid_cli.report.sentences import advices, counts_in_words, joined_words, shared_checks

FILTERS = ("ekf", "ckf", "smoother")


def verdict(name, check, passed, advice="Mend it.", statistic="1", subject="dvl"):
    return Check.of(name, subject, check, statistic=statistic, threshold="2", passed=passed, advice=advice)


def test_a_verdict_on_all_estimates_stands_there_once_with_what_the_smoother_found():
    checks = [verdict(name, "NIS", None, statistic=name) for name in FILTERS]
    (shared,) = shared_checks(checks)
    assert shared.filters == FILTERS
    assert shared.check.statistic == "smoother"
    (first,) = shared_checks(checks[:2])
    assert first.check.statistic == "ekf"


def test_what_passed_is_no_part_of_it_and_failures_come_first():
    checks = [verdict("ekf", "gap", True), verdict("ekf", "NIS", None), verdict("ckf", "NIS", False)]
    assert [(each.check.passed, each.filters) for each in shared_checks(checks)] == [
        (False, ("ckf",)),
        (None, ("ekf",)),
    ]


def test_what_is_to_be_said_of_one_estimate_alone_is_its_own():
    checks = [verdict("ekf", "NIS", False, "From 3 s on."), verdict("ckf", "NIS", False, "From 7 s on.")]
    assert [each.filters for each in shared_checks(checks)] == [("ekf",), ("ckf",)]


def test_advice_names_all_verdicts_that_it_explains():
    names = [("NIS", "attitude"), ("whiteness", "attitude"), ("gap", "dvl")]
    checks = [verdict("ckf", check, None, subject=subject) for check, subject in names]
    (advice,) = advices(shared_checks(checks))
    assert advice.what == "attitude (NIS, whiteness) and dvl (gap)"
    assert (advice.failed, advice.filters, advice.text) == (False, ("ckf",), "Mend it.")


def test_estimates_of_which_as_many_passed_are_counted_together():
    checks = [verdict(name, check, True) for name in FILTERS for check in ("a", "b")]
    checks += [verdict(name, "c", False) for name in FILTERS[:2]]
    assert counts_in_words(checks) == ["EKF, CKF: 2 of 3 passed, 1 failed", "smoother: 2 of 2 passed"]
    assert counts_in_words([verdict("", "a", None)]) == ["data: 0 of 1 passed, 1 noted"]


@pytest.mark.parametrize(("words", "text"), [("a", "a"), ("ab", "a and b"), ("abc", "a, b and c")])
def test_words_are_listed_as_in_a_sentence(words, text):
    assert joined_words(list(words)) == text
