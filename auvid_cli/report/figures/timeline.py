"""What was recorded when, and where something is the matter with it."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from auvid_cli.inspection.inspection import Inspection, Mark, MarkKind
from auvid_cli.report.figures.series import thin
from auvid_cli.report.figures.style import legend_above, new_figure, tidy
from auvid_cli.report.notation import unit_text
from auvid_cli.vehicle.parameters import INPUTS

Array = NDArray[np.float64]

_POINTS = 3000
_PRESENT = "#9BC4DE"
# Kinds of trouble: colour, height of its row in a strip from 0 to 1, and words. All have the same place in every strip.
_KINDS: dict[MarkKind, tuple[str, float, str]] = {
    "spike": ("#D55E00", 0.90, "spikes"),
    "step": ("#CC79A7", 0.70, "angle jumps away"),
    "stuck": ("#E69F00", 0.50, "stuck"),
    "clock": ("#000000", 0.30, "clock jumps"),
    "gap": ("#009E73", 0.10, "gaps"),
}
_ROW = 0.16
# Share of the span that a mark takes at least, to be seen.
_LEAST = 0.0025
_INPUT_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_HOUR, _MINUTE = 3600.0, 60.0


def timeline_figure(inspection: Inspection) -> Figure:
    """Draw inputs on top, and a strip for each sensor: how much of it there is, and its marks by kind."""
    names = list(inspection.presence)
    n_inputs = len(INPUTS)
    figure = new_figure(11.0, 0.85 * n_inputs + 0.75 * len(names) + 1.2)
    panels = figure.subplots(
        n_inputs + len(names), 1, sharex=True, squeeze=False, height_ratios=[0.85] * n_inputs + [0.75] * len(names)
    )[:, 0]
    longest = inspection.span[1] - inspection.span[0]
    scale, unit = (
        (_HOUR, "h") if longest > 2.0 * _HOUR else (_MINUTE, "min") if longest > 20.0 * _MINUTE else (1.0, "s")
    )
    for column, axes in enumerate(panels[:n_inputs]):
        _draw_input(axes, inspection, column, scale)
    for axes, name in zip(panels[n_inputs:], names, strict=True):
        _draw_strip(axes, inspection, name, scale)
    panels[-1].set_xlim(inspection.span[0] / scale, inspection.span[1] / scale)
    panels[-1].set_xlabel(f"time ({unit})", fontsize=9)
    present = {mark.kind for mark in inspection.marks}
    handles: list[Any] = [Patch(color=_PRESENT, label="measurements present")]
    handles += [Patch(color=colour, label=words) for kind, (colour, _, words) in _KINDS.items() if kind in present]
    legend_above(figure, handles)
    return figure


def _draw_input(axes: Axes, inspection: Inspection, column: int, scale: float) -> None:
    quantity = INPUTS[column]
    tidy(axes)
    degrees = quantity.unit == "rad"
    values = inspection.inputs.values[:, column] * (np.rad2deg(1.0) if degrees else 1.0)
    time, values = thin(inspection.inputs.time, values, _POINTS)
    axes.plot(
        time / scale, values, color=_INPUT_COLOURS[column], linewidth=0.7, drawstyle="steps-post", rasterized=True
    )
    _name(axes, f"{quantity.symbol.replace('_', ' ')}\n({'deg' if degrees else unit_text(quantity.unit)})")
    axes.locator_params(axis="y", nbins=3)


def _draw_strip(axes: Axes, inspection: Inspection, name: str, scale: float) -> None:
    tidy(axes)
    axes.grid(visible=False, axis="y")
    axes.set_yticks([])
    axes.set_ylim(0.0, 1.0)
    edges = np.linspace(*inspection.span, inspection.presence[name].size + 1) / scale
    axes.stairs(inspection.presence[name], edges, fill=True, color=_PRESENT, alpha=0.55, linewidth=0.0)
    least = _LEAST * (inspection.span[1] - inspection.span[0])
    marks = [mark for mark in inspection.marks if mark.sensor == name]
    for kind, (colour, height, _) in _KINDS.items():
        spans = _drawn([mark for mark in marks if mark.kind == kind], least)
        boxes = [Rectangle((a / scale, height - 0.5 * _ROW), (b - a) / scale, _ROW) for a, b in spans]
        axes.add_collection(PatchCollection(boxes, facecolor=colour, edgecolor="none"), autolim=False)
    counted = {words: sum(mark.kind == kind for mark in marks) for kind, (*_, words) in _KINDS.items()}
    counts = ", ".join(f"{words}: {count}" for words, count in counted.items() if count)
    _name(axes, name)
    if counts:
        axes.text(1.0, 1.02, counts, transform=axes.transAxes, ha="right", va="bottom", fontsize=7.5, color="0.25")


def _drawn(marks: list[Mark], least: float) -> list[tuple[float, float]]:
    """Widen the spans of marks, s, until they can be seen; those that overlap are one."""
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
    axes.set_ylabel(text, fontsize=8.5, rotation=0, ha="right", va="center", labelpad=8)
