"""Figures of the coefficients: convergence, bounds and correlation."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from auvid_cli.data.estimate import EstimateHistory
from auvid_cli.evaluation.assessment import CLASSES, Identifiability
from auvid_cli.report.figures.style import (
    BAND_SHADE,
    FILTER_STYLES,
    TRUE_LINE,
    WIDTH,
    Room,
    draw_band,
    filter_handles,
    head,
    legend_above,
    name_panel,
    name_values,
    new_figure,
    new_panels,
    plain_decades,
    say,
    value_range,
    with_margin,
)
from auvid_cli.report.plot_data import convergence_of, finite, log_spaced, origin_of, shown_range, spaced
from auvid_cli.report.table import symbol_math

Array = NDArray[np.float64]
_COLUMNS = 4
_ROOM = Room(across=0.15)
_LINE_POINTS, _BAND_POINTS = 200, 100
_ESTIMATE_ROOM = Room(across=0.55)
_ESTIMATE_POINTS = 600
# Start of the logarithmic time axis as a share of the run.
_FIRST_SHARE = 1e-3
_SHORTEST = 1e-3  # s
# Percents that are drawn at most unless lines end higher, how far above where they end, below the least of the final
# bands, and from the bottom to the top.
_HIGHEST, _ABOVE, _BELOW, _SPAN = 1e3, 3.0, 0.03, 1e9
# Okabe and Ito's, from sure to unknown.
_COLORS = dict(zip((label for _, label in CLASSES), ("#009E73", "#56B4E9", "#E69F00", "#D55E00"), strict=True))
# Of the bars, and of the lines of the growth.
_HATCHES = dict(zip((label for _, label in CLASSES), ("", "//", "xx", ".."), strict=True))
_LINES = dict(zip((label for _, label in CLASSES), ("-", (0, (6, 2)), (0, (3, 1, 1, 1)), (0, (1, 1.3))), strict=True))
# Of two durations that are named, the shorter is no more of the longer.
_APART = 0.7
# Correlations that are written as numbers, for below they are as good as none, and those whose colour is dark.
_NAMED, _DARK = 0.05, 0.6
# Percent that a bar without bound, or beyond it, is drawn with.
_LARGEST = 1e4


def estimate_figure(symbols: Sequence[str], estimates: list[EstimateHistory], true: dict[str, float]) -> Figure:
    """Draw a panel for each coefficient: its estimates on a linear axis, and the true value as a line.

    As the paper's Figs. 3 to 5, but over the logarithm of time: most coefficients converge within seconds.

    Parameters
    ----------
    symbols : sequence of str
    estimates : list of Course
    true : dict
        By symbol, SI; empty without truth.
    """
    handles = filter_handles((estimate.filter for estimate in estimates), marked=True)
    if true:
        handles.append(Line2D([], [], label="true value", **TRUE_LINE))
    span = value_range(*(estimate.time for estimate in estimates)) or (0.0, 1.0)
    first = max(span[1] * _FIRST_SHARE, _SHORTEST)
    figure, panels = new_panels(len(symbols), _COLUMNS, 1.15, handles, _ESTIMATE_ROOM, span)
    for axes, symbol in zip(panels, symbols, strict=True):
        # Estimates start at zero and end at one edge of the panel, so that half height is free.
        name_panel(axes, symbol_math(symbol), height=0.6)
        axes.set_xscale("log")
        axes.set_xlim(first, max(span[1], 10.0 * first))
        plain_decades(axes.xaxis)
        means = []
        for position, estimate in enumerate(estimates):
            if symbol in estimate.state and estimate.time.size:
                means.append(estimate.mean[:, estimate.state.index(symbol)])
                some = log_spaced(estimate.time, first, _ESTIMATE_POINTS)
                time, mean = estimate.time[some], finite(means[-1][some])
                style = FILTER_STYLES[estimate.filter]
                axes.plot(time, mean, **style.marked_line(position, time.size), zorder=2.0 + 0.1 * position)
        shown = shown_range(means, true.get(symbol))
        if shown is None:
            say(axes, "no estimate")
            continue
        axes.set_ylim(*with_margin(*shown))
        if symbol in true:
            axes.axhline(true[symbol], **TRUE_LINE, zorder=1.9)
    name_values(figure, "estimate (SI)")
    return figure


def convergence_figure(symbols: Sequence[str], estimates: list[EstimateHistory], true: dict[str, float]) -> Figure:
    """Draw a panel for each coefficient: how far it is from the truth, or from where it ends, in percent of that.

    Parameters
    ----------
    symbols : sequence of str
    estimates : list of Course
    true : dict
        By symbol, SI; empty without truth.
    """
    handles = [
        *filter_handles((estimate.filter for estimate in estimates), marked=True),
        Patch(color="0.5", alpha=BAND_SHADE, linewidth=0, label="2 standard deviations"),
    ]
    span = value_range(*(estimate.time for estimate in estimates)) or (0.0, 1.0)
    figure, panels = new_panels(len(symbols), _COLUMNS, 1.15, handles, _ROOM, span)
    limits = _limits(symbols, estimates, true)
    for place, (axes, symbol) in enumerate(zip(panels, symbols, strict=True)):
        axes.set_yscale("log")
        axes.set_ylim(*limits)
        plain_decades(axes.yaxis)
        if place % _COLUMNS:
            axes.tick_params(labelleft=False)
        _draw_panel(axes, symbol, estimates, true.get(symbol))
    name_values(figure, f"distance from the {'true' if true else 'final'} value (% of it)")
    return figure


def _draw_panel(axes: Axes, symbol: str, estimates: list[EstimateHistory], true: float | None) -> None:
    low, _ = axes.get_ylim()
    # Of a term that the simulation did not have there is no percent.
    name_panel(axes, symbol_math(symbol) + (", of its final value" if true == 0.0 else ""))
    is_empty = True
    for position, estimate in enumerate(estimates):
        if symbol not in estimate.state or not estimate.time.size:
            continue
        column = estimate.state.index(symbol)
        mean, deviation = estimate.mean[:, column], estimate.standard_deviation[:, column]
        origin = origin_of(true, float(mean[-1]))
        if origin is None:
            continue
        is_empty = False
        style = FILTER_STYLES[estimate.filter]
        some = spaced(mean.size, _BAND_POINTS)
        draw_band(axes, estimate.time[some], low, 200.0 * deviation[some] / abs(origin), style.color, len(estimates))
        course = convergence_of(estimate.time, mean, origin, _LINE_POINTS)
        line = style.marked_line(position, course.time.size)
        axes.plot(course.time, course.percent, **line, zorder=2.0 + 0.1 * position)
    if is_empty:
        say(axes, "no estimate")


def _limits(symbols: Sequence[str], estimates: list[EstimateHistory], true: dict[str, float]) -> tuple[float, float]:
    """Return the least and the greatest percents of all panels: by the bands at both ends, and by where lines end."""
    # A filter that diverged would squash the others, so it counts only where it is alone.
    counting = [estimate for estimate in estimates if estimate.completed] or estimates
    bands, ends = [], []
    for estimate in counting:
        for symbol in symbols:
            if symbol in estimate.state and estimate.time.size:
                column = estimate.state.index(symbol)
                final = float(estimate.mean[-1, column])
                origin = origin_of(true.get(symbol), final)
                if origin is not None:
                    deviation = estimate.standard_deviation[[0, -1], column]
                    bands.append(200.0 * deviation[deviation > 0.0] / abs(origin))
                    ends.append(np.array([100.0 * abs(final / origin - 1.0)]))
    low, high = value_range(*bands) or (0.1, _HIGHEST)
    _, last = value_range(*ends) or (0.0, 0.0)
    high = max(min(high, _HIGHEST), min(_ABOVE * last, _HIGHEST**2))
    return min(max(_BELOW * low, high / _SPAN), 0.01 * high), high


def bounds_figure(identifiability: Identifiability) -> Figure:
    """Draw bounds in percent of the value, and how they fall with the duration."""
    n = len(identifiability.bounds)
    figure = new_figure(WIDTH, 0.26 * max(n, 6) + 1.4)
    bars, growth = figure.subplots(1, 2, width_ratios=[1.5, 1.0])
    percents = np.array([min(bound.percent, _LARGEST) for bound in identifiability.bounds])
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
        series = [min(percent[j], _LARGEST) for _, percent in identifiability.growth]
        growth.plot(times, series, **_stroked(bound.label))
    growth.set_yscale("log")
    growth.set_xscale("log")
    _tidy_log(growth)
    _tick_durations(growth, times)
    head(growth, "bound over duration, each coefficient")
    growth.set_xlabel("duration (s)", fontsize=9)
    growth.set_ylabel("bound (%)", fontsize=9)
    there = {bound.label for bound in identifiability.bounds}
    legend_above(figure, [Patch(label=label, **_filled(label)) for _, label in CLASSES if label in there])
    return figure


def _filled(label: str) -> dict[str, Any]:
    return {"facecolor": _COLORS[label], "hatch": _HATCHES[label], "edgecolor": "white"}


def _stroked(label: str) -> dict[str, Any]:
    return {"color": _COLORS[label], "linestyle": _LINES[label], "linewidth": 1.0}


def _tick_durations(axes: Axes, times: list[float]) -> None:
    """Put numbers at an axis of durations, s: of their order no more than have room."""
    kept: list[float] = []
    for time in sorted(times, reverse=True):
        if time > 0.0 and (not kept or time < _APART * kept[-1]):
            kept.append(time)
    axes.set_xticks(kept, [f"{time:.3g}" for time in kept])
    axes.xaxis.set_minor_locator(NullLocator())


def correlation_figure(identifiability: Identifiability) -> Figure:
    """Draw the correlations of the errors of an estimate that reaches the bound."""
    n = len(identifiability.bounds)
    figure = new_figure(0.36 * max(n, 6) + 2.2, 0.33 * max(n, 6) + 1.6)
    axes = figure.subplots()
    image = axes.imshow(identifiability.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu")
    names = [symbol_math(bound.coefficient) for bound in identifiability.bounds]
    axes.set_xticks(range(n), names, rotation=90, fontsize=8)
    axes.set_yticks(range(n), names, fontsize=8)
    # In print without colour only the number tells the sign.
    for i, j in np.argwhere(np.abs(np.nan_to_num(identifiability.correlation)) > _NAMED):
        if i != j:
            value = identifiability.correlation[i, j]
            color = "white" if abs(value) > _DARK else "black"
            axes.text(j, i, f"{value:+.2f}", ha="center", va="center", fontsize=6, color=color)
    figure.colorbar(image, ax=axes, shrink=0.8, label="correlation")
    head(axes, "")
    return figure


def _tidy_log(axes: Axes) -> None:
    """Set small type and a faint grid on logarithmic axes."""
    axes.grid(color="0.9", linewidth=0.6, which="major")
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            plain_decades(axis)
    axes.spines[["top", "right"]].set_visible(False)
