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
    """Print the manoeuvres side by side, on trial vehicles that the search has not seen, and the conclusions."""
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
    home = [flight.extent for flight in trial.runs if flight.extent is not None]
    counted: list[Cell] = [f"{trial.n_outside} of {len(trial.runs)}"]
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
    """Return the conclusions of a design, a sentence each."""
    chosen, spiral = design.trials[design.chosen], design.trials["spiral"]
    number = len(spiral.runs)
    gain = f"x{design.gain:.2f} over the spiral"
    if design.keeps_spiral and design.is_worth_while:
        lines = ["No designed run stays within the limits as well as the spiral: the spiral is written."]
    elif design.keeps_spiral:
        lines = [f"The spiral is as good ({gain} on {number} vehicles not seen by the search): the spiral is written."]
    elif design.chosen == "designed":
        lines = [f"The designed run gives {gain} on {number} vehicles not seen by the search."]
    else:
        result = f"{gain} on {number} vehicles not seen by the search"
        lines = [f"The best run is {design.chosen} ({result}); it is written."]
    if chosen.n_outside:
        limits = dict.fromkeys(name for shares in chosen.excess for name, share in shares.items() if share > 0.0)
        how = f" ({', '.join(limits)})" if limits else ""
        lost = f", and {chosen.n_lost} went out of control" if chosen.n_lost else ""
        lines.append(f"{chosen.n_outside} of {number} trial vehicles left the limits{how}{lost}: allow room for it.")
    if np.isfinite(design.gain) and spiral.n_outside and not design.keeps_spiral:
        lines.append(f"With the spiral, {spiral.n_outside} of them left the limits.")
    if design.time_to_match is not None and not design.keeps_spiral:
        when = f"After {design.time_to_match:.0f} of {design.posterior.time[-1]:.0f} s"
        lines.append(f"{when} it is as informative as the whole spiral.")
    end = design.posterior.time[-1]
    course = ", ".join(
        f"{percent:.2g} % after {time:.0f} s" for time, percent in design.accuracy_over_time if time <= end
    )
    lines.append(f"Mean sd for the expected vehicle: {course}.")
    if longer := [f"{percent:.2g} % in {time:.0f} s" for time, percent in design.accuracy_over_time if time > end]:
        lines.append(f"Mean sd of a longer run of this kind: {', '.join(longer)}.")
    lines += [f"{poor.symbol} stays at {poor.percent:.2g} %: {poor.why}." for poor in design.weak_coefficients]
    return lines


def print_terms(console: Console, findings: TermFindings) -> None:
    """Print the candidate terms and the result of the search."""
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
            "Gain: in log-likelihood, predicted before the fit and found after it. Made up: share of the effect of the "
            "term that the coefficients of the model can imitate. Not kept: another term fits better or makes it "
            "needless. No better held out: the term does not improve the fit of the held-out data."
        )
    )
    for term in findings.found:
        if term.like:
            console.print(Text(f"These data cannot separate {term.term} from {term.like}."))
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
        return "No term is proposed: no candidate fits the held-out data and all data better than chance."
    return "No term is proposed: no candidate improves the fit."


def print_import_report(console: Console, summaries: Sequence[ImportSummary], remarks: Sequence[str]) -> None:
    """Print rate, span and losses of each sensor and input, and the remarks of the import."""
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


_MAX_DIFFERENCES = 20  # without --verbose
_DIGITS = 6
_DIFFERENCE_DIGITS = 2
# Heading of the column that tells what differs among all.
_MARK = ""
# Columns left out on a narrow terminal, in this order.
_DROPPED_OF_COMPARISON = "table", "allowed"


def print_comparison(console: Console, comparison: Comparison, everything: bool) -> None:
    """Print the values that differ, the worst first, and how many agree.

    Parameters
    ----------
    everything : bool
        Whether all values are printed, in their order, not only those that differ.
    """
    differing = comparison.differing()
    shown = comparison.values if everything else differing[:_MAX_DIFFERENCES]
    if shown:
        table = _beside_each_other(shown)
        console.print(narrowed(console, table if everything else table.without(_MARK), _DROPPED_OF_COMPARISON))
    if len(differing) > _MAX_DIFFERENCES and not everything:
        console.print(Text(f"and {len(differing) - _MAX_DIFFERENCES} more that differ; --verbose prints all values"))
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
        *(Column(header) for header in ("first", "second", "difference", "allowed")),
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
