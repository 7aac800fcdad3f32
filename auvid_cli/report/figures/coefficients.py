"""Figures of the coefficients: convergence, bounds and correlation, and their errors in a campaign."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from auvid_cli.arrays import Array
from auvid_cli.campaign.measures import CellErrors, errors_by_cell
from auvid_cli.evaluation.results import CLASSES, Identifiability
from auvid_cli.report import plot_data
from auvid_cli.report.figures import style
from auvid_cli.report.table import setting_text, symbol_math

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = 4
_ROOM = style.Room(across=0.15)
_ESTIMATE_ROOM = style.Room(across=0.55)
# Okabe and Ito's, from sure to unknown.
_COLORS = dict(zip((label for _, label in CLASSES), ("#009E73", "#56B4E9", "#E69F00", "#D55E00"), strict=True))
# Styles of the bars and of the lines of the growth.
_HATCHES = dict(zip((label for _, label in CLASSES), ("", "//", "xx", ".."), strict=True))
_LINES = dict(zip((label for _, label in CLASSES), ("-", (0, (6, 2)), (0, (3, 1, 1, 1)), (0, (1, 1.3))), strict=True))
# Largest ratio of neighbouring durations with a label.
_APART = 0.7
_MIN_LABELLED = 0.05  # smallest correlation with a number
_DARK = 0.6  # smallest correlation with a dark colour
_FILTER_HATCHES = ("", "////", "xxxx", "....", "----", "++++", "oo")
# Share of the distance between two groups that the boxes of a group fill.
_WIDTH = 0.8
_MAX_PANELS = 12
_MIN_RUNS = 4  # for quartiles
_MIN_SPAN = 4.0  # ratio of the limits of the axis


def estimate_figure(drawn: plot_data.CoefficientPlots) -> Figure:
    """Draw a panel for each coefficient: its estimates on a linear axis, and the true value as a line.

    As the paper's Figs. 3 to 5, but over the logarithm of time: most coefficients converge within seconds.
    """
    handles = style.filter_handles(drawn.filters, marked=True)
    if drawn.has_truth:
        handles.append(Line2D([], [], label="true value", **style.TRUE_LINE))
    figure, panels = style.new_panels(len(drawn.plots), _COLUMNS, 1.15, handles, _ESTIMATE_ROOM, drawn.span)
    for axes, plot in zip(panels, drawn.plots, strict=True):
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


def convergence_figure(drawn: plot_data.CoefficientPlots) -> Figure:
    """Draw a panel for each coefficient: its distance from the true or final value, in percent of that."""
    handles = [
        *style.filter_handles(drawn.filters, marked=True),
        Patch(color="0.5", alpha=style.BAND_SHADE, linewidth=0, label="2 standard deviations"),
    ]
    limits = plot_data.convergence_limits(drawn.plots)
    figure, panels = style.new_panels(len(drawn.plots), _COLUMNS, 1.15, handles, _ROOM, drawn.span)
    for place, (axes, plot) in enumerate(zip(panels, drawn.plots, strict=True)):
        axes.set_yscale("log")
        axes.set_ylim(*limits)
        style.plain_decades(axes.yaxis)
        if place % _COLUMNS:
            axes.tick_params(labelleft=False)
        # A true value of zero, of a term that the simulation did not have, has no percent.
        style.name_panel(axes, symbol_math(plot.symbol) + (", of its final value" if plot.true == 0.0 else ""))
        for line in plot.lines:
            color = style.FILTER_STYLES[line.filter].color
            style.draw_band(axes, line.band_time, limits[0], line.band, color, len(drawn.filters))
        _draw_lines(axes, plot)
        if not plot.lines:
            style.show_message(axes, "no estimate")
    style.name_values(figure, f"distance from the {'true' if drawn.has_truth else 'final'} value (% of it)")
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
    plot = plot_data.bounds_plot(identifiability)
    for place, (bound, percent) in enumerate(zip(identifiability.bounds, plot.percents, strict=True)):
        bars.barh(place, percent, **_filled(bound.label))
    bars.set_xscale("log")
    bars.set_xlim(0.3 * float(plot.percents.min()), 3.0 * max(float(plot.percents.max()), CLASSES[-2][0]))
    _tidy_log(bars)
    bars.set_yticks(range(n), [symbol_math(bound.coefficient) for bound in identifiability.bounds])
    bars.set_ylim(n - 0.4, -0.6)
    for limit, _ in CLASSES[:-1]:
        bars.axvline(limit, color="0.4", linewidth=0.8, linestyle=(0, (4, 3)))
        over = bars.get_xaxis_transform()
        bars.text(limit, 1.005, f"{limit:g} %", transform=over, ha="center", va="bottom", fontsize=7, color="0.3")
    bars.set_xlabel("Cramér-Rao bound (% of the value)", fontsize=9)
    for bound, series in zip(identifiability.bounds, plot.growth.T, strict=True):
        growth.plot(plot.times, series, **_stroked(bound.label))
    growth.set_yscale("log")
    growth.set_xscale("log")
    _tidy_log(growth)
    _tick_durations(growth, plot.times.tolist())
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
    axes.set_xticks(kept, [f"{time:.0f}" if time >= 10.0 else f"{time:.2g}" for time in kept])
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


def spread_figure(runs: "pd.DataFrame", columns: list[str], filters: dict[str, str]) -> Figure:
    """Draw box plots of the mean steady-state errors of the runs that ended, and the share of runs that failed.

    Parameters
    ----------
    runs : DataFrame
        A row for each: axes, filter, status, steady_state_error_percent.
    columns : list of str
        Axes: the last along each panel, the others from panel to panel.
    filters : dict
        Filter of each variant, by name of the variant.
    """
    cells = errors_by_cell(runs, columns)
    keys = list(dict.fromkeys(cell.key[:-1] for cell in cells))
    shown = keys[:_MAX_PANELS]
    figure = style.new_figure(11.0, 2.6 * len(shown) + 0.9)
    panels = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True, sharey=True))
    levels, looks = list(dict.fromkeys(cell.key[-1:] for cell in cells)), _looks(filters)
    for axes, key in zip(panels, shown, strict=True):
        for k, (name, look) in enumerate(looks.items()):
            width, marker = 0.85 * _WIDTH / len(looks), style.FILTER_STYLES[filters[name]].marker
            of_panel = {cell.key[-1:]: cell for cell in cells if cell.filter == name and cell.key[:-1] == key}
            places = np.arange(len(levels), dtype=np.float64) + _WIDTH * ((k + 0.5) / len(looks) - 0.5)
            drawn = [(place, of_panel[level]) for place, level in zip(places, levels, strict=True) if level in of_panel]
            _draw_runs(axes, drawn, width, look, marker)
        axes.set_yscale("log")
        style.plain_log_ticks(axes.yaxis)
        style.plain_frame(axes, "y")
        axes.set_ylabel("error (%)", fontsize=9)
        names = zip(columns, key, strict=False)
        style.head(axes, style.plain(", ".join(f"{column} {setting_text(value)}" for column, value in names)))
    panels[-1].set_xticks(range(len(levels)), [style.plain("".join(map(setting_text, level))) for level in levels])
    panels[-1].set_xlabel(style.plain(columns[-1] if columns else ""), fontsize=9)
    low, high = panels[0].get_ylim()
    if 0.0 < low < high < _MIN_SPAN * low:
        # Errors that hardly differ look alike.
        room = np.sqrt(_MIN_SPAN * low / high)
        panels[0].set_ylim(low / room, high * room)
    most = max(cell.ended for cell in cells)
    words = ["a mark for each run" if most < _MIN_RUNS else "box: quartiles, mark: median, whiskers: 5 to 95 %"]
    words += ["vertical numbers: share of runs that diverged or failed"] * any(cell.lost for cell in cells)
    words += [f"{len(keys) - len(shown)} more combinations: see the tables"] * (len(keys) > len(shown))
    handles: list[Artist] = [Patch(label=style.plain(name), **look) for name, look in looks.items()]
    if most < _MIN_RUNS:
        handles = [
            Line2D([], [], linestyle="", label=style.plain(name), **_mark(style.FILTER_STYLES[filters[name]]))
            for name in looks
        ]
    style.legend_above(figure, [*handles, *(Patch(label=text, color="none") for text in words)])
    return figure


def _mark(look: style.FilterStyle) -> dict[str, Any]:
    return {"marker": look.marker, "color": look.color, "markeredgecolor": "black"}


def _draw_runs(
    axes: Axes, cells: list[tuple[float, CellErrors]], width: float, look: dict[str, Any], marker: str
) -> None:
    """Draw a box of the errors of each cell or, if they are too few for quartiles, marks, and the share of failures."""
    boxed: list[tuple[float, Array]] = []
    for place, cell in cells:
        errors = np.minimum(cell.errors, plot_data.MAX_ERROR)
        if errors.size >= _MIN_RUNS:
            boxed.append((place, errors))
        else:
            at = np.full(errors.size, place)
            axes.plot(at, errors, marker, color=look["facecolor"], markeredgecolor="black", markersize=6.0)
        if cell.lost:
            failed = {"rotation": 90, "fontsize": 6.5, "ha": "center", "va": "bottom", "color": "#A00000"}
            axes.text(place, 0.01, f"{cell.lost:.0%}", transform=axes.get_xaxis_transform(), **failed)
    if not boxed:
        return
    places, errors = zip(*boxed, strict=True)
    boxes = axes.boxplot(
        errors,
        positions=places,
        widths=width,
        whis=(5, 95),
        manage_ticks=False,
        patch_artist=True,
        medianprops={"linewidth": 0.0},
        flierprops={"marker": marker, "markersize": 3.0, "markeredgecolor": "0.3", "markerfacecolor": "none"},
    )
    for box in boxes["boxes"]:
        box.set(**look)
    medians = [float(np.median(values)) for values in errors]
    axes.plot(places, medians, marker, color="white", markeredgecolor="black", markersize=6.0, zorder=4.0)


def map_figure(table: "pd.DataFrame", columns: list[str], filters: dict[str, str]) -> Figure:
    """Draw the median error over two settings, a panel for each filter, with the share of runs that were lost.

    Parameters
    ----------
    table : DataFrame
        Result of `auvid_cli.campaign.summary.by_filter`. Over further axes, errors are medians and shares are means.
    columns, filters
        As of `spread_figure`; the last two axes are the map's.
    """
    down, across = columns[-2:]
    rows, cols = list(dict.fromkeys(table[down])), list(dict.fromkeys(table[across]))
    n = len(filters)
    wide = min(n, 3)
    figure = style.new_figure(1.0 + wide * (0.62 * len(cols) + 0.9), -(-n // wide) * (0.42 * len(rows) + 1.0) + 0.5)
    panels = np.atleast_1d(figure.subplots(-(-n // wide), wide, sharex=True, sharey=True, squeeze=False)).ravel()
    errors = table["steady_state_error_percent"].clip(upper=plot_data.MAX_ERROR).dropna().to_numpy(dtype=np.float64)
    # Decades; NaN without a completed run.
    lowest, highest = np.log10([errors.min(), errors.max()]) if errors.size else (0.0, 0.0)
    image = None
    for axes, name in zip(panels, filters, strict=False):
        of_filter = table[table["filter"] == name]
        error, lost, inconsistent = (
            of_filter.groupby([down, across])[value]
            .agg(over)
            .unstack()
            .reindex(index=rows, columns=cols)
            .to_numpy(np.float64)
            for value, over in (
                ("steady_state_error_percent", "median"),
                ("diverged", "mean"),
                ("inconsistent", "mean"),
            )
        )
        decades = np.log10(np.minimum(error, plot_data.MAX_ERROR))
        image = axes.imshow(decades, vmin=lowest, vmax=highest, cmap="viridis_r", aspect="auto")
        for i, j in np.ndindex(len(rows), len(cols)):
            text = _rounded(float(error[i, j])) if np.isfinite(error[i, j]) else "-"
            text += f"\n{lost[i, j]:.0%} lost" if lost[i, j] > 0.0 else ""
            text += f"\n{inconsistent[i, j]:.0%} incons." if inconsistent[i, j] > 0.0 else ""
            is_dark = decades[i, j] > 0.5 * (lowest + highest)
            axes.text(j, i, text, ha="center", va="center", fontsize=6, color="white" if is_dark else "black")
        axes.set_xticks(range(len(cols)), [style.plain(setting_text(value)) for value in cols], fontsize=8)
        axes.set_yticks(range(len(rows)), [style.plain(setting_text(value)) for value in rows], fontsize=8)
        style.head(axes, style.plain(name))
    for axes in panels[n:]:
        axes.set_visible(False)
    figure.supxlabel(style.plain(across), fontsize=9)
    figure.supylabel(style.plain(down), fontsize=9)
    if image is not None:
        bar = figure.colorbar(image, ax=panels.tolist(), shrink=0.8)
        bar.set_label("median error (%),\ndarker is larger", fontsize=8)
        bar.ax.yaxis.set_major_formatter(lambda decades, _: _rounded(10.0**decades))
    return figure


def _rounded(percent: float) -> str:
    """Write two digits, not as a power of ten."""
    return f"{float(f'{percent:.2g}'):g}"


def _looks(filters: dict[str, str]) -> dict[str, dict[str, Any]]:
    """Return the fill of each variant: the colour of its filter, and a hatching of its own."""
    return {
        name: {"facecolor": style.FILTER_STYLES[kind].color, "hatch": _FILTER_HATCHES[place % len(_FILTER_HATCHES)]}
        for place, (name, kind) in enumerate(filters.items())
    }
