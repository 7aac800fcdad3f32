"""Screens of designs, missing terms, imports and comparisons."""

from collections import Counter
from collections.abc import Sequence
from math import isnan
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.text import Text

from auvid_cli.config.settings import Spans
from auvid_cli.data.findings import ScoredTerm, TermFindings
from auvid_cli.evaluation.differences import ComparedValue, Comparison
from auvid_cli.logs.measurements import ImportSummary
from auvid_cli.report.screen_table import MISSING, narrowed, printed, screen_table
from auvid_cli.report.table import Cell, Column, Table

if TYPE_CHECKING:
    from auvid_cli.design.search import Design
    from auvid_cli.design.trials import Trial

_DESIGN_DIGITS = 3
_TERM_DIGITS = 3


def print_design(console: Console, design: "Design") -> None:
    """Print manoeuvres beside each other on vehicles that the search has not seen, and what is to be made of it."""
    spiral = design.trials["spiral"]
    columns = (
        Column("manoeuvre", numeric=False),
        *(Column(header) for header in ("mean sd (%)", "worst sd (%)", "gain", "least", "largest")),
        *(Column(header) for header in ("outside", "box (m)", "depth (m)")),
    )
    rows = [_design_row(name, trial, spiral) for name, trial in design.trials.items()]
    console.print(
        screen_table(console, Table("design", "Design", columns, rows), _DESIGN_DIGITS, unbroken=["manoeuvre"])
    )
    for line in sentences(design):
        console.print(Text(line), soft_wrap=True)


def _design_row(name: str, trial: "Trial", spiral: "Trial") -> list[Cell]:
    home = [flight.extent for flight in trial.flights if flight.extent is not None]
    counted: list[Cell] = [f"{trial.outside} of {len(trial.flights)}"]
    if not home:
        return [name, None, None, None, None, None, *counted, None, None]
    gains, percent = trial.gain_over(spiral), trial.percent()
    percent = percent[percent > 0.0]
    gain: list[Cell] = [None] * 3
    if gains.size:
        gain = [trial.mean_gain_over(spiral), float(gains.min()), float(gains.max())]
    sizes: list[Cell] = [max(extent.box for extent in home), max(extent.depth for extent in home)]
    return [name, float(np.exp(np.log(percent).mean())), float(percent.max()), *gain, *counted, *sizes]


def sentences(design: "Design") -> list[str]:
    """Say what is to be made of a design, a line each."""
    chosen, spiral = design.trials[design.chosen], design.trials["spiral"]
    number = len(spiral.flights)
    gain = f"x{design.gain:.2f} over the spiral"
    if design.is_own and design.is_worth_while:
        lines = ["No designed run keeps the envelope as the spiral does: the spiral is what is written."]
    elif design.is_own:
        lines = [f"The spiral is as good ({gain} on {number} vehicles not seen by the search): it is what is written."]
    elif design.chosen == "designed":
        lines = [f"The designed run gives {gain} on {number} vehicles not seen by the search."]
    else:
        said = f"{gain} on {number} vehicles not seen by the search"
        lines = [f"Best of all that was tried: {design.chosen} ({said}), which is what is written."]
    if chosen.outside:
        limits = dict.fromkeys(name for shares in chosen.excess for name, share in shares.items() if share > 0.0)
        how = f" ({', '.join(limits)})" if limits else ""
        lost = f", of which {chosen.lost} are lost" if chosen.lost else ""
        lines.append(f"It leaves the envelope with {chosen.outside} of {number} vehicles{how}{lost}: keep room for it.")
    if np.isfinite(design.gain) and spiral.outside and not design.is_own:
        lines.append(f"The spiral itself leaves the envelope with {spiral.outside} of them.")
    if design.soonest is not None and not design.is_own:
        lines.append(
            f"After {design.soonest:.0f} of {design.posterior.time[-1]:.0f} s it has told what the spiral tells in all."
        )
    end = design.posterior.time[-1]
    course = ", ".join(f"{percent:.2g} % after {time:.0f} s" for time, percent in design.growth if time <= end)
    lines.append(f"Mean sd with the vehicle as it is believed to be: {course}.")
    if longer := [f"{percent:.2g} % in {time:.0f} s" for time, percent in design.growth if time > end]:
        lines.append(f"A longer run of this kind, if there is room for it: {', '.join(longer)}.")
    lines += [f"{poor.symbol} stays at {poor.percent:.2g} %: {poor.why}." for poor in design.poor]
    return lines


