"""Whether each estimate may be used, and what to do where it may not."""

from collections.abc import Iterable, Sequence

from auvid_cli.config.filter_name import JUDGE
from auvid_cli.data.check import Check
from auvid_cli.evaluation.estimate_checks import JUDGED
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.evaluation.judgement import Judgement
from auvid_cli.report.layout import NIS_MEANS
from auvid_cli.report.notation import filter_label
from auvid_cli.report.page.parts import Card, Cards, Part, TablePart, Words
from auvid_cli.report.sentence import sentence
from auvid_cli.report.shared_checks import Advice, advices, counts_in_words, shared_checks, whose
from auvid_cli.report.table import ERROR_DIGITS, Cell, Column, Table, number

_VERDICTS = {True: "pass", False: "FAIL", None: "note"}
# Verdicts, with what to do, that stand beside the cards; all stand in the list of checks.
_MOST_TOLD = 6


def judgement_parts(evaluation: Evaluation, checks: Sequence[Check]) -> list[Part]:
    """Return a verdict for each filter, with the numbers that everybody asks for, and what checks have to say.

    A verdict is one sentence with what to do.
    """
    judgements = evaluation.judgements()
    told = shared_checks(check for check in checks if check.check != JUDGED)
    cards = []
    for row in evaluation.summary:
        numbers: dict[str, str | None] = {}
        if row.average_steady_state_error_percent is not None:
            error = number(row.average_steady_state_error_percent, ERROR_DIGITS + 1)
            numbers["average error"] = error and f"{error} %"
        for each in evaluation.consistency:
            if each.filter == row.filter:
                numbers[f"NIS of {each.sensor}"] = number(each.mean_nis, ERROR_DIGITS)
        numbers["processor time"] = f"{row.cpu_time_s:.2g} s"
        own = [each.check.passed for each in told if row.filter in each.filters]
        shown = {name: text for name, text in numbers.items() if text}
        cards.append(judgement_card(row.filter, judgements[row.filter], shown, own.count(False), own.count(None)))
    names = [row.filter for row in evaluation.summary]
    sentences = [_in_words(advice, names) for advice in advices(told)]
    if len(sentences) > _MOST_TOLD:
        sentences[_MOST_TOLD:] = [f"{len(sentences) - _MOST_TOLD} more stand below, in the list of checks."]
    says: list[Part] = [Words(sentences, listed=True)] if sentences else []
    return [Cards(cards), *says, Words([NIS_MEANS])]


def judgement_card(
    filter_name: str, judgement: Judgement, numbers: dict[str, str], failed: int = 0, noted: int = 0
) -> Card:
    """Return the verdict on one filter, given how many checks failed or are worth knowing."""
    label = filter_label(filter_name)
    if judgement.advice:
        says = sentence(judgement.advice)
    elif failed:
        says = f"It is judged sound, yet {failed} check{'s' * (failed > 1)} failed: first do what stands below."
    else:
        says = f"Use it; its checks have {noted} note{'s' * (noted > 1)}, to be read below." if noted else "Use it."
    return Card(label, filter_name, str(judgement.grade), says, numbers)


def _in_words(advice: Advice, names: Sequence[str]) -> str:
    """Say what failed or is worth knowing, of whom, and what to do."""
    found = f": {advice.shared[0].check.statistic}" if len(advice.shared) == 1 else ""
    verb = "Failed" if advice.failed else "Noted"
    return f"{verb} of {whose(advice.filters, names)}: {advice.what}{found}. {advice.text}"


def check_parts(checks: Iterable[Check]) -> list[Part]:
    """Return verdicts as tables: what did not pass, once for all estimates that share it, with advice; and the rest."""
    ordered = list(checks)
    if not ordered:
        return []
    names = list(dict.fromkeys(check.filter for check in ordered))
    filters = any(names)
    headers = ("verdict", *(["estimator"] if filters else []), "of", "check", "found", "may be", "what to do")

    def row(check: Check, of: Sequence[str]) -> list[Cell]:
        return [
            _VERDICTS[check.passed],
            *([whose(of, names)] if filters else []),
            *(check.subject, check.check, check.statistic, check.threshold, check.advice),
        ]

    told = [row(each.check, each.filters) for each in shared_checks(ordered)]
    passed = [row(check, [check.filter])[:-1] for check in ordered if check.passed]
    columns = tuple(Column(header, numeric=False) for header in headers)
    parts: list[Part] = [Words([f"{counted}." for counted in counts_in_words(ordered)])]
    if told:
        notes = ("Found is of the smoother, where it is among those.",) if JUDGE in names and len(names) > 1 else ()
        parts.append(
            TablePart(Table("noteworthy", "Failed or worth knowing", columns, told, notes=notes), sortable=True)
        )
    if passed:
        table = Table("passed", f"Passed: {len(passed)}", columns[:-1], passed)
        parts.append(TablePart(table, sortable=True, folded=True))
    return parts
