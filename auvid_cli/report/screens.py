"""Tables of designs, missing terms and imports on the terminal."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.text import Text

from auvid_cli.config.settings import Spans
from auvid_cli.data.findings import ScoredTerm, TermFindings
from auvid_cli.logs.measurements import ImportSummary
from auvid_cli.report.screen_table import screen_table
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
    """Say what is to be made of a design, a line each."""
    chosen, spiral = design.trials[design.chosen], design.trials["spiral"]
    number = len(spiral.runs)
    gain = f"x{design.gain:.2f} over the spiral"
    if design.keeps_spiral and design.is_worth_while:
        lines = ["No designed run keeps the envelope as the spiral does: the spiral is what is written."]
    elif design.keeps_spiral:
        lines = [f"The spiral is as good ({gain} on {number} vehicles not seen by the search): it is what is written."]
    elif design.chosen == "designed":
        lines = [f"The designed run gives {gain} on {number} vehicles not seen by the search."]
    else:
        said = f"{gain} on {number} vehicles not seen by the search"
        lines = [f"Best of all that was tried: {design.chosen} ({said}), which is what is written."]
    if chosen.n_outside:
        limits = dict.fromkeys(name for shares in chosen.excess for name, share in shares.items() if share > 0.0)
        how = f" ({', '.join(limits)})" if limits else ""
        lost = f", of which {chosen.n_lost} are lost" if chosen.n_lost else ""
        lines.append(
            f"It leaves the envelope with {chosen.n_outside} of {number} vehicles{how}{lost}: keep room for it."
        )
    if np.isfinite(design.gain) and spiral.n_outside and not design.keeps_spiral:
        lines.append(f"The spiral itself leaves the envelope with {spiral.n_outside} of them.")
    if design.time_to_match is not None and not design.keeps_spiral:
        when = f"After {design.time_to_match:.0f} of {design.posterior.time[-1]:.0f} s"
        lines.append(f"{when} it has told what the spiral tells in all.")
    end = design.posterior.time[-1]
    course = ", ".join(
        f"{percent:.2g} % after {time:.0f} s" for time, percent in design.accuracy_over_time if time <= end
    )
    lines.append(f"Mean sd with the vehicle as it is believed to be: {course}.")
    if longer := [f"{percent:.2g} % in {time:.0f} s" for time, percent in design.accuracy_over_time if time > end]:
        lines.append(f"A longer run of this kind, if there is room for it: {', '.join(longer)}.")
    lines += [f"{poor.symbol} stays at {poor.percent:.2g} %: {poor.why}." for poor in design.weak_coefficients]
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
