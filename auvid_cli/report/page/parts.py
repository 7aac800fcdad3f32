"""Parts that pages consist of, and SVG pictures."""

from collections.abc import Mapping, Sequence
from math import ceil, floor, log10
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.report.plot_data import spaced
from auvid_cli.report.table import Table

_MAX_POINTS = 600  # points of a path, more than a screen shows
_FEW_DECADES = 2.0  # length of a logarithmic axis that also has numbers at 2 and 5
_MAX_TEXT_COLUMNS = 4  # columns of text that fit on a narrow screen
_MAX_ROWS = 24  # rows of a table without a scroll bar


class Stroke(NamedTuple):
    """A line through points, shape (n, 2), of a look."""

    points: Array
    look: str


class Rule(NamedTuple):
    """A straight line from one point to another."""

    x1: float
    y1: float
    x2: float
    y2: float
    look: str


class Box(NamedTuple):
    """A filled rectangle."""

    x: float
    y: float
    width: float
    height: float
    look: str


class Dot(NamedTuple):
    """A mark in the shape of its look, with the text shown under the pointer."""

    x: float
    y: float
    look: str
    says: str


class TextLabel(NamedTuple):
    """A text with the subscript `below`."""

    x: float
    y: float
    text: str
    anchor: Literal["start", "middle", "end"] = "start"
    below: str = ""


Shape: TypeAlias = Stroke | Rule | Box | Dot | TextLabel


class Picture(NamedTuple):
    """A picture."""

    title: str
    says: str  # description in words
    width: float  # in the coordinates of the shapes; also the largest width on the page, pixels
    height: float  # in the coordinates of the shapes, y down; also the largest height on the page, pixels
    shapes: Sequence[Shape]  # the first is the lowest
    legend: Sequence[tuple[str, str]] = ()  # looks and labels


class Axis(NamedTuple):
    """A scale from values to places: `low` at `begin`, `high` at `end`."""

    low: float
    high: float
    begin: float
    end: float

    def at(self, value: float) -> float:
        """Return the place of a value."""
        return self.begin + (value - self.low) / (self.high - self.low) * (self.end - self.begin)

    def ticks(self, most: int = 7) -> list[float]:
        """Return at most `most` round values: multiples of 1, 2 or 5 times a power of ten."""
        rough = (self.high - self.low) / max(most - 1, 1)
        power = 10.0 ** floor(log10(rough))
        step = next(times * power for times in (1.0, 2.0, 5.0, 10.0) if times * power >= rough * (1.0 - 1e-9))
        return [k * step for k in range(ceil(self.low / step - 1e-9), floor(self.high / step + 1e-9) + 1)]


def stroke(x: Array, y: Array, across: Axis, down: Axis, look: str) -> Stroke:
    """Return a line along two axes; a long one has evenly spaced points."""
    some = spaced(x.size, _MAX_POINTS)
    pairs = zip(x[some].tolist(), y[some].tolist(), strict=True)
    return Stroke(np.array([(across.at(a), down.at(b)) for a, b in pairs]), look)


def decades(across: Axis, top: float, bottom: float) -> list[Shape]:
    """Return grid and numbers of a logarithmic axis: powers of ten, on a short axis also 2 and 5 times these."""
    digits = (1.0, 2.0, 5.0) if across.high - across.low <= _FEW_DECADES else (1.0,)
    values = [digit * 10.0**power for power in range(int(across.low), int(across.high) + 1) for digit in digits]
    shapes: list[Shape] = []
    for value in values:
        if log10(value) <= across.high:
            x = across.at(log10(value))
            shapes += [Rule(x, top, x, bottom, "grid"), TextLabel(x, bottom + 16.0, f"{value:g}", "middle")]
    return shapes


