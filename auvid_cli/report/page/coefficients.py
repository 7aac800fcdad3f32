"""Parts of the page on each coefficient: the list, its estimates over time, and their distance from the truth."""

from collections.abc import Mapping, Sequence
from math import isfinite

import numpy as np

from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.convergence import convergence_of, origin_of, shown_range
from auvid_cli.report.figures.limits import with_margin
from auvid_cli.report.figures.series import log_spaced
from auvid_cli.report.layout import mark_explained, marked, results_by_coefficient
from auvid_cli.report.notation import filter_label, unit_text
from auvid_cli.report.page.forest import deviations_from
from auvid_cli.report.page.parts import Plot, PlotLine, Plots
from auvid_cli.report.table import (
    DEVIATION_DIGITS,
    ERROR_DIGITS,
    Cell,
    Column,
    PlusMinus,
    Symbol,
    Table,
    UnitCell,
    number,
)

# Parts of a run of which the greatest distance of a settling coefficient is drawn: the least is where it crosses zero.
_SPANS = 300
# Start of the logarithmic time axis as a share of the run.
_FIRST_SHARE = 1e-3


def coefficient_list(evaluation: Evaluation, shares_of_prior: Mapping[str, Mapping[str, float]]) -> Table:
    """Lay out a row for each coefficient and filter.

    Parameters
    ----------
    evaluation : Evaluation
    shares_of_prior : mapping of mapping
        By filter and symbol, which share of the prior's standard deviation is left.
    """
    has_truth = any(row.true is not None for row in evaluation.coefficients)
    truth = ("true", "error %", "error / sd") if has_truth else ()
    headers = (*truth, "bound", "times bound", "% of prior")
    columns = (
        *(Column(header, numeric=False) for header in ("coefficient", "estimator")),
        *(Column("estimate ± sd"), Column("unit", numeric=False)),
        *(Column(header) for header in headers),
        Column("identified", numeric=False),
    )
    rows: list[list[Cell]] = []
    for by_filter in results_by_coefficient(evaluation).values():
        for name, row in by_filter.items():
            left = shares_of_prior[name][row.coefficient]
            rows.append(
                [
                    *(Symbol(row.coefficient), filter_label(name)),
                    *(marked(row, PlusMinus(row.estimate, row.standard_deviation)), UnitCell(row.unit)),
                    *(_against_truth(row) if has_truth else ()),
                    _rounded(row.cramer_rao_bound, DEVIATION_DIGITS),
                    _rounded(row.times_bound, DEVIATION_DIGITS + 1),
                    _rounded(100.0 * left, DEVIATION_DIGITS),
                    "yes" if row.identified else "† no",
                ]
            )
    notes = (
        *mark_explained(evaluation),
        "Bound: least standard deviation that the data allow (Cramér-Rao). % of prior: how much of the standard "
        "deviation before the data is left after them.",
    )
    return Table("list", "Estimates", columns, rows, notes=notes)


def _against_truth(row: CoefficientResult) -> list[Cell]:
    error, sigmas = row.steady_state_error_percent, deviations_from(row.true, row, row.standard_deviation)
    return [row.true, _rounded(error, ERROR_DIGITS), _rounded(sigmas, ERROR_DIGITS)]


def _rounded(value: float | None, digits: int) -> Cell:
    """Round a number to what is shown, so that it is also sorted by it."""
    return None if value is None else number(value, digits)


def estimate_plots(estimates: Sequence[Estimate], true: Mapping[str, float]) -> Plots:
    """Return a plot of each coefficient's estimates over time on a linear axis, with the true value as a line."""
    plots = []
    for symbol in dict.fromkeys(estimate.state[row] for estimate in estimates for row in estimate.coefficient_rows):
        of_symbol = [estimate for estimate in estimates if symbol in estimate.state and estimate.time.size]
        means = [estimate.mean[:, estimate.state.index(symbol)] for estimate in of_symbol]
        shown = shown_range(means, true.get(symbol))
        if shown is None:
            continue
        unit = next(estimate.unit[estimate.state.index(symbol)] for estimate in of_symbol)
        last = max(float(estimate.time[-1]) for estimate in of_symbol)
        first = last * _FIRST_SHARE
        lines = []
        if symbol in true:
            span = np.array([first, last])
            lines.append(PlotLine("true value", "true", span, np.full(2, true[symbol])))
        for estimate, mean in zip(of_symbol, means, strict=True):
            some = log_spaced(estimate.time, first, _SPANS)
            lines.append(PlotLine(filter_label(estimate.filter), estimate.filter, estimate.time[some], mean[some]))
        ends = [f"{filter_label(e.filter)} {number(float(mean[-1]))}" for e, mean in zip(of_symbol, means, strict=True)]
        says = f"Estimates of {symbol} over time; at the end {', '.join(ends)}"
        says += f"; true value {number(true[symbol])}." if symbol in true else "."
        plots.append(Plot(symbol, says, unit_text(unit), lines, log_x=True, limits=with_margin(*shown)))
    return Plots(plots, linked="estimates")


def convergence(estimates: Sequence[Estimate], true: Mapping[str, float]) -> Plots:
    """Plot how far each coefficient is over time from the truth, or from where it ends, in percent of that."""
    plots = []
    for symbol in dict.fromkeys(estimate.state[row] for estimate in estimates for row in estimate.coefficient_rows):
        lines, ends = [], []
        for estimate in estimates:
            if symbol not in estimate.state or not estimate.time.size:
                continue
            column = estimate.state.index(symbol)
            final = float(estimate.mean[-1, column])
            origin = origin_of(true.get(symbol), final)
            if origin is None:
                continue
            course = convergence_of(estimate.time, estimate.mean[:, column], origin, _SPANS)
            label = filter_label(estimate.filter)
            if isfinite(course.last):
                lines.append(PlotLine(label, estimate.filter, course.time, course.percent))
                ends.append(f"{label} {number(course.last, 2)} %")
        if lines:
            origin_words = "the truth" if true.get(symbol) else "its final value"
            says = f"Distance of {symbol} from {origin_words}; at the end {', '.join(ends)}."
            plots.append(Plot(symbol, says, "%", lines, log_y=True))
    return Plots(plots, linked="convergence")
