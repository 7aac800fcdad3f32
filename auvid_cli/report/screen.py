"""What a run found, for the terminal."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table as ScreenTable
from rich.text import Text

from auvid_cli.config.filter_name import JUDGE
from auvid_cli.data.check import Check
from auvid_cli.evaluation.assessment import Identifiability
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.bounds import assessment_sentences, bounds_table, holding_sentence
from auvid_cli.report.judgements import judgement_sentences
from auvid_cli.report.layout import (
    NIS_MEANS,
    PAPER,
    accuracy,
    consistency,
    estimates,
    mark_explained,
    rejections,
    runs,
    unobserved,
)
from auvid_cli.report.screen_table import encodable, fits, narrowed, screen_table
from auvid_cli.report.shared_checks import SharedCheck, advices, counts_in_words, shared_checks, whose
from auvid_cli.report.table import ERROR_DIGITS, Cell, Column, Table

# What gives way where the terminal is narrow, first to last.
_LEAST_OF_BOUNDS = "goes with", "unit", "value", "bound", "mostly from"
_VERDICTS = {True: "pass", False: "FAIL", None: "note"}
_STYLES = {"FAIL": "bold red", "note": "yellow"}


def print_summary(console: Console, evaluation: Evaluation) -> None:
    """Print coefficients, averages, cost, judgement and consistency of every filter.

    Parameters
    ----------
    console : rich.console.Console
        Where it is narrow, units, true values and the paper's columns are left out, and named below the table.
    evaluation : Evaluation
    """
    if console.quiet:
        # To try what fits takes a tenth of a second.
        return
    filters = [row.filter for row in evaluation.summary]
    notes = dict.fromkeys(mark_explained(evaluation))
    if evaluation.coefficients:
        for table in accuracy(evaluation):
            console.print(Text(table.title))
            console.print(narrowed(console, table, ("unit", "true", PAPER), ERROR_DIGITS + 1))
            notes |= dict.fromkeys(table.notes)
        for screen in _estimate_tables(console, evaluation, filters):
            console.print(screen)
        notes |= dict.fromkeys(estimates(evaluation, filters).notes)
    console.print(screen_table(console, runs(evaluation), unbroken=("filter", "judgement")))
    for text in judgement_sentences(evaluation.judgements(), with_sound=False):
        console.print(Text(text))
    console.print(screen_table(console, consistency(evaluation), ERROR_DIGITS + 1, unbroken=("NIS of",)))
    console.print(Text(NIS_MEANS))
    explained = [encodable(console, text) for text in notes]
    for text in [*explained, *evaluation.remarks, *unobserved(evaluation), *rejections(evaluation)]:
        console.print(Text(text))


def print_files(console: Console, files: Sequence[Path]) -> None:
    """Print in which folders files are, and how many."""
    for folder, count in Counter(path.parent for path in files).items():
        line = f"{count} {'file' if count == 1 else 'files'} in {folder}"
        console.print(Text(line), soft_wrap=True)


def print_checks(console: Console, checks: Sequence[Check], passed: bool) -> None:
    """Count verdicts, and print those that did not pass, once for all estimates that share them, with what to do.

    Parameters
    ----------
    console : rich.console.Console
    checks : sequence of Check
    passed : bool
        Whether all are printed, also those that passed, and of every estimate by itself.
    """
    names = list(dict.fromkeys(check.filter for check in checks))
    shared = shared_checks(checks)
    print_check_counts(console, checks)
    if passed:
        for name in names:
            console.print(Text(f"{whose([name])}:"))
            own = [SharedCheck(check, (name,)) for check in checks if check.filter == name]
            console.print(screen_table(console, _checks(own, [name]), styles=_STYLES))
    elif shared:
        console.print(screen_table(console, _checks(shared, names), styles=_STYLES))
        if len(names) > 1:
            shown = whose([JUDGE if JUDGE in names else names[0]])
            console.print(Text(f"Found is of the {shown}, where it is among those; of each estimate with --verbose."))
            console.print()
    for advice in advices(shared):
        only = f", {whose(advice.filters)}" if len(advice.filters) < len(names) else ""
        console.print(Text(f"{advice.what}{only}: {advice.text}"))
        console.print()


def print_check_counts(console: Console, checks: Sequence[Check]) -> None:
    """Print how many verdicts passed, failed, or are worth knowing."""
    for line in counts_in_words(checks):
        console.print(Text(line))


def _checks(shared: Sequence[SharedCheck], names: Sequence[str]) -> Table:
    columns = tuple(Column(header, numeric=False) for header in ("", "estimator", "of", "check", "found", "may be"))
    rows: list[list[Cell]] = [
        [
            *(_VERDICTS[check.passed], whose(filters, names)),
            *(check.subject, check.check, check.statistic, check.threshold),
        ]
        for check, filters in shared
    ]
    table = Table("checks", "Checks", columns, rows)
    return table if any(len(each.filters) < len(names) for each in shared) else table.without("estimator")


def print_identifiability(console: Console, identifiability: Identifiability) -> None:
    """Print bounds by class, what contributes and goes together, how bounds fall, and what cannot be observed."""
    table = bounds_table(identifiability)
    console.print(narrowed(console, table, _LEAST_OF_BOUNDS))
    for note in table.notes:
        console.print(Text(encodable(console, note)))
    for text in assessment_sentences(identifiability):
        console.print(Text(text))
    if identifiability.holding is not None:
        console.print(Text(holding_sentence(identifiability.holding)), soft_wrap=True)


def _estimate_tables(console: Console, evaluation: Evaluation, filters: list[str]) -> list[ScreenTable]:
    """Return one table with as much as there is room for, or else one for each filter."""
    full, bare = estimates(evaluation, filters), estimates(evaluation, filters, with_deviations=False)
    choices = [
        screen_table(console, table.without(*left_out), unbroken=("symbol", "unit"), left_out=(*words, *left_out))
        for table, words in ((full, ()), (bare, ("standard deviations",)))
        for left_out in ((), ("unit",))
    ]
    chosen = next((choice for choice in choices if fits(console, choice)), choices[-1] if len(filters) == 1 else None)
    if chosen is not None:
        return [chosen]
    return [choice for name in filters for choice in _estimate_tables(console, evaluation, [name])]
