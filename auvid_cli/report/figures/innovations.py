"""Whether the innovations of a filter stay within their own bounds."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from auvid_cli.data.estimate import Course
from auvid_cli.data.innovations import Innovations
from auvid_cli.report.figures.limits import value_range, with_near_zero
from auvid_cli.report.figures.series import spaced
from auvid_cli.report.figures.style import head, legend_above, new_figure, say, tidy
from auvid_cli.report.notation import filter_label, symbol_math
from auvid_cli.vehicle.parameters import SENSORS, Quantity

Array = NDArray[np.float64]

# Dots are an image inside the SVG, so their number costs little.
_DOTS: dict[str, Any] = {"color": "#56B4E9", "linestyle": "", "marker": "."}
_BOUND: dict[str, Any] = {"color": "black", "linewidth": 1.1}
_BOUND_POINTS = 400
# Height of a panel in bounds: wild measurements beyond it are counted, not drawn.
_HIGHEST = 3.0
# Units in which numbers are of a size that an axis has room for, and how many of them an SI unit is.
_READABLE = {"rad": ("deg", float(np.rad2deg(1.0))), "T": ("µT", 1e6)}


def innovation_figure(estimate: Course) -> Figure:
    """Draw a panel for each component of each sensor: innovations, their bounds of two standard deviations."""
    sensors = estimate.innovations
    columns = max(len(SENSORS[name]) for name in sensors)
    figure = new_figure(11.0, 2.2 * len(sensors) + 0.7)
    panels = figure.subplots(len(sensors), columns, sharex=True, squeeze=False)
    for row, (name, innovations) in zip(panels, sensors.items(), strict=True):
        for component, quantity in enumerate(SENSORS[name]):
            _draw_panel(row[component], name, quantity, innovations, component)
        for axes in row[len(SENSORS[name]) :]:
            axes.remove()
    for axes in panels[-1, : len(SENSORS[list(sensors)[-1]])]:
        axes.set_xlabel("time (s)", fontsize=9)
    handles = [
        Line2D([], [], label=f"innovations of {filter_label(estimate.filter)}", markersize=7.0, **_DOTS),
        Line2D([], [], label="±2 standard deviations", **_BOUND),
    ]
    legend_above(figure, handles)
    return figure


def _draw_panel(axes: Axes, sensor: str, quantity: Quantity, innovations: Innovations, component: int) -> None:
    tidy(axes)
    unit, scale = _READABLE.get(quantity.unit, (quantity.unit, 1.0))
    innovation = innovations.innovation[:, component] * scale
    bound = 2.0 * np.sqrt(innovations.variance[:, component]) * scale
    known = np.isfinite(innovation) & np.isfinite(bound)
    time, innovation, bound = innovations.time[known], innovation[known], bound[known]
    axes.set_ylabel(f"{symbol_math(quantity.symbol)} ({unit})", fontsize=9)
    if not time.size:
        head(axes, sensor)
        say(axes, "no finite innovations")
        return
    height = _height(innovation, bound)
    beyond = int((np.abs(innovation) > height).sum())
    within = float((np.abs(innovation) <= bound).mean()) * 100.0
    title = f"{sensor}: {within:.1f} % within bounds"
    head(axes, title + (f", {beyond} beyond axis" if beyond else ""))
    axes.plot(time, innovation, markersize=1.6, rasterized=True, **_DOTS)
    some = spaced(time.size, _BOUND_POINTS)
    for sign in (1.0, -1.0):
        axes.plot(time[some], sign * bound[some], **_BOUND)
    axes.set_ylim(-height, height)
    axes.set_xlim(*with_near_zero(float(time[0]), max(float(time[-1]), float(time[0]) + 1e-3)))


def _height(innovation: Array, bound: Array) -> float:
    """Return half the panel's height: all innovations, but no more than a few times their usual bounds."""
    _, largest = value_range(np.abs(innovation)) or (0.0, 0.0)
    usual = float(np.median(bound))
    return 1.1 * max(usual, min(largest, _HIGHEST * usual)) or 1.0
