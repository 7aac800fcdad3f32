"""Screens of designs, fits, missing terms, tuned noise, imports and comparisons."""

from collections import Counter
from collections.abc import Callable, Sequence
from math import isfinite, isinf, isnan
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.text import Text

from auvid_cli.config.settings import Spans
from auvid_cli.data.checks import ComparedValue, Comparison
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.findings import DisturbanceChoice, ScoredTerm, TermFindings, TunedNoise, Tuning
from auvid_cli.evaluation.innovations import is_from_ahrs
from auvid_cli.evaluation.judgement import LARGEST_PORTMANTEAU, Grade, Judgement, whiteness
from auvid_cli.logs.measurements import ImportSummary
from auvid_cli.report.table import Cell, Column, Table, UnitCell, tabulated, text_column
from auvid_cli.report.text_tables import MISSING, narrowed, print_texts, printed, screen_table

if TYPE_CHECKING:
    from auvid_cli.design.search import Design
    from auvid_cli.design.trials import Trial

_MAX_DIFFERENCES = 20  # without --verbose
_DIGITS = 6
_DIFFERENCE_DIGITS = 2
# Heading of the column that marks values that differ.
_MARK = ""
# Columns left out on a narrow terminal, in this order.
_DROPPED_OF_COMPARISON = "table", "difference", "allowed"
_DROPPED_OF_TERMS = "imitated %", "step", "predicted"
_DESIGN_DIGITS = 3
_TERM_DIGITS = 3
_TUNING_DIGITS = 3
_PREFIX = "identification."
# An estimate of the smoother and its judgement.
Judged = tuple[Estimate, Judgement]


_DESIGN_NOTE = (
    "Mean sd, worst sd: standard deviation of the coefficients in percent of their values, geometric mean and largest. "
    "Gain: mean sd of the spiral divided by that of the manoeuvre; lowest and highest of the trial vehicles. Left "
    "limits: number of trial vehicles. Box, depth: largest extent of the track."
)


def print_design(console: Console, design: "Design") -> None:
    """Print the manoeuvres side by side, on trial vehicles that the search has not seen, and the conclusions."""
    spiral = design.trials["spiral"]
    headers = (
        "mean sd (%)",
        "worst sd (%)",
        "gain",
        "lowest gain",
        "highest gain",
        "left limits",
        "box (m)",
        "depth (m)",
    )
    columns = text_column("manoeuvre"), *map(Column, headers)
    rows = [_design_row(name, trial, spiral) for name, trial in design.trials.items()]
    console.print(
        screen_table(console, Table("design", "Design", columns, rows), _DESIGN_DIGITS, unbroken=["manoeuvre"])
    )
    print_texts(console, [_DESIGN_NOTE])
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
    gain = f"a gain of {design.gain:.2f} over the spiral"
    if design.keeps_spiral and design.is_worth_while:
        lines = ["No designed run stays within the limits as well as the spiral: the spiral is written."]
    elif design.keeps_spiral:
        lines = [
            f"The spiral is as good, and is written: the search found {gain} on {number} vehicles that it did not use."
        ]
    elif design.chosen == "designed":
        lines = [f"The designed run gives {gain} on {number} vehicles that the search did not use."]
    else:
        result = f"{gain} on {number} vehicles that the search did not use"
        lines = [f"The best run is {design.chosen} ({result}); it is written."]
    if chosen.n_outside:
        limits = dict.fromkeys(name for shares in chosen.excess for name, share in shares.items() if share > 0.0)
        how = f" ({', '.join(limits)})" if limits else ""
        lost = f", and {chosen.n_lost} went out of control" if chosen.n_lost else ""
        lines.append(f"{chosen.n_outside} of {number} trial vehicles left the limits{how}{lost}: plan a margin.")
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
    for poor in design.weak_coefficients:
        percent = f"{poor.percent:.0f}" if poor.percent >= 100.0 else f"{poor.percent:.2g}"
        lines.append(f"{poor.symbol} stays at {percent} %: {poor.why}.")
    return lines


