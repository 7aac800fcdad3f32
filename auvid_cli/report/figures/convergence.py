"""Convergence of the coefficients: estimates over time, and their distance from the true value."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvid_cli.data.estimate import Course
from auvid_cli.report.convergence import convergence_of, origin_of, shown_range
from auvid_cli.report.figures.limits import value_range, with_margin
from auvid_cli.report.figures.series import finite, log_spaced, spaced
from auvid_cli.report.figures.style import (
    BAND_SHADE,
    FILTER_STYLES,
    TRUE_LINE,
    Room,
    draw_band,
    filter_handles,
    name_panel,
    name_values,
    new_panels,
    plain_decades,
    say,
)
from auvid_cli.report.notation import symbol_math

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


def estimate_figure(symbols: Sequence[str], estimates: list[Course], true: dict[str, float]) -> Figure:
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


def convergence_figure(symbols: Sequence[str], estimates: list[Course], true: dict[str, float]) -> Figure:
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


def _draw_panel(axes: Axes, symbol: str, estimates: list[Course], true: float | None) -> None:
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


def _limits(symbols: Sequence[str], estimates: list[Course], true: dict[str, float]) -> tuple[float, float]:
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
