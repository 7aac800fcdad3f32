"""Pages as HTML: cells, packed series and templates."""

import base64
import json
import re
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from auvid_cli._version import __version__
from auvid_cli.arrays import Array
from auvid_cli.data.files import write_text
from auvid_cli.data.results import refuse_other_page
from auvid_cli.report.page.looks import filter_styles, marker
from auvid_cli.report.page.parts import Page, Part, PlotLine, Plots, Section, Space
from auvid_cli.report.table import (
    Cell,
    CellStyle,
    Column,
    PlusMinus,
    Symbol,
    Table,
    Unidentified,
    UnitCell,
    capitalised,
    cell_text,
    symbol_math,
    unit_text,
)
from auvid_cli.text import one_line, printable, printable_lines
from auvid_cli.vehicle.coefficients import SYMBOLS, is_name_of_term

_LARGEST = float(np.finfo(np.float32).max)
MISSING = "—"
_LONG = 40  # characters; a longer word does not fit on a narrow screen
# Whole names only, because names of a vehicle's own terms may begin with one of these.
_NAMED = re.compile(rf"(?<![\w|])(?:{'|'.join(map(re.escape, sorted(SYMBOLS, key=len, reverse=True)))})(?![\w|])")
# Space between a name or a sign and the number at the end of a phrase, and between a number and % or degrees.
_TIED = re.compile(r"(?<=[\w|=±<>]) (?=[-+]?\d[\d.e+-]*(?: [%°][\w/]*)?(?:[,;)]|\.(?!\d)|$))|(?<=\d) (?=[%°])")
# Minus sign of an exponent, where browsers break a line.
_EXPONENT = re.compile(r"(?<=\de)-(?=\d)")
# A single backtick is text.
_CODE = re.compile(r"`([^`]+)`")
_GREEK = {"phi": "φ", "theta": "θ", "psi": "ψ", "delta": "δ"}
_STYLES = ("uPlot.min.css", "page.css")
_SCRIPTS = ("uPlot.iife.min.js", "plots.js", "space.js", "tables.js")
# Characters that may end a script or start markup; JSON and JavaScript decode these escapes.
_UNSAFE = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"})
# Colour classes of the absolute correlation.
_SHADES = 10
_STYLE = CellStyle(MISSING, str, unit_text, one_line)


class PackedArrays:
    """Arrays as base64 of little-endian float32; equal arrays are kept once.

    Seven digits are more than a screen shows. Times are relative to a time near the first one, so that those of a long
    record keep their fractions. Values that are too large or not finite are gaps.
    """

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._places: dict[bytes, int] = {}

    def add(self, values: Array) -> int:
        """Return the place of an array in `texts`, and put it there if it is new."""
        fits = np.abs(values) <= _LARGEST
        content = np.where(fits, values, np.nan).astype("<f4").tobytes()
        place = self._places.setdefault(content, len(self.texts))
        if place == len(self.texts):
            self.texts.append(base64.b64encode(content).decode("ascii"))
        return place


class ShownCell(NamedTuple):
    """A cell: text, subscript, sort key and text to search for."""

    text: str
    below: str = ""
    order: float | str = ""
    found: str = ""

    @property
    def is_long(self) -> bool:
        """Whether it contains a long word, such as a hash, that may break anywhere."""
        return any(len(word) >= _LONG for word in self.text.split())


class Heading(NamedTuple):
    """A heading that spans `columns` and `rows`."""

    text: str
    columns: int
    rows: int
    numeric: bool


def symbol_parts(symbol: str) -> tuple[str, str]:
    """Return a symbol as a letter and its subscript in Unicode, for example ``("X", "u|u|")``; of a word the word."""
    text = re.sub(r"\\mathrm\{(\w+)\}", r"\1", symbol_math(symbol)).strip("$")
    text = re.sub(r"\\(\w+?)(?=_|\b)", lambda name: _GREEK.get(name[1], name[1]), text)
    match = re.fullmatch(r"(.+?)_\{(.*)\}", text)
    letter, below = match.groups() if match else (text, "")
    return letter, below.replace("_", "")


def with_code(text: str) -> list[tuple[str, bool]]:
    """Split a text at backticks into pieces, each with whether it is code."""
    pieces = _CODE.split(text)
    return [(piece, bool(place % 2)) for place, piece in enumerate(pieces) if piece]


def with_symbols(text: str) -> list[tuple[str, str]]:
    """Split a text at the names of coefficients into pieces, each with the subscript that follows it (may be empty)."""
    pieces = []
    last = 0
    for match in _NAMED.finditer(text):
        letter, below = symbol_parts(match[0])
        pieces.append((text[last : match.start()] + letter, below))
        last = match.end()
    return [*pieces, (text[last:], "")]


def with_ties(text: str) -> str:
    """Return a text that no browser breaks between a name and its number, or within a number."""
    return _EXPONENT.sub("-\N{WORD JOINER}", _TIED.sub("\N{NO-BREAK SPACE}", text))


def shown(cell: Cell) -> ShownCell:
    """Return the text of a cell and the key by which its column is sorted."""
    match cell:
        case Symbol(name):
            return ShownCell(*symbol_parts(name), order=name.lower(), found=name)
        case Unidentified(marked):
            inner = shown(marked)
            return inner._replace(text=inner.text + _STYLE.mark)
        case str() if is_name_of_term(cell):
            return shown(Symbol(cell))
    text = cell_text(cell, _STYLE)
    match cell:
        case None | UnitCell():
            return ShownCell(text)
        case PlusMinus(value, _):
            return ShownCell(text, order=_order(value))
        case str():
            return ShownCell(text, order=_number_or(text.lower()))
    return ShownCell(text, order=_order(cell))