def print_terms(console: Console, findings: TermFindings) -> None:
    """Print the candidate terms and the result of the search."""
    cells: dict[Column, Callable[[ScoredTerm], Cell]] = {
        text_column("step"): lambda term: str(term.look),
        text_column("term"): lambda term: term.term,
        Column("size"): lambda term: term.size,
        Column("+-"): lambda term: term.standard_deviation,
        Column("predicted"): lambda term: term.gain,
        Column("imitated %"): lambda term: 100.0 * term.made_up_share,
        Column("held out"): lambda term: term.held_out_gain,
        Column("all data"): lambda term: term.evidence_gain,
        text_column("verdict"): _verdict,
    }
    table = tabulated("terms", "Terms", findings.scored, cells)
    console.print(narrowed(console, table, _DROPPED_OF_TERMS, _TERM_DIGITS))
    console.print(
        Text(
            f"{findings.n_candidates} candidates, fitted to {_of(findings.fitted)}, held out {_of(findings.held_out)}. "
            "Predicted: gain in log-likelihood, computed before the fit. Held out, all data: gain after the "
            "fit. Imitated: share of the effect of the term that the coefficients of the model can imitate. Not "
            "kept: another term fits better or replaces it. Not confirmed: the term does not improve the fit of the "
            "held-out data."
        )
    )
    alike = [f"These data cannot separate {term.term} from {term.like}." for term in findings.found if term.like]
    print_texts(console, [*alike, _conclusion(findings)])


def _verdict(term: ScoredTerm) -> str:
    if term.found:
        return "found"
    if term.held_out_gain is None:
        return ""
    return "not kept" if term.is_likelier else "not confirmed"


def _of(spans: Spans) -> str:
    return ", ".join(f"{begin:.4g} to {end:.4g} s" for begin, end in spans)


def _conclusion(findings: TermFindings) -> str:
    if findings.found:
        return f"Found: {', '.join(term.term for term in findings.found)}."
    tried = [term for term in findings.scored if term.held_out_gain is not None]
    if tried:
        return "No term is proposed: no candidate fits the held-out data and all data better than chance."
    return "No term is proposed: no candidate improves the fit."


def print_tuning(console: Console, tuning: Tuning, fits: Sequence[Judged]) -> None:
    """Print the tuned noise, and the innovations of the smoother before and after if it was fitted."""
    console.print(screen_table(console, tabulated("noise", "Noise", tuning.noises, _NOISE_CELLS), _TUNING_DIGITS))
    for finding, applies, consequence in _FINDINGS:
        if names := [noise.setting.removeprefix(_PREFIX) for noise in tuning.noises if applies(noise)]:
            console.print(Text(f"The data {finding} {', '.join(names)}: {consequence}."))
    if fits:
        console.print(screen_table(console, _estimates(*fits), _TUNING_DIGITS))
        print_texts(console, (_BEFORE_AND_AFTER, *([_OF_AHRS] if is_from_ahrs(fits[0][0]) else [])))
    if not tuning.converged:
        advice = "run `auvid tune` again with --set and the new tuned.yaml, or use data with more turns"
        console.print(Text(f"The search has not converged: {advice}."))


def objection_to_tuning(judgements: Sequence[Judgement]) -> str:
    """Return why the tuned noise is not recommended, by the judgements before and after; otherwise empty."""
    if not judgements:
        return ""
    before, after = judgements
    grades = [*Grade]
    if not after.is_against or grades.index(after.grade) <= max(map(grades.index, (before.grade, Grade.DOUBTFUL))):
        return ""
    return f"not recommended: with the tuned noise the smoother is {after}"


def choice_text(choice: DisturbanceChoice) -> str:
    """Return whether a disturbance is estimated, and why."""
    criterion = f"{choice.n_parameters} more parameters need {choice.needed:.3g} (Bayesian information criterion)"
    what = "kept" if choice.is_kept else "left out"
    gain = f"it changes the log-likelihood by {choice.gain:+.4g}"
    return f"a disturbance that is correlated in time is {what}: {gain}; {criterion}"


def _is_flat(noise: TunedNoise) -> bool:
    return noise.low == 0.0 and isinf(noise.high)


def _is_bounded(noise: TunedNoise) -> bool:
    return noise.low == 0.0 and isfinite(noise.high)


# Result, condition and consequence for noise that the data determine only in part.
_FINDINGS: tuple[tuple[str, Callable[[TunedNoise], bool], str], ...] = (
    (
        "only give an upper limit of",
        lambda noise: _is_bounded(noise) and not noise.is_time_constant,
        "any smaller value fits as well",
    ),
    (
        "do not determine",
        lambda noise: _is_flat(noise) and not noise.is_time_constant,
        "any smaller value fits as well",
    ),
    (
        "only give an upper limit of",
        lambda noise: _is_bounded(noise) and noise.is_time_constant,
        "white process noise fits as well",
    ),
    (
        "only give a lower limit of",
        lambda noise: noise.low > 0.0 and not isfinite(noise.high),
        "any larger value fits as well",
    ),
    ("do not determine", lambda noise: _is_flat(noise) and noise.is_time_constant, "any value fits"),
)


def _most_likely(noise: TunedNoise) -> Cell:
    # If the data give no lower limit, the most likely value is the smallest that the search allows.
    is_none = noise.low == 0.0 and noise.tuned < 1e-3 * noise.high and not noise.is_time_constant
    return "none" if is_none else noise.tuned


