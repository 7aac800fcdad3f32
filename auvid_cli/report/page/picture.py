"""Pictures of a few shapes, which need no script: the typed form of an SVG, and axes with readable ticks."""

from collections.abc import Sequence
from math import ceil, floor, log10
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from auvid_cli.report.figures.series import spaced

Array = NDArray[np.float64]

# Most points of a path: no screen shows more.
_MOST_POINTS = 600
# Powers of ten along an axis that leave room for numbers between them.
_FEW_DECADES = 2.0


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
    """A mark whose shape goes by its look, with the words that a pointer held over it shows."""

    x: float
    y: float
    look: str
    says: str


class TextLabel(NamedTuple):
    """A word; `below` stands lower and smaller behind it."""

    x: float
    y: float
    text: str
    anchor: Literal["start", "middle", "end"] = "start"
    below: str = ""


Shape: TypeAlias = Stroke | Rule | Box | Dot | TextLabel


class Picture(NamedTuple):
    """A picture.

    Attributes
    ----------
    title : str
    says : str
        What it shows in words.
    width, height : float
        Units of the shapes' coordinates, y down; also the most pixels that it takes.
    shapes : sequence of Shape
        The first is the lowest.
    legend : sequence of (str, str)
        Looks and labels.
    """

    title: str
    says: str
    width: float
    height: float
    shapes: Sequence[Shape]
    legend: Sequence[tuple[str, str]] = ()


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
        """Return round values along the scale: so many at most, steps of 1, 2 or 5 times a power of ten."""
        rough = (self.high - self.low) / max(most - 1, 1)
        power = 10.0 ** floor(log10(rough))
        step = next(times * power for times in (1.0, 2.0, 5.0, 10.0) if times * power >= rough * (1.0 - 1e-9))
        return [k * step for k in range(ceil(self.low / step - 1e-9), floor(self.high / step + 1e-9) + 1)]


def stroke(x: Array, y: Array, across: Axis, down: Axis, look: str) -> Stroke:
    """Draw a line by its values along two axes; of a long one evenly spaced points."""
    some = spaced(x.size, _MOST_POINTS)
    pairs = zip(x[some].tolist(), y[some].tolist(), strict=True)
    return Stroke(np.array([(across.at(a), down.at(b)) for a, b in pairs]), look)


def decades(across: Axis, top: float, bottom: float) -> list[Shape]:
    """Draw grid and names of a logarithmic axis from power to power of ten; of a short one also 2 and 5 times such."""
    digits = (1.0, 2.0, 5.0) if across.high - across.low <= _FEW_DECADES else (1.0,)
    values = [digit * 10.0**power for power in range(int(across.low), int(across.high) + 1) for digit in digits]
    shapes: list[Shape] = []
    for value in values:
        if log10(value) <= across.high:
            x = across.at(log10(value))
            shapes += [Rule(x, top, x, bottom, "grid"), TextLabel(x, bottom + 16.0, f"{value:g}", "middle")]
    return shapes


def frame(across: Axis, down: Axis, x_label: str, y_label: str) -> list[Shape]:
    """Draw grid, ticks and names of two axes."""
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
