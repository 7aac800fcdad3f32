"""Style of all figures: fonts, colours, axes and limits."""

from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator

from auvid_cli.arrays import Array
from auvid_cli.report.lines import FILTER_LINES
from auvid_cli.report.table import filter_label
from auvid_cli.text import printable

DPI = 150
WIDTH = 11.0  # inch, of all figures
_MAX_HANDLES = 9  # entries in a row of the legend
_LEGEND_ROW = 0.22  # inch
_LEGEND: dict[str, Any] = {"handlelength": 3.5, "fontsize": 9, "columnspacing": 1.5}
TRUE_LINE: dict[str, Any] = {"color": "black", "linewidth": 1.1, "linestyle": (0, (6, 3))}
MEASURED: dict[str, Any] = {"color": "0.8", "linewidth": 3.4}
# Opacity of all bands on top of each other, low enough to see the lines.
BAND_SHADE = 0.26
# Behind words on lines.
_BEHIND: dict[str, Any] = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}


class FilterStyle(NamedTuple):
    """Line and mark of a filter as keywords of matplotlib."""

    color: str
    linestyle: Any
    linewidth: float
    marker: str
    markersize: float

    def line(self) -> dict[str, Any]:
        """Return keywords for `Axes.plot`."""
        return {"color": self.color, "linestyle": self.linestyle, "linewidth": self.linewidth}

    def mark(self) -> dict[str, Any]:
        """Return keywords for the markers on that line."""
        return {
            "marker": self.marker,
            "markersize": self.markersize,
            "markeredgecolor": "white",
            "markeredgewidth": 0.5,
        }

    def marked_line(self, position: int, points: int) -> dict[str, Any]:
        """Return keywords for the line with a few markers, which those of the other filters do not cover."""
        step = max(points // 5, 1)
        every = (step * (2 * position + 1) // 8, step)
        return self.line() | self.mark() | {"markevery": every}


FILTER_STYLES = {
    str(name): FilterStyle(line.color, (0, line.dash) if line.dash else "-", line.width, line.marker, line.marker_size)
    for name, line in FILTER_LINES.items()
}


class Room(NamedTuple):
    """Margins of the panels of a figure and gaps between them, inches."""

    left: float = 0.85
    right: float = 0.2
    below: float = 0.5
    across: float = 0.8
    between: float = 0.15


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, inches, with automatic layout, which takes half of the drawing time."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def sized_figure(width: float, height: float) -> Figure:
    """Return an empty figure, inches, without automatic layout."""
    return Figure(figsize=(width, height), dpi=DPI)


def new_panels(
    number: int,
    most_columns: int,
    height: float,
    handles: Sequence[Artist],
    room: Room,
    span: tuple[float, float],
    with_heads: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Return a figure of equal panels over the same time axis, with a legend above.

    Parameters
    ----------
    number, most_columns : int
        Number of panels and of columns, filled row by row.
    height : float
        Height of a panel, inches.
    handles : sequence of Artist
        Entries of the legend.
    span : tuple of float
        Limits of the time axis, s.
    with_heads : bool
        Whether there is a heading above the panels.
    """
    columns = min(number, most_columns)
    rows = -(-number // columns)
    legend_rows = -(-len(handles) // _MAX_HANDLES)
    above = 0.15 + _LEGEND_ROW * (legend_rows + with_heads)
    inches = room.below + rows * height + (rows - 1) * room.between + above
    figure = sized_figure(WIDTH, inches)
    width = (WIDTH - room.left - room.right - (columns - 1) * room.across) / columns
    grid = figure.add_gridspec(
        rows,
        columns,
        left=room.left / WIDTH,
        right=1.0 - room.right / WIDTH,
        bottom=room.below / inches,
        top=1.0 - above / inches,
        wspace=room.across / width,
        hspace=room.between / height,
    )
    legend_above(figure, handles)
    # Sharing axes would take time that grows with the square of their number.
    panels = [figure.add_subplot(grid[place // columns, place % columns]) for place in range(number)]
    for place, axes in enumerate(panels):
        tidy(axes)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.set_xlim(span[0], max(span[1], span[0] + 1e-3))
        if place + columns < number:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time (s)", fontsize=9)
    return figure, panels


def draw_band(axes: Axes, time: Array, low: Array | float, high: Array, color: str, number: int) -> None:
    """Shade the area between two series with the opacity of one of `number` bands; gaps stay empty."""
    alpha = 1.0 - (1.0 - BAND_SHADE) ** (1.0 / number)
    known = np.isfinite(low) & np.isfinite(high)
    for piece in np.split(np.arange(time.size), np.flatnonzero(np.diff(known)) + 1):
        if known[piece].all():
            across = np.concatenate([time[piece], time[piece][::-1]])
            up = np.concatenate([high[piece], np.broadcast_to(low, time.shape)[piece][::-1]])
            outline = Polygon(np.stack([across, up], axis=1), color=color, alpha=alpha, linewidth=0, zorder=1.5)
            # `fill_between` would update the limits of the axes, which are fixed.
            axes.add_artist(outline)


def name_values(figure: Figure, text: str) -> None:
    """Label the values of all panels at the left edge."""
    figure.supylabel(text, fontsize=9, x=0.12 / figure.get_figwidth())


def filter_handles(names: Iterable[str], marked: bool = False) -> list[Line2D]:
    """Return the entries of a legend."""
    styles = {name: FILTER_STYLES[name] for name in names}
    return [
        Line2D([], [], label=filter_label(name), **style.line(), **(style.mark() if marked else {}))
        for name, style in styles.items()
    ]


def legend_above(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put a legend outside all panels."""
    # Only a figure with automatic layout makes room outside of its panels.
    place = "outside upper center" if figure.get_layout_engine() else "upper center"
    ncols = min(max(len(handles), 1), _MAX_HANDLES)
    figure.legend(handles=list(handles), loc=place, ncols=ncols, frameon=False, **_LEGEND)


def plain_frame(axes: Axes, grid: Literal["both", "x", "y"] = "both") -> None:
    """Set small type, a faint grid, no box."""
    axes.grid(color="0.9", linewidth=0.6, axis=grid)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def tidy(axes: Axes) -> None:
    """Set a plain frame and few ticks."""
    plain_frame(axes)
    axes.xaxis.set_major_locator(MaxNLocator(7))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.ticklabel_format(axis="y", useOffset=False)


def plain(text: str) -> str:
    """Return the text of a user without mathematics: dollars are escaped."""
    return printable(text).replace("$", r"\$")


def plain_decades(axis: Axis) -> None:
    """Write plain numbers at a few powers of ten of a logarithmic axis."""
    axis.set_major_locator(LogLocator(numticks=6))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_locator(NullLocator())


def plain_log_ticks(axis: Axis) -> None:
    """Write plain numbers at a logarithmic axis: 1, 2 and 5 times powers of ten, or round numbers on a short axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(NullFormatter())


def name_panel(axes: Axes, text: str, height: float = 0.95) -> None:
    """Put a name at the right edge of a panel, its top at a height from 0 to 1."""
    axes.text(0.98, height, text, transform=axes.transAxes, ha="right", va="top", fontsize=9, bbox=_BEHIND)


def head(axes: Axes, text: str) -> None:
    """Put a heading above a panel."""
    # A fixed place saves the layout of the title, a large part of the drawing time.
    axes.set_title(text, fontsize=9.5, y=1.0)


def show_message(axes: Axes, text: str) -> None:
    """Write a message in an empty panel."""
    axes.tick_params(axis="y", left=False, labelleft=False)
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=9, color="0.35")
