"""How things look: one style for each filter, told apart by colour, lightness, dashes and markers."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from auvid_cli.config.filter_name import FilterName
from auvid_cli.printable import printable
from auvid_cli.report.notation import filter_label

DPI = 150

TRUE_LINE: dict[str, Any] = {"color": "black", "linewidth": 1.1, "linestyle": (0, (6, 3))}
MEASURED: dict[str, Any] = {"color": "0.8", "linewidth": 3.4}
BAND_ALPHA = 0.13


class FilterStyle(NamedTuple):
    """Line of a filter; colours are Okabe and Ito's, light and wide below dark and thin."""

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


# In the order of the filters; the last is left for one more.
_STYLES = (
    FilterStyle("#56B4E9", "-", 2.6, "o", 7.0),
    FilterStyle("#D55E00", "-", 1.2, "s", 5.0),
    FilterStyle("#000000", (0, (1, 1.3)), 1.5, "^", 5.0),
    FilterStyle("#009E73", (0, (5, 1.5, 1, 1.5)), 1.2, "D", 4.5),
    FilterStyle("#0072B2", (0, (3, 1, 1, 1, 1, 1)), 2.0, "P", 5.5),
    FilterStyle("#CC79A7", (0, (7, 2)), 1.8, "v", 5.5),
    FilterStyle("#E69F00", (0, (9, 2, 3, 2)), 1.5, "X", 5.5),
)
FILTER_STYLES = {name.value: style for name, style in zip(FilterName, _STYLES, strict=False)}


if len(FILTER_STYLES) < len(FilterName):
    raise TypeError("there are more filters than styles")


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure, inches, that arranges its own panels."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def filter_handles(names: Iterable[str], marked: bool = False) -> list[Line2D]:
    """Return the entries of a legend."""
    styles = {name: FILTER_STYLES[name] for name in names}
    return [
        Line2D([], [], label=filter_label(name), **style.line(), **(style.mark() if marked else {}))
        for name, style in styles.items()
    ]


def legend_above(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put a legend outside all panels."""
    figure.legend(
        handles=list(handles), loc="outside upper center", ncols=max(len(handles), 1), frameon=False, handlelength=3.5
    )


def tidy(axes: Axes) -> None:
    """Set small type, a faint grid, few ticks, no box."""
    axes.grid(color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    head(axes, "")
    axes.tick_params(labelsize=8)
    axes.xaxis.set_major_locator(MaxNLocator(7))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.spines[["top", "right"]].set_visible(False)


def plain(text: str) -> str:
    """Return a user's text as it is, its dollars no mathematics."""
    return printable(text).replace("$", r"\$")


def plain_log_ticks(axis: Axis) -> None:
    """Write plain numbers at a logarithmic axis: 1, 2 and 5 times powers of ten, or what is between two of them."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(NullFormatter())


def head(axes: Axes, text: str) -> None:
    """Put a heading above a panel."""
    # With a place of its own it need not be fitted in, a large part of the time that a figure takes.
    axes.set_title(text, fontsize=9.5, y=1.0)


def say(axes: Axes, text: str) -> None:
    """Put words where there is nothing to draw."""
    axes.set_yticks([])
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=9, color="0.35")