def _number_or(text: str) -> float | str:
    """Return the number in a text, or else the text."""
    try:
        return _order(float(text))
    except ValueError:
        return text


def _order(value: float) -> float | str:
    return value if isfinite(value) else ""


def heading_rows(table: Table) -> list[list[Heading]]:
    """Return one row of headings, or two if columns belong to groups."""
    # Plain text, without the asterisks of Markdown.
    names = [
        Column(one_line(capitalised(column.header)), one_line(column.group).replace("*", ""), column.numeric)
        for column in table.columns
    ]
    if not any(name.group for name in names):
        return [[Heading(name.header, 1, 1, name.numeric) for name in names]]
    upper: list[Heading] = []
    previous = ""
    for name in names:
        if name.group and name.group == previous:
            upper[-1] = upper[-1]._replace(columns=upper[-1].columns + 1)
        else:
            upper.append(Heading(name.group or name.header, 1, 1 if name.group else 2, name.numeric))
        previous = name.group
    return [upper, [Heading(name.header, 1, 1, name.numeric) for name in names if name.group]]


class _Block(NamedTuple):
    """A part with the name of its macro and a unique key."""

    kind: str
    key: str
    part: Part


def render_page(page: Page) -> str:
    """Render a page; all texts are escaped."""
    sections = [section for section in page.sections if section.parts]
    blocks = {section.key: _blocks(section) for section in sections}
    styles = [*map(_asset, _STYLES), filter_styles()]
    scripts = [_asset(name) for name in _SCRIPTS]
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            page=page,
            sections=sections,
            blocks=blocks,
            version=__version__,
            licence=_asset("uPlot.LICENSE.txt"),
            policy=_policy(styles, scripts),
            styles=[Markup(text) for text in styles],
            scripts=[Markup(text) for text in scripts],
            data=Markup(_data([block for of_section in blocks.values() for block in of_section])),
        )
    )


def _blocks(section: Section) -> list[_Block]:
    return [
        _Block(type(part).__name__.lower(), f"{section.key}-{place}", part) for place, part in enumerate(section.parts)
    ]


def _policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Return the content security policy: only the scripts and styles of the page, by hash, and no network."""
    scripted, styled = (" ".join(map(_hash, texts)) for texts in (scripts, styles))
    return f"default-src 'none'; script-src {scripted}; style-src {styled}; base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(sha256(text.encode()).digest()).decode('ascii')}'"


@cache
def _asset(name: str) -> str:
    return files("auvid_cli.report.page").joinpath("static", name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("auvid_cli.report.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "cell": shown,
        "heading_rows": heading_rows,
        "symbol": symbol_parts,
        "with_code": with_code,
        "with_symbols": with_symbols,
        "line": one_line,
        "marker": marker,
        "with_ties": with_ties,
        "lines": printable_lines,
        "shade": _shade,
        "hundredths": _hundredths,
    }
    return environment


def _shade(correlation: float) -> str:
    """Return the class of a correlation's colour."""
    if correlation != correlation:
        return "r-none"
    tenths = round(_SHADES * min(max(correlation, -1.0), 1.0))
    return f"r{'-' if tenths < 0 else ''}{abs(tenths)}"


def _hundredths(correlation: float) -> str:
    """Return a correlation in hundredths with its sign; zero has none."""
    if correlation != correlation:
        return "·"
    whole = round(100.0 * correlation)
    return f"{whole:+d}" if whole else "0"


def _data(blocks: Sequence[_Block]) -> str:
    """Return the data of the plots as JSON that cannot end its script element."""
    arrays = PackedArrays()
    groups: dict[str, Any] = {}
    spaces: dict[str, Any] = {}
    for block in blocks:
        match block.part:
            case Plots() as plots:
                groups[block.key] = _plots(plots, arrays)
            case Space() as space:
                spaces[block.key] = [
                    {
                        "label": printable(track.label),
                        "look": track.look,
                        "at": [arrays.add(x) for x in track.position.T],
                    }
                    for track in space.tracks
                ]
    data = {"groups": groups, "spaces": spaces, "arrays": arrays.texts}
    return json.dumps(data, separators=(",", ":"), allow_nan=False).translate(_UNSAFE)


def _plots(plots: Plots, arrays: PackedArrays) -> dict[str, Any]:
    return {
        "linked": plots.linked,
        "choice": bool(plots.choice),
        "plots": [
            {
                "unit": plot.unit,
                "x": plot.x_label,
                "logX": plot.log_x,
                "logY": plot.log_y,
                "limits": plot.limits,
                "marks": [[float(f"{time:.8g}") for time in mark] for mark in plot.marks],
                "lines": [_line(line, arrays) for line in plot.lines],
            }
            for plot in plots.plots
        ],
    }


def _line(line: PlotLine, arrays: PackedArrays) -> dict[str, Any]:
    # Relative to a whole second near the first, float32 keeps the fractions of all times.
    origin = float(round(float(line.time[0]))) if line.time.size else 0.0
    return {
        "label": printable(line.label),
        "look": line.look,
        "kind": line.kind,
        "of": line.of,
        "key": printable(line.key),
        "from": origin,
        "t": arrays.add(line.time - origin),
        "v": arrays.add(line.values),
    }


def write_page(page: Page, path: Path) -> Path:
    """Write a page, whole or not at all, and return its path.

    Raises
    ------
    FileError
        If it cannot be written, or a file that is not a page of auvid has this name.
    """
    refuse_other_page(path)
    write_text(path, render_page(page))
    return path
