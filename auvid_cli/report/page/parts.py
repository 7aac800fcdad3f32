"""What a page is made of, before it is HTML."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from auvid_cli.report.page.picture import Picture
from auvid_cli.report.table import Table

Array = NDArray[np.float64]

# Columns of text that a narrow screen has room for.
_MOST_WORDED = 4
# Rows that are shown at once; of a longer table the rest is scrolled to.
_MOST_ROWS = 24


class PlotLine(NamedTuple):
    """A series of a plot.

    Attributes
    ----------
    label : str
    look : str
        Which colour and dashes: the name of a filter, or another of those in page.css, such as "measured" or "true".
    time, values : ndarray, shape (n,)
        Abscissa, increasing, and ordinate; NaN breaks the line.
    kind : str
        Drawn as a line, as steps or as dots.
    of : str
        Filter with whose choice the line is shown; empty if it always is.
    key : str
        What a legend below the plot alone says of lines that look like this one; empty where one above all plots does.
    """

    label: str
    look: str
    time: Array
    values: Array
    kind: Literal["line", "steps", "dots"] = "line"
    of: str = ""
    key: str = ""


class Plot(NamedTuple):
    """A plot that can be zoomed.

    Attributes
    ----------
    title : str
    says : str
        What it shows in words, for those who do not see it.
    unit : str
        Of the ordinate.
    lines : sequence of PlotLine
    x_label : str
    log_x, log_y : bool
    marks : sequence of (float, float)
        Spans of the abscissa to be shaded.
    limits : (float, float) or None
        Of the ordinate: what is beyond is not shown, and `says` how much that is.
    """

    title: str
    says: str
    unit: str
    lines: Sequence[PlotLine]
    x_label: str = "time (s)"
    log_x: bool = False
    log_y: bool = False
    marks: Sequence[tuple[float, float]] = ()
    limits: tuple[float, float] | None = None


class Plots(NamedTuple):
    """Plots side by side.

    Attributes
    ----------
    plots : sequence of Plot
    linked : str
        Those of the same word are zoomed together; empty if each is by itself.
    choice : mapping of str
        Labels of the filters, by name, of which one is shown at a time; empty if all are.
    wide : bool
        Whether each takes the whole width.
    """

    plots: Sequence[Plot]
    linked: str = ""
    choice: Mapping[str, str] = {}
    wide: bool = False


class PathTrack(NamedTuple):
    """A path.

    Attributes
    ----------
    label, look : str
        As of `PlotLine`.
    position : ndarray, shape (n, 3)
        North, east, down, m.
    """

    label: str
    look: str
    position: Array


class Space(NamedTuple):
    """Paths in space, to be turned."""

    says: str
    tracks: Sequence[PathTrack]


class TablePart(NamedTuple):
    """A table; `sortable` ones can also be filtered, `folded` ones are opened first."""

    table: Table
    sortable: bool = False
    folded: bool = False

    @property
    def is_worded(self) -> bool:
        """Say whether it is mostly text, which has no room in columns on a narrow screen."""
        return sum(not column.numeric for column in self.table.columns) > _MOST_WORDED

    @property
    def is_tall(self) -> bool:
        """Say whether it would push what stands below it out of sight."""
        return len(self.table.rows) > _MOST_ROWS


class Matrix(NamedTuple):
    """Correlations of quantities, by symbol; NaN where there is none."""

    title: str
    symbols: Sequence[str]
    values: Array


class Card(NamedTuple):
    """A verdict: of what, the word, the sentence, and some numbers by name."""

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
    """Parts below a heading; `key` is what links to it say."""

    key: str
    title: str
    parts: Sequence[Part]


class Page(NamedTuple):
    """A page.

    Attributes
    ----------
    title : str
    subtitle : str
    sections : sequence of Section
        Those without parts are left out.
    """

    title: str
    subtitle: str
    sections: Sequence[Section]
