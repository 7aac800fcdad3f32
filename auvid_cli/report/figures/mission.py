"""A designed run before it is made: what is added to the commands, where vehicles go, what it tells."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from auvid_cli.design.band import Band
from auvid_cli.report.figures.style import BAND_SHADE, head, legend_above, new_figure, plain_log_ticks, tidy
from auvid_cli.report.notation import symbol_math

Array = NDArray[np.float64]

_DESIGNED, _SPIRAL = "#0072B2", "#E69F00"


def mission_figure(
    time: Array, inputs: Array, band: Band, symbols: tuple[str, ...], percents: dict[str, Array]
) -> Figure:
    """Draw it.

    Parameters
    ----------
    time : ndarray, shape (n,)
    inputs : ndarray, shape (n, 4)
        What the actuators of the vehicle as it is believed to be do: rad, N, N m.
    band : Band
    symbols : tuple of str
        Of the coefficients.
    percents : dict of ndarray, shape (m,)
        Standard deviations of the coefficients, %, by the name of the manoeuvre, the one to sail first.
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


def _draw_track(axes: Axes, band: Band) -> None:
    """Draw the middle of the tracks, and every few seconds how far 5 to 95 of 100 are from it."""
    north, east = band.position[:, 0], band.position[:, 1]
    for place in range(0, band.time.size, 2):
        corners = east[place, [0, 2, 2, 0]], north[place, [0, 0, 2, 2]]
        axes.fill(*corners, color=_DESIGNED, alpha=0.2 * BAND_SHADE, linewidth=0.0)
    axes.plot(east[:, 1], north[:, 1], color=_DESIGNED, linewidth=1.4)
    axes.plot(east[[0], 1], north[[0], 1], "o", markerfacecolor="white", markeredgecolor="black")
    _label(axes, "north (m)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east (m)", fontsize=9)
    head(axes, f"{band.number} vehicles as they may be: middle, 5 to 95 %")


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