def frame(across: Axis, down: Axis, x_label: str, y_label: str) -> list[Shape]:
    """Return grid, numbers and names of two axes."""
    left, right = sorted((across.begin, across.end))
    top, bottom = sorted((down.begin, down.end))
    shapes: list[Shape] = []
    for value in across.ticks():
        x = across.at(value)
        shapes += [Rule(x, top, x, bottom, "grid"), TextLabel(x, bottom + 16.0, f"{value:g}", "middle")]
    for value in down.ticks():
        y = down.at(value)
        shapes += [Rule(left, y, right, y, "grid"), TextLabel(left - 6.0, y + 4.0, f"{value:g}", "end")]
    shapes.append(TextLabel(0.5 * (left + right), bottom + 36.0, x_label, "middle"))
    shapes.append(TextLabel(left - 6.0, top - 10.0, y_label, "start"))
    return shapes


class PlotLine(NamedTuple):
    """A series of a plot."""

    label: str
    look: str  # the name of a filter (see `FILTER_LINES`) or a class of page.css, such as "measured" or "true"
    time: Array  # abscissa, increasing, shape (n,)
    values: Array  # ordinate, shape (n,); NaN breaks the line
    kind: Literal["line", "steps", "dots"] = "line"  # drawn as a line, as steps or as dots
    of: str = ""  # filter whose selection shows the line; empty if it is always shown
    key: str = ""  # entry for this look in a legend below the plot; empty if the legend is above all plots


class Plot(NamedTuple):
    """A plot with zoom."""

    title: str
    says: str  # description in words, for readers who do not see the plot
    unit: str  # unit of the ordinate
    lines: Sequence[PlotLine]
    x_label: str = "time (s)"
    log_x: bool = False
    log_y: bool = False
    marks: Sequence[tuple[float, float]] = ()  # spans of the abscissa to be shaded
    limits: tuple[float, float] | None = None  # limits of the ordinate; `says` counts the values beyond


class Plots(NamedTuple):
    """Plots side by side."""

    plots: Sequence[Plot]
    linked: str = ""  # plots with the same word are zoomed together; empty for a plot by itself
    choice: Mapping[str, str] = {}  # labels of the filters, by name, of which one is shown at a time; empty if all are
    wide: bool = False  # whether each takes the whole width


class PathTrack(NamedTuple):
    """A path."""

    label: str  # see `PlotLine`
    look: str  # see `PlotLine`
    position: Array  # shape (n, 3); north, east, down, m


class Space(NamedTuple):
    """Paths in space, which the user can turn."""

    says: str
    tracks: Sequence[PathTrack]


class TablePart(NamedTuple):
    """A table; if `sortable`, it can be sorted and filtered; if `folded`, it is closed at first."""

    table: Table
    sortable: bool = False
    folded: bool = False

    @property
    def is_worded(self) -> bool:
        """Whether it is mostly text, which needs another layout on a narrow screen."""
        return sum(not column.numeric for column in self.table.columns) > _MAX_TEXT_COLUMNS

    @property
    def is_tall(self) -> bool:
        """Whether it is so tall that it gets a scroll bar."""
        return len(self.table.rows) > _MAX_ROWS


class Matrix(NamedTuple):
    """Correlations of quantities, by symbol; NaN where there is none."""

    title: str
    symbols: Sequence[str]
    values: Array


class Card(NamedTuple):
    """A judgement: heading, grade, sentence, and numbers by name."""

    heading: str
    look: str
    grade: str
    says: str
    numbers: Mapping[str, str]


class Cards(NamedTuple):
    """Verdicts side by side."""

    cards: Sequence[Card]


class Words(NamedTuple):
    """Sentences; as a list if they are of equal rank."""

    sentences: Sequence[str]
    listed: bool = False


class Listing(NamedTuple):
    """Text with lines of its own, such as settings, folded away."""

    title: str
    text: str


Part: TypeAlias = Plots | Space | TablePart | Matrix | Cards | Words | Listing | Picture


class Section(NamedTuple):
    """Parts below a heading; `key` is the target of links."""

    key: str
    title: str
    parts: Sequence[Part]


class Page(NamedTuple):
    """A page."""

    title: str
    subtitle: str
    sections: Sequence[Section]  # those without parts are left out
