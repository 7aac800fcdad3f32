"""Whether each estimate may be used, and what to do where it may not."""

from collections.abc import Iterable

from auvid_cli.data.check import Check
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.report.notation import filter_label
from auvid_cli.report.page.parts import Card, Cards, Part, TablePart, Words
from auvid_cli.report.sentence import sentence
from auvid_cli.report.table import ERROR_DIGITS, Cell, Column, Table, number

_VERDICTS = {True: "pass", False: "FAIL", None: "note"}


def judgement_cards(evaluation: Evaluation) -> Cards:
    """Return a verdict for each filter: one sentence with what to do, and the numbers that everybody asks for."""
    judgements = evaluation.judgements()
    cards = []
    for row in evaluation.summary:
        numbers = {"mean NIS": number(row.mean_nis, ERROR_DIGITS + 1), "processor time": f"{row.cpu_time_s:.2g} s"}
        if row.average_steady_state_error_percent is not None:
            error = number(row.average_steady_state_error_percent, ERROR_DIGITS + 1)
            numbers = {"average error": error and f"{error} %", **numbers}
        cards.append(judgement_card(row.filter, judgements[row.filter], {k: v for k, v in numbers.items() if v}))
    return Cards(cards)


def judgement_card(filter_name: str, judgement: Judgement, numbers: dict[str, str]) -> Card:
    """Return the verdict on one filter."""
    label = filter_label(filter_name)
    says = (
        sentence(judgement.advice) if judgement.advice else f"Use the estimate of {label}: nothing speaks against it."
    )
    return Card(label, filter_name, str(judgement.grade), says, numbers)


def check_parts(checks: Iterable[Check]) -> list[Part]:
    """Return verdicts as a table, those that did not pass first, with what to do about them."""
    ordered = sorted(checks, key=lambda check: (check.passed is True, check.passed is None))
    if not ordered:
        return []
    filters = any(check.filter for check in ordered)
    headers = ("verdict", *(["estimator"] if filters else []), "of", "check", "found", "may be", "what to do")
    rows: list[list[Cell]] = [
        [
            _VERDICTS[check.passed],
            *([filter_label(check.filter)] if filters else []),
            *(check.subject, check.check, check.statistic, check.threshold, check.advice),
        ]
        for check in ordered
    ]
    counts = {word: sum(check.passed is passed for check in ordered) for passed, word in _VERDICTS.items()}
    columns = tuple(Column(header, numeric=False) for header in headers)
    told = counts["FAIL"] + counts["note"]
    parts: list[Part] = [Words([f"{counts['FAIL']} failed, {counts['note']} worth knowing, {counts['pass']} passed."])]
    if told:
        parts.append(TablePart(Table("noteworthy", "Failed or worth knowing", columns, rows[:told]), sortable=True))
    if counts["pass"]:
        passed = Table("passed", f"Passed: {counts['pass']}", columns[:-1], [row[:-1] for row in rows[told:]])
        parts.append(TablePart(passed, sortable=True, folded=True))
    return parts