def print_terms(console: Console, findings: TermFindings) -> None:
    """Print what was looked at, and what came of it."""
    columns = (
        *(Column(header, numeric=False) for header in ("look", "term")),
        *(Column(header) for header in ("size", "+-", "gain", "made up %", "held-out gain", "gain of all")),
        Column("verdict", numeric=False),
    )
    rows = [_term_row(term) for term in findings.scored]
    console.print(screen_table(console, Table("terms", "Terms", columns, rows), _TERM_DIGITS))
    console.print(
        Text(
            f"{findings.n_candidates} candidates, fitted to {_of(findings.fitted)}, held out {_of(findings.held_out)}. "
            "Gain: in log-likelihood, before a fit with the term and after it; made up: of what the term does, the "
            "share that the model's own coefficients hide; not kept: another fits better, or those found after it make "
            "it needless; no better held out: the data that it was not fitted to do not speak for it."
        )
    )
    for term in findings.found:
        if term.like:
            console.print(Text(f"These data hardly tell {term.term} from {term.like}."))
    console.print(Text(_conclusion(findings)))


def _term_row(term: ScoredTerm) -> list[Cell]:
    sizes: list[Cell] = [term.size, term.standard_deviation, term.gain, 100.0 * term.made_up_share]
    return [str(term.look), term.term, *sizes, term.held_out_gain, term.evidence_gain, _verdict(term)]


def _verdict(term: ScoredTerm) -> str:
    if term.found:
        return "found"
    if term.held_out_gain is None:
        return ""
    return "not kept" if term.is_likelier else "no better held out"


def _of(spans: Spans) -> str:
    return ", ".join(f"{begin:.4g} to {end:.4g} s" for begin, end in spans)


def _conclusion(findings: TermFindings) -> str:
    if findings.found:
        return f"Found: {', '.join(term.term for term in findings.found)}."
    tried = [term for term in findings.scored if term.held_out_gain is not None]
    if tried:
        return "Nothing is proposed: no candidate makes the held-out data, and all data, likelier than chance does."
    return "Nothing is proposed: no candidate explains anything."


def print_import_report(console: Console, summaries: Sequence[ImportSummary], remarks: Sequence[str]) -> None:
    """Print rate, span and losses of each sensor and input, and under the table what else was done."""
    headers = "rate Hz", "samples", "from s", "to s", "missing", "duplicates"
    rows: list[list[Cell]] = [
        [
            summary.name,
            f"{summary.rate:.4g}",
            str(summary.samples),
            *(f"{time:.7g}" for time in summary.span),
            str(summary.missing),
            str(summary.duplicates),
        ]
        for summary in summaries
    ]
    columns = (Column("", numeric=False), *(Column(header) for header in headers))
    console.print(screen_table(console, Table("import", "Imported records", columns, rows), unbroken=("",)))
    of_remark: dict[str, list[str]] = {}
    for summary in summaries:
        for remark in summary.remarks:
            of_remark.setdefault(remark, []).append(summary.name)
    for remark in (*(f"{', '.join(names)}: {remark}" for remark, names in of_remark.items()), *remarks):
        console.print(Text(remark))


# More differences than this are for those who ask for all.
_MOST = 20
_DIGITS, _DIFFERENCE_DIGITS = 6, 2
# Heading of the column that tells what differs among all.
_MARK = ""
# What gives way where the terminal is narrow, first to last.
_LEAST = "table", "may be"


def print_comparison(console: Console, comparison: Comparison, everything: bool) -> None:
    """Print the values that differ, the worst first, and how many agree.

    Parameters
    ----------
    everything : bool
        Whether all values are printed, in their order, not only those that differ.
    """
    differing = comparison.differing()
    shown = comparison.values if everything else differing[:_MOST]
    if shown:
        table = _beside_each_other(shown)
        console.print(narrowed(console, table if everything else table.without(_MARK), _LEAST))
    if len(differing) > _MOST and not everything:
        console.print(Text(f"and {len(differing) - _MOST} more that differ; --verbose prints all values"))
    for table in dict.fromkeys(value.table for value in comparison.values):
        of_table = [value for value in comparison.values if value.table == table]
        counts = Counter(value.column or "whole rows" for value in of_table if not value.agrees)
        others = ", ".join(f"{column} {count}" for column, count in counts.most_common())
        agreeing = f"{table}.csv: {len(of_table) - counts.total()} of {len(of_table)} values agree"
        console.print(Text(f"{agreeing}; others: {others}" if others else agreeing))
    if comparison.only_first:
        console.print(Text(f"only the first has {', '.join(comparison.only_first)}"))


def _beside_each_other(values: list[ComparedValue]) -> Table:
    columns = (
        *(Column(header, numeric=False) for header in (_MARK, "table", "of", "value")),
        *(Column(header) for header in ("first", "second", "difference", "may be")),
    )
    rows: list[list[Cell]] = [
        [
            "" if value.agrees else "DIFFERS",
            value.table,
            value.row,
            value.column,
            _cell(value.first),
            _cell(value.second),
            MISSING if isnan(value.difference) else printed(value.difference, _DIFFERENCE_DIGITS),
            MISSING if isnan(value.allowed) else printed(value.allowed, _DIFFERENCE_DIGITS),
        ]
        for value in values
    ]
    return Table("comparison", "Two results", columns, rows)


def _cell(text: str) -> str:
    try:
        return printed(float(text), _DIGITS)
    except ValueError:
        return text or MISSING
