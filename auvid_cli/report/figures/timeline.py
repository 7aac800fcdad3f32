"""Figures over time: an inspected dataset and a designed mission."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from auvid_cli.arrays import Array
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.inspection.inspection import Inspection, Mark, MarkKind
from auvid_cli.report.figures.style import BAND_SHADE, WIDTH, head, legend_above, new_figure, plain_log_ticks, tidy
from auvid_cli.report.plot_data import scale_of, thin
from auvid_cli.report.table import symbol_math
from auvid_cli.vehicle.parameters import SENSORS, Quantity

if TYPE_CHECKING:
    # It loads the compiled core.
    from auvid_cli.design.mission import Band

_DESIGNED = "#0072B2"
_SPIRAL = "#E69F00"
_POINTS = 3000
_PRESENT = "#9BC4DE"
_ROW = 0.16
_MIN_MARK = 0.0025  # share of the span, width of a visible mark
_INPUT: dict[str, Any] = {"color": "0.35", "linewidth": 0.8, "drawstyle": "steps-post", "rasterized": True}
_SIGNAL: dict[str, Any] = {"color": "#0072B2", "linewidth": 0.8, "rasterized": True}
_HOUR = 3600.0  # s
_MINUTE = 60.0  # s
_PANEL = 0.62  # inch, height of a signal
_STRIP = 0.42  # inch, height of a sensor's strip


def mission_figure(
    time: Array, inputs: Array, band: "Band", symbols: tuple[str, ...], percents: dict[str, Array]
) -> Figure:
    """Draw inputs, depth, track and expected standard deviations of a designed run.

    Parameters
    ----------
    time : ndarray, shape (n,)
    inputs : ndarray, shape (n, 4)
        Inputs of the expected vehicle: rad, N, N m.
    symbols : tuple of str
        Symbols of the coefficients.
    percents : dict of ndarray, shape (m,)
        Standard deviations of the coefficients, %, by manoeuvre, the designed one first.
    """
    figure = new_figure(11.0, 7.4)
    grid = figure.add_gridspec(3, 2, width_ratios=[1.0, 1.1])
    fins, thrust, depth = (figure.add_subplot(grid[row, 0]) for row in range(3))
    track, bars = figure.add_subplot(grid[:2, 1]), figure.add_subplot(grid[2, 1])
    for column, name, color, dashes in ((0, "rudder", _DESIGNED, "-"), (1, "elevator", _SPIRAL, (0, (4, 1.5)))):
        fins.plot(time, np.rad2deg(inputs[:, column]), color=color, linewidth=0.9, linestyle=dashes, label=name)
    thrust.plot(time, inputs[:, 2], color="black", linewidth=0.9)
    _label(fins, "fins (°)")
    _label(thrust, "thrust (N)")
    legend_above(figure, fins.lines)
    low, middle, high = band.position[:, 2].T
    depth.fill_between(band.time, low, high, color=_DESIGNED, alpha=BAND_SHADE, linewidth=0.0)
    depth.plot(band.time, middle, color=_DESIGNED, linewidth=1.2)
    depth.invert_yaxis()
    _label(depth, "depth changed (m)")
    depth.set_xlabel("time (s)", fontsize=9)
    _draw_track(track, band)
    _draw_percents(bars, symbols, percents)
    return figure


def _label(axes: Axes, text: str) -> None:
    tidy(axes)
    axes.set_ylabel(text, fontsize=9)


def _draw_track(axes: Axes, band: "Band") -> None:
    """Draw the median track and the area of 5 to 95 % of the tracks."""
    north, east = band.position[:, 0], band.position[:, 1]
    for place in range(0, band.time.size, 2):
        corners = east[place, [0, 2, 2, 0]], north[place, [0, 0, 2, 2]]
        axes.fill(*corners, color=_DESIGNED, alpha=0.2 * BAND_SHADE, linewidth=0.0)
    axes.plot(east[:, 1], north[:, 1], color=_DESIGNED, linewidth=1.4)
    axes.plot(east[[0], 1], north[[0], 1], "o", markerfacecolor="white", markeredgecolor="black")
    _label(axes, "north (m)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east (m)", fontsize=9)
    head(axes, f"{band.number} trial vehicles: median, 5 to 95 %")


def _draw_percents(axes: Axes, symbols: tuple[str, ...], percents: dict[str, Array]) -> None:
    places = np.arange(len(symbols))
    for (name, percent), color, marker in zip(percents.items(), (_DESIGNED, _SPIRAL), "os", strict=False):
        known = np.where(percent > 0.0, percent, np.nan)
        axes.plot(places, known, marker, color=color, markersize=4.0, label=name)
    axes.set_yscale("log")
    axes.set_xticks(places, [symbol_math(symbol) for symbol in symbols], rotation=90, fontsize=7)
    plain_log_ticks(axes.yaxis)
    axes.grid(color="0.9", linewidth=0.6, axis="y")
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_ylabel("expected sd (%)", fontsize=9)
    axes.legend(frameon=False, fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)


class _Look(NamedTuple):
    """Style of a kind of fault; `height` is that of its row in a strip, 0 to 1."""

    color: str
    marker: str
    height: float
    words: str


# The rows are the same in all strips.
_KINDS: dict[MarkKind, _Look] = {
    "spike": _Look("#D55E00", "v", 0.90, "spikes"),
    "step": _Look("#CC79A7", "D", 0.70, "angle jumps away"),
    "stuck": _Look("#E69F00", "s", 0.50, "stuck"),
    "clock": _Look("#000000", "o", 0.30, "clock jumps"),
    "gap": _Look("#009E73", "X", 0.10, "gaps"),
}


class _Signal(NamedTuple):
    """A line over time, s, in a readable unit."""

    name: str
    time: Array
    values: Array
    line: dict[str, Any]


def timeline_figure(sensors: dict[str, SensorRecord], inspection: Inspection) -> Figure:
    """Draw the inputs, and the signals, presence and faults of each sensor."""
    inputs = inspection.inputs
    rows: list[_Signal | str] = [
        _signal(quantity.symbol.replace("_", " "), quantity, inputs.time, values, _INPUT)
        for quantity, values in zip(inputs.quantities, inputs.values.T, strict=True)
    ]
    for name in inspection.presence:
        rows += [
            _signal(symbol_math(quantity.symbol), quantity, sensors[name].time, values, _SIGNAL)
            for quantity, values in zip(SENSORS[name], sensors[name].values.T, strict=True)
            if np.isfinite(values).any()
        ]
        rows.append(name)
    heights = [_STRIP if isinstance(row, str) else _PANEL for row in rows]
    figure = new_figure(WIDTH, sum(heights) + 1.0)
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    longest = inspection.span[1] - inspection.span[0]
    scale, unit = (
        (_HOUR, "h") if longest > 2.0 * _HOUR else (_MINUTE, "min") if longest > 20.0 * _MINUTE else (1.0, "s")
    )
    for axes, row in zip(panels, rows, strict=True):
        if isinstance(row, str):
            _draw_strip(axes, inspection, row, scale)
        else:
            _draw_signal(axes, row, scale)
    panels[-1].set_xlim(inspection.span[0] / scale, inspection.span[1] / scale)
    panels[-1].set_xlabel(f"time ({unit})", fontsize=9)
    legend_above(figure, _handles(inspection))
    return figure


def _signal(name: str, quantity: Quantity, time: Array, values: Array, line: dict[str, Any]) -> _Signal:
    scale = scale_of(quantity)
    return _Signal(f"{name} ({scale.unit})", time, scale.factor * values, line)


def _handles(inspection: Inspection) -> list[Artist]:
    """Return the legend entries of the marks that exist."""
    present = {mark.kind for mark in inspection.marks}
    handles: list[Artist] = [Patch(color=_PRESENT, label="measurements present")]
    for kind, look in _KINDS.items():
        if kind in present:
            line = {"color": look.color, "marker": look.marker, "markersize": 5.0, "linewidth": 3.0}
            handles.append(Line2D([], [], label=look.words, **line))
    return handles


def _draw_signal(axes: Axes, signal: _Signal, scale: float) -> None:
    tidy(axes)
    time, values = thin(signal.time, signal.values, _POINTS)
    axes.plot(time / scale, values, **signal.line)
    _name(axes, signal.name)
    axes.locator_params(axis="y", nbins=3)


def _draw_strip(axes: Axes, inspection: Inspection, name: str, scale: float) -> None:
    tidy(axes)
    axes.grid(visible=False, axis="y")
    axes.set_yticks([])
    axes.set_ylim(0.0, 1.0)
    edges = np.linspace(*inspection.span, inspection.presence[name].size + 1) / scale
    axes.stairs(inspection.presence[name], edges, fill=True, color=_PRESENT, alpha=0.55, linewidth=0.0)
    least = _MIN_MARK * (inspection.span[1] - inspection.span[0])
    marks = [mark for mark in inspection.marks if mark.sensor == name]
    for kind, look in _KINDS.items():
        spans = _drawn([mark for mark in marks if mark.kind == kind], least)
        boxes = [Rectangle((a / scale, look.height - 0.5 * _ROW), (b - a) / scale, _ROW) for a, b in spans]
        axes.add_collection(PatchCollection(boxes, facecolor=look.color, edgecolor="none"), autolim=False)
        middles = [0.5 * (a + b) / scale for a, b in spans]
        axes.plot(middles, [look.height] * len(spans), look.marker, markersize=3.5, color=look.color)
    counted = {look.words: sum(mark.kind == kind for mark in marks) for kind, look in _KINDS.items()}
    counts = ", ".join(f"{words}: {count}" for words, count in counted.items() if count)
    _name(axes, name)
    if counts:
        axes.text(1.0, 1.02, counts, transform=axes.transAxes, ha="right", va="bottom", fontsize=7.5, color="0.25")


def _drawn(marks: list[Mark], least: float) -> list[tuple[float, float]]:
    """Return the spans of marks, s, widened to be visible; overlapping ones are joined."""
    spans: list[tuple[float, float]] = []
    for mark in sorted(marks, key=lambda mark: mark.start):
        room = max(least - (mark.end - mark.start), 0.0) / 2.0
        start, end = mark.start - room, mark.end + room
        if spans and start <= spans[-1][1]:
            spans[-1] = spans[-1][0], max(end, spans[-1][1])
        else:
            spans.append((start, end))
    return spans


def _name(axes: Axes, text: str) -> None:
    axes.set_ylabel(text, fontsize=8, rotation=0, ha="right", va="center", labelpad=8)
