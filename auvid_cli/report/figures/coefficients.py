"""How the estimates of the coefficients settle."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from auvid_cli.data.estimate import Course
from auvid_cli.report.figures.limits import value_range, with_margin, with_near_zero
from auvid_cli.report.figures.series import spaced, thin
from auvid_cli.report.figures.style import (
    BAND_ALPHA,
    FILTER_STYLES,
    TRUE_LINE,
    filter_handles,
    head,
    legend_above,
    new_figure,
    say,
    tidy,
)
from auvid_cli.report.notation import symbol_math, unit_text
from auvid_cli.vehicle.coefficients import Coefficient

_LINE_POINTS = 500
_BAND_POINTS = 160


def coefficient_figure(coefficients: Sequence[Coefficient], estimates: list[Course], true: dict[str, float]) -> Figure:
    """Draw a panel for each coefficient: estimates, their bands of two standard deviations, and the truth.

    Parameters
    ----------
    coefficients : sequence of Coefficient
    estimates : list of Course
    true : dict
        By symbol, SI; empty without truth.
    """
    columns = min(len(coefficients), 2)
    rows = -(-len(coefficients) // columns)
    figure = new_figure(5.2 * columns, 2.1 * rows + 0.7)
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for axes, coefficient in zip(panels.flat, coefficients, strict=False):
        _draw_panel(axes, coefficient, estimates, true.get(coefficient.symbol))
    for axes in panels.flat[len(coefficients) :]:
        axes.remove()
    for axes in panels[-1, : (len(coefficients) - 1) % columns + 1]:
        axes.set_xlabel("time (s)", fontsize=9)
    handles = [
        *filter_handles((estimate.filter for estimate in estimates), marked=True),
        Patch(color="0.5", alpha=2 * BAND_ALPHA, linewidth=0, label="±2 standard deviations"),
    ]
    if true:
        handles.append(Line2D([], [], label="true", **TRUE_LINE))
    legend_above(figure, handles)
    return figure


def _draw_panel(axes: Axes, coefficient: Coefficient, estimates: list[Course], true: float | None) -> None:
    tidy(axes)
    head(axes, symbol_math(coefficient.symbol))
    axes.set_ylabel(unit_text(coefficient.unit), fontsize=9)
    having = [estimate for estimate in estimates if coefficient.symbol in estimate.state and estimate.time.size]
    if not having:
        say(axes, "no estimate")
        return
    for position, estimate in enumerate(having):
        _draw_estimate(axes, estimate, coefficient.symbol, position)
    if true is not None:
        axes.axhline(true, **TRUE_LINE, zorder=1.9)
    axes.set_ylim(*_limits(having, coefficient.symbol, true))
    begin, end = min(e.time[0] for e in having), max(e.time[-1] for e in having)
    axes.set_xlim(*with_near_zero(begin, end if end > begin else begin + 1.0))


def _draw_estimate(axes: Axes, estimate: Course, symbol: str, position: int) -> None:
    style = FILTER_STYLES[estimate.filter]
    column = estimate.state.index(symbol)
    mean, deviation = estimate.mean[:, column], estimate.standard_deviation[:, column]
    some = spaced(mean.size, _BAND_POINTS)
    band = (mean[some] - 2.0 * deviation[some], mean[some] + 2.0 * deviation[some])
    axes.fill_between(estimate.time[some], *band, color=style.color, alpha=BAND_ALPHA, linewidth=0, zorder=1.5)
    time, values = thin(estimate.time, mean, _LINE_POINTS)
    axes.plot(time, values, **style.marked_line(position, time.size), zorder=2.0 + 0.1 * position)


def _limits(estimates: list[Course], symbol: str, true: float | None) -> tuple[float, float]:
    """Leave room for the later half of the run, whose beginning may be orders of magnitude larger."""
    # A filter that diverged would squash the others, so it counts only where it is alone.
    counting = [estimate for estimate in estimates if estimate.completed] or estimates
    extents = [] if true is None else [np.array([true])]
    for estimate in counting:
        column = estimate.state.index(symbol)
        late = estimate.time >= 0.5 * (estimate.time[0] + estimate.time[-1])
        mean, spread = estimate.mean[late, column], 2.0 * estimate.standard_deviation[late, column]
        extents += [mean - spread, mean + spread]
    low, high = value_range(*extents) or (0.0, 0.0)
    return with_margin(*with_near_zero(low, high))
