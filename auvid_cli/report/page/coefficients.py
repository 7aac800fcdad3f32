"""Section of a page on coefficients, with a forest plot."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np

from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.layout import data_deviation, shown_deviation
from auvid_cli.report.page.parts import Axis, Box, Dot, Picture, Plot, PlotLine, Plots, Rule, Shape, TextLabel
from auvid_cli.report.page.render import symbol_parts
from auvid_cli.report.plot_data import CoefficientPlot, convergence_plot, estimate_plot
from auvid_cli.report.table import (
    DEVIATION_DIGITS,
    ERROR_DIGITS,
    Cell,
    Column,
    PlusMinus,
    Symbol,
    Table,
    UnitCell,
    by_kind,
    filter_label,
    number,
    tabulated,
    text_column,
    unit_text,
)
from auvid_cli.report.table_iv import mark_explained, marked, results_by_coefficient

_WIDEST = 5.0  # half the width in standard deviations; an arrow at the edge marks larger distances
_ROW = 20.0
_LEFT = 64.0
_WIDTH = 460.0
_TOP = 12.0
_SPREAD = 0.7  # share of the height of a row that its marks fill
_PARTS = 300  # points of a line over time


class _Distance(NamedTuple):
    symbol: str
    filter: str
    sigmas: float


def deviations_from(origin: float | None, row: CoefficientResult, deviation: float) -> float | None:
    """Return how many standard deviations an estimate is from a value; None if that is not known."""
    if origin is None or not deviation > 0.0 or not isfinite(deviation):
        return None
    return (row.estimate - origin) / deviation


def forest(evaluation: Evaluation) -> list[Picture]:
    """Draw the distances of estimates from the truth or, without one, from those of the first filter, if there are any.

    Many coefficients are in two pictures, forces and moments.
    """
    filters = [row.filter for row in evaluation.summary]
    has_truth = any(row.true is not None for row in evaluation.coefficients)
    distances = _from_truth(evaluation) if has_truth else _from_first(evaluation, filters)
    if not distances:
        return []
    against = "the truth" if has_truth else f"the {filter_label(filters[0])}"
    shown = filters if has_truth else filters[1:]
    kinds = by_kind(list(dict.fromkeys(distance.symbol for distance in distances)))
    return [
        _picture(f"Distance from {against}{kind and f', {kind}'}", against, shown, symbols, distances)
        for kind, symbols in kinds.items()
    ]


def _picture(
    title: str, against: str, shown: Sequence[str], symbols: Sequence[str], every: Iterable[_Distance]
) -> Picture:
    """Draw the distances of some coefficients, a row for each."""
    distances = [distance for distance in every if distance.symbol in symbols]
    across = Axis(-_WIDEST, _WIDEST, _LEFT, _WIDTH - 16.0)
    bottom = _TOP + _ROW * len(symbols)
    shapes = _background(across, bottom, against)
    for place, symbol in enumerate(symbols):
        letter, below = symbol_parts(symbol)
        shapes.append(TextLabel(_LEFT - 8.0, _TOP + _ROW * (place + 0.5) + 4.0, letter, "end", below))
    for distance in distances:
        offset = _SPREAD * ((shown.index(distance.filter) + 0.5) / len(shown) - 0.5)
        shapes += _mark(distance, across, _TOP + _ROW * (symbols.index(distance.symbol) + 0.5 + offset))
    legend = [(name, filter_label(name)) for name in shown]
    says = _in_words(distances, against)
    return Picture(title, says, _WIDTH, bottom + 46.0, shapes, legend)


def _from_truth(evaluation: Evaluation) -> list[_Distance]:
    return [
        _Distance(row.coefficient, row.filter, sigmas)
        for row in evaluation.coefficients
        if (sigmas := deviations_from(row.true, row, row.standard_deviation)) is not None and isfinite(sigmas)
    ]


def _from_first(evaluation: Evaluation, filters: list[str]) -> list[_Distance]:
    """Compare in the larger of the two standard deviations, as judgements do."""
    distances = []
    for symbol, by_filter in results_by_coefficient(evaluation).items():
        first = by_filter.get(filters[0])
        for name in filters[1:]:
            if first is None or name not in by_filter:
                continue
            row = by_filter[name]
            larger = max(row.standard_deviation, first.standard_deviation)
            sigmas = deviations_from(first.estimate, row, larger)
            if sigmas is not None and isfinite(sigmas):
                distances.append(_Distance(symbol, name, sigmas))
    return distances


def _background(across: Axis, bottom: float, against: str) -> list[Shape]:
    middle, left, right = across.at(0.0), across.at(-2.0), across.at(2.0)
    return [
        Box(left, _TOP, right - left, bottom - _TOP, "chance"),
        *(Rule(across.at(k), _TOP, across.at(k), bottom, "grid") for k in range(-5, 6)),
        Rule(middle, _TOP, middle, bottom, "axis"),
        *(TextLabel(across.at(k), bottom + 16.0, f"{k:+d}" if k else "0", "middle") for k in range(-4, 5, 2)),
        TextLabel(middle, bottom + 36.0, f"(estimate - {against}) / standard deviation", "middle"),
    ]


def _mark(distance: _Distance, across: Axis, y: float) -> list[Shape]:
    says = f"{distance.symbol}, {filter_label(distance.filter)}: {distance.sigmas:+.2f}"
    x = across.at(float(np.clip(distance.sigmas, -_WIDEST, _WIDEST)))
    shapes: list[Shape] = [Dot(x, y, distance.filter, says)]
    if abs(distance.sigmas) > _WIDEST:
        shapes.append(TextLabel(x, y - 5.0, "→" if distance.sigmas > 0.0 else "←", "middle"))
    return shapes


def _in_words(distances: list[_Distance], against: str) -> str:
    worst = max(distances, key=lambda distance: abs(distance.sigmas))
    beyond = sum(abs(distance.sigmas) > _WIDEST for distance in distances)
    outside = f" {beyond} are farther than {_WIDEST:g}: arrows at the edge." if beyond else ""
    return (
        f"Farthest from {against}: {worst.symbol} of {filter_label(worst.filter)}, by {abs(worst.sigmas):.2g} standard "
        f"deviations (from noise alone).{outside} If the standard deviations are right, 95 of 100 are within the "
        "shaded band."
    )


def coefficient_list(evaluation: Evaluation, shares_of_prior: Mapping[str, Mapping[str, float]]) -> Table:
    """Lay out a row for each coefficient and filter.

    Parameters
    ----------
    shares_of_prior : mapping of mapping
        Final standard deviation divided by that of the prior, by filter and symbol.
    """
    has_truth = any(row.true is not None for row in evaluation.coefficients)
    has_total = any(row.total_standard_deviation is not None for row in evaluation.coefficients)
    cells: dict[Column, Callable[[CoefficientResult], Cell]] = {
        text_column("coefficient"): lambda row: Symbol(row.coefficient),
        text_column("estimator"): lambda row: filter_label(row.filter),
        Column(f"estimate ± {'total' if has_total else 'sd'}"): lambda row: marked(
            row, PlusMinus(row.estimate, shown_deviation(row))
        ),
        text_column("unit"): lambda row: UnitCell(row.unit),
    }
    if has_total:
        cells[Column("± data")] = lambda row: _rounded(data_deviation(row), DEVIATION_DIGITS)
    if has_truth:
        cells |= {
            Column("true"): lambda row: row.true,
            Column("error %"): lambda row: _rounded(row.steady_state_error_percent, ERROR_DIGITS),
            Column("error / sd"): lambda row: _rounded(
                deviations_from(row.true, row, row.standard_deviation), ERROR_DIGITS
            ),
        }
    cells |= {
        Column("bound"): lambda row: _rounded(row.cramer_rao_bound, DEVIATION_DIGITS),
        Column("times bound"): lambda row: _rounded(row.times_bound, DEVIATION_DIGITS + 1),
        Column("% of prior"): lambda row: _rounded(
            100.0 * shares_of_prior[row.filter][row.coefficient], DEVIATION_DIGITS
        ),
        text_column("identified"): lambda row: "yes" if row.identified else "† no",
    }
    if has_total:
        cells[text_column("mostly from")] = lambda row: row.contributors
    rows = [row for by_filter in results_by_coefficient(evaluation).values() for row in by_filter.values()]
    notes = (
        *mark_explained(evaluation),
        "Bound: smallest standard deviation that the data allow (Cramér-Rao). % of prior: standard deviation of the "
        "estimate in percent of the prior's.",
    )
    return tabulated("list", "Estimates", rows, cells, notes)


def _rounded(value: float | None, digits: int) -> Cell:
    """Return a number with the digits that are shown; the column is sorted by them."""
    return None if value is None else number(value, digits)


def estimate_plots(estimates: Sequence[Estimate], true: Mapping[str, float]) -> Plots:
    """Return a plot of each coefficient's estimates over time on a linear axis, with the true value as a line."""
    plots = []
    units = {e.state[row]: unit_text(e.unit[row]) for e in estimates for row in e.coefficient_rows}
    histories = [estimate.history(tuple(units)) for estimate in estimates]
    for symbol, unit in units.items():
        plot = estimate_plot(symbol, histories, true.get(symbol), _PARTS)
        if plot.limits is None:
            continue
        lines = []
        if plot.true is not None:
            lines.append(PlotLine("true value", "true", np.array([plot.begin, plot.end]), np.full(2, plot.true)))
        lines += _lines(plot)
        ends = ", ".join(f"{filter_label(line.filter)} {number(line.end)}" for line in plot.lines)
        truth = "" if plot.true is None else f"; true value {number(plot.true)}"
        says = f"Estimates of {symbol} over time; at the end {ends}{truth}."
        plots.append(Plot(symbol, says, unit, lines, log_x=True, limits=plot.limits))
    return Plots(plots, linked="estimates")


def convergence(estimates: Sequence[Estimate], true: Mapping[str, float]) -> Plots:
    """Plot the distance of each coefficient over time from its true or final value, in percent of that."""
    plots = []
    symbols = tuple(dict.fromkeys(e.state[row] for e in estimates for row in e.coefficient_rows))
    histories = [estimate.history(symbols) for estimate in estimates]
    for symbol in symbols:
        plot = convergence_plot(symbol, histories, true.get(symbol), _PARTS)
        plot = plot._replace(lines=[line for line in plot.lines if np.isfinite(line.values).any()])
        if plot.lines:
            ends = ", ".join(
                f"{filter_label(line.filter)} {number(line.end, 2)} %" for line in plot.lines if line.end > 0.0
            )
            says = f"Distance of {symbol} from {'the truth' if plot.true else 'its final value'}"
            says += f"; at the end {ends}." if ends else "."
            plots.append(Plot(symbol, says, "%", _lines(plot), log_y=True))
    return Plots(plots, linked="convergence")


def _lines(plot: CoefficientPlot) -> list[PlotLine]:
    return [PlotLine(filter_label(line.filter), line.filter, line.time, line.values) for line in plot.lines]