_NOISE_CELLS: dict[Column, Callable[[TunedNoise], Cell]] = {
    text_column("noise"): lambda noise: noise.setting.removeprefix(_PREFIX),
    text_column("unit"): lambda noise: UnitCell(noise.unit),
    Column("stated"): lambda noise: noise.stated,
    Column("found"): _most_likely,
    Column("95 % from"): lambda noise: None if isnan(noise.low) else noise.low,
    Column("to"): lambda noise: None if isnan(noise.high) else noise.high if isfinite(noise.high) else "no limit",
}


_BEFORE_AND_AFTER = (
    "NIS: squared prediction error / expected variance; 1 is right. Correlated in time: successive prediction "
    f"errors are similar; above {LARGEST_PORTMANTEAU:g} sigma it is more than chance."
)
_OF_AHRS = (
    "The attitude is that of an AHRS: its errors are always correlated in time. This alone does not make an estimate "
    "doubtful, because the standard deviations allow for it."
)


def _estimates(before: Judged, after: Judged) -> Table:
    """Return mean NIS and autocorrelation of the innovations of each sensor, and the judgement."""
    rows: list[list[Cell]] = []
    for sensor in before[0].innovations:
        nis: list[Cell] = [estimate.innovations[sensor].sums().mean_nis for estimate, _ in (before, after)]
        rows.append([f"mean NIS of {sensor}", *nis])
        memory: list[Cell] = [whiteness(estimate.statistics(sensor)).portmanteau for estimate, _ in (before, after)]
        rows.append([f"errors of {sensor} correlated in time, sigma", *memory])
    grades: list[Cell] = [judgement.grade for _, judgement in (before, after)]
    columns = Column("smoother", numeric=False), Column("as stated"), Column("tuned")
    return Table("tuned", "Before and after", columns, [*rows, ["judgement", *grades]])


def print_import_report(console: Console, summaries: Sequence[ImportSummary], remarks: Sequence[str]) -> None:
    """Print rate, span and losses of each sensor and input, and the remarks of the import."""
    cells: dict[Column, Callable[[ImportSummary], Cell]] = {
        text_column(""): lambda summary: summary.name,
        Column("rate Hz"): lambda summary: f"{summary.rate:.4g}",
        Column("samples"): lambda summary: str(summary.samples),
        Column("from s"): lambda summary: f"{summary.span[0]:.7g}",
        Column("to s"): lambda summary: f"{summary.span[1]:.7g}",
        Column("missing"): lambda summary: str(summary.missing),
        Column("duplicates"): lambda summary: str(summary.duplicates),
    }
    table = tabulated("import", "Imported records", summaries, cells)
    console.print(screen_table(console, table, unbroken=("",)))
    of_remark: dict[str, list[str]] = {}
    for summary in summaries:
        for remark in summary.remarks:
            of_remark.setdefault(remark, []).append(summary.name)
    print_texts(console, [*(f"{', '.join(names)}: {remark}" for remark, names in of_remark.items()), *remarks])


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
        table = tabulated("comparison", "Two results", shown, _COMPARED)
        console.print(narrowed(console, table if everything else table.without(_MARK), _DROPPED_OF_COMPARISON))
    if len(differing) > _MAX_DIFFERENCES and not everything:
        console.print(Text(f"and {len(differing) - _MAX_DIFFERENCES} more that differ; --verbose prints all values"))
    for table in dict.fromkeys(value.table for value in comparison.values):
        of_table = [value for value in comparison.values if value.table == table]
        counts = Counter(value.column or "whole rows" for value in of_table if not value.agrees)
        others = ", ".join(f"{column} {count}" for column, count in counts.most_common())
        agreeing = f"{table}.csv: {len(of_table) - counts.total()} of {len(of_table)} values agree"
        console.print(Text(f"{agreeing}; values that differ: {others}" if others else agreeing))
    if comparison.only_first:
        console.print(Text(f"only the first has {', '.join(comparison.only_first)}"))


def _cell(text: str) -> str:
    try:
        return printed(float(text), _DIGITS)
    except ValueError:
        return text or MISSING


def _difference(value: float) -> str:
    return MISSING if isnan(value) else printed(value, _DIFFERENCE_DIGITS)


_COMPARED: dict[Column, Callable[[ComparedValue], Cell]] = {
    text_column(_MARK): lambda value: "" if value.agrees else "DIFFERS",
    text_column("table"): lambda value: value.table,
    text_column("row"): lambda value: value.row,
    text_column("value"): lambda value: value.column,
    Column("first"): lambda value: _cell(value.first),
    Column("second"): lambda value: _cell(value.second),
    Column("difference"): lambda value: _difference(value.difference),
    Column("allowed"): lambda value: _difference(value.allowed),
}
