"""Terms that a model lacks, for the terminal: the best of each look, and what was found."""

from rich.console import Console
from rich.text import Text

from auvid_cli.config.spans import Spans
from auvid_cli.data.term_findings import ScoredTerm, TermFindings
from auvid_cli.report.screen_table import screen_table
from auvid_cli.report.table import Cell, Column, Table

_DIGITS = 3


def print_terms(console: Console, findings: TermFindings) -> None:
    """Print what was looked at, and what came of it."""
    columns = (
        *(Column(header, numeric=False) for header in ("look", "term")),
        *(Column(header) for header in ("size", "+-", "gain", "made up %", "held-out gain", "gain of all")),
        Column("verdict", numeric=False),
    )
    rows = [_row(term) for term in findings.scored]
    console.print(screen_table(console, Table("terms", "Terms", columns, rows), _DIGITS))
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


def _row(term: ScoredTerm) -> list[Cell]:
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
