"""Figures of the coefficients: convergence, bounds and correlation."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from auvid_cli.data.estimate import EstimateHistory
from auvid_cli.evaluation.results import CLASSES, Identifiability
from auvid_cli.report import plot_data
from auvid_cli.report.figures import style
from auvid_cli.report.table import symbol_math

_COLUMNS = 4
_ROOM = style.Room(across=0.15)
_ESTIMATE_ROOM = style.Room(across=0.55)
_LINE_POINTS = 200
_ESTIMATE_POINTS = 600
# Okabe and Ito's, from sure to unknown.
_COLORS = dict(zip((label for _, label in CLASSES), ("#009E73", "#56B4E9", "#E69F00", "#D55E00"), strict=True))
# Styles of the bars and of the lines of the growth.
_HATCHES = dict(zip((label for _, label in CLASSES), ("", "//", "xx", ".."), strict=True))
_LINES = dict(zip((label for _, label in CLASSES), ("-", (0, (6, 2)), (0, (3, 1, 1, 1)), (0, (1, 1.3))), strict=True))
# Largest ratio of neighbouring durations with a label.
_APART = 0.7
_MIN_LABELLED = 0.05  # smallest correlation with a number
_DARK = 0.6  # smallest correlation with a dark colour
_MAX_PERCENT = 1e4  # length of the longest bar, and of a bar without a bound


def estimate_figure(symbols: Sequence[str], estimates: list[EstimateHistory], true: dict[str, float]) -> Figure:
    """Draw a panel for each coefficient: its estimates on a linear axis, and the true value as a line.

    As the paper's Figs. 3 to 5, but over the logarithm of time: most coefficients converge within seconds.

    Parameters
    ----------
    true : dict
        By symbol, SI; empty without truth.
    """
    handles = style.filter_handles((estimate.filter for estimate in estimates), marked=True)
    if true:
        handles.append(Line2D([], [], label="true value", **style.TRUE_LINE))
    plots = [plot_data.estimate_plot(symbol, estimates, true.get(symbol), _ESTIMATE_POINTS) for symbol in symbols]
    figure, panels = style.new_panels(
        len(symbols), _COLUMNS, 1.15, handles, _ESTIMATE_ROOM, plot_data.time_span(estimates)
    )
    for axes, plot in zip(panels, plots, strict=True):
        # Estimates start at zero and end at one edge of the panel, so that half height is free.
        style.name_panel(axes, symbol_math(plot.symbol), height=0.6)
        axes.set_xscale("log")
        axes.set_xlim(plot.begin, plot.end)
        style.plain_decades(axes.xaxis)
        _draw_lines(axes, plot)
        if plot.limits is None:
            style.show_message(axes, "no estimate")
            continue
        axes.set_ylim(*plot.limits)
        if plot.true is not None:
            axes.axhline(plot.true, **style.TRUE_LINE, zorder=1.9)
    style.name_values(figure, "estimate (SI)")
    return figure


def convergence_figure(symbols: Sequence[str], estimates: list[EstimateHistory], true: dict[str, float]) -> Figure:
    """Draw a panel for each coefficient: its distance from the true or final value, in percent of that.

    Parameters
    ----------
    true : dict
        By symbol, SI; empty without truth.
    """
    handles = [
        *style.filter_handles((estimate.filter for estimate in estimates), marked=True),
        Patch(color="0.5", alpha=style.BAND_SHADE, linewidth=0, label="2 standard deviations"),
    ]
    plots = [plot_data.convergence_plot(symbol, estimates, true.get(symbol), _LINE_POINTS) for symbol in symbols]
    limits = plot_data.convergence_limits(plots)
    figure, panels = style.new_panels(len(symbols), _COLUMNS, 1.15, handles, _ROOM, plot_data.time_span(estimates))
    for place, (axes, plot) in enumerate(zip(panels, plots, strict=True)):
        axes.set_yscale("log")
        axes.set_ylim(*limits)
        style.plain_decades(axes.yaxis)
        if place % _COLUMNS:
            axes.tick_params(labelleft=False)
        # A true value of zero, of a term that the simulation did not have, has no percent.
        style.name_panel(axes, symbol_math(plot.symbol) + (", of its final value" if plot.true == 0.0 else ""))
        for line in plot.lines:
            color = style.FILTER_STYLES[line.filter].color
            style.draw_band(axes, line.band_time, limits[0], line.band, color, len(estimates))
        _draw_lines(axes, plot)
        if not plot.lines:
            style.show_message(axes, "no estimate")
    style.name_values(figure, f"distance from the {'true' if true else 'final'} value (% of it)")
    return figure


def _draw_lines(axes: Axes, plot: plot_data.CoefficientPlot) -> None:
    for position, line in enumerate(plot.lines):
        look = style.FILTER_STYLES[line.filter].marked_line(position, line.time.size)
        axes.plot(line.time, line.values, **look, zorder=2.0 + 0.1 * position)


def bounds_figure(identifiability: Identifiability) -> Figure:
    """Draw bounds in percent of the value, and how they fall with the duration."""
    n = len(identifiability.bounds)
    figure = style.new_figure(style.WIDTH, 0.26 * max(n, 6) + 1.4)
    bars, growth = figure.subplots(1, 2, width_ratios=[1.5, 1.0])
    percents = np.array([min(bound.percent, _MAX_PERCENT) for bound in identifiability.bounds])
    smallest = max(float(percents.min()), 1e-6)
    for place, (bound, percent) in enumerate(zip(identifiability.bounds, percents, strict=True)):
        bars.barh(place, percent, **_filled(bound.label))
    bars.set_xscale("log")
    bars.set_xlim(0.3 * smallest, 3.0 * max(float(percents.max()), CLASSES[-2][0]))
    _tidy_log(bars)
    bars.set_yticks(range(n), [symbol_math(bound.coefficient) for bound in identifiability.bounds])
    bars.set_ylim(n - 0.4, -0.6)
    for limit, _ in CLASSES[:-1]:
        bars.axvline(limit, color="0.4", linewidth=0.8, linestyle=(0, (4, 3)))
        over = bars.get_xaxis_transform()
        bars.text(limit, 1.005, f"{limit:g} %", transform=over, ha="center", va="bottom", fontsize=7, color="0.3")
    bars.set_xlabel("Cramér-Rao bound (% of the value)", fontsize=9)
    times = [time for time, _ in identifiability.growth]
    for j, bound in enumerate(identifiability.bounds):
        series = [min(percent[j], _MAX_PERCENT) for _, percent in identifiability.growth]
        growth.plot(times, series, **_stroked(bound.label))
    growth.set_yscale("log")
    growth.set_xscale("log")
    _tidy_log(growth)
    _tick_durations(growth, times)
    style.head(growth, "bound over duration, each coefficient")
    growth.set_xlabel("duration (s)", fontsize=9)
    growth.set_ylabel("bound (%)", fontsize=9)
    there = {bound.label for bound in identifiability.bounds}
    style.legend_above(figure, [Patch(label=label, **_filled(label)) for _, label in CLASSES if label in there])
    return figure


def _filled(label: str) -> dict[str, Any]:
    return {"facecolor": _COLORS[label], "hatch": _HATCHES[label], "edgecolor": "white"}


def _stroked(label: str) -> dict[str, Any]:
    return {"color": _COLORS[label], "linestyle": _LINES[label], "linewidth": 1.0}


def _tick_durations(axes: Axes, times: list[float]) -> None:
    """Label an axis of durations, s, with as many of them as there is room for."""
    kept: list[float] = []
    for time in sorted(times, reverse=True):
        if time > 0.0 and (not kept or time < _APART * kept[-1]):
            kept.append(time)
    axes.set_xticks(kept, [f"{time:.3g}" for time in kept])
    axes.xaxis.set_minor_locator(NullLocator())


def correlation_figure(identifiability: Identifiability) -> Figure:
    """Draw the correlations of the errors of an estimate that reaches the bound."""
    n = len(identifiability.bounds)
    figure = style.new_figure(0.36 * max(n, 6) + 2.2, 0.33 * max(n, 6) + 1.6)
    axes = figure.subplots()
    image = axes.imshow(identifiability.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu")
    names = [symbol_math(bound.coefficient) for bound in identifiability.bounds]
    axes.set_xticks(range(n), names, rotation=90, fontsize=8)
    axes.set_yticks(range(n), names, fontsize=8)
    # Without colour only the number shows the sign.
    for i, j in np.argwhere(np.abs(np.nan_to_num(identifiability.correlation)) > _MIN_LABELLED):
        if i != j:
            value = identifiability.correlation[i, j]
            color = "white" if abs(value) > _DARK else "black"
            axes.text(j, i, f"{value:+.2f}", ha="center", va="center", fontsize=6, color=color)
    figure.colorbar(image, ax=axes, shrink=0.8, label="correlation")
    style.head(axes, "")
    return figure


def _tidy_log(axes: Axes) -> None:
    """Set small type and a faint grid on logarithmic axes."""
    style.plain_frame(axes)
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            style.plain_decades(axis)
