"""Cells of a table as HTML shows and sorts them."""

import re
from math import isfinite
from typing import NamedTuple

from auvid_cli.printable import one_line
from auvid_cli.report.notation import symbol_math, unit_text
from auvid_cli.report.table import (
    DEVIATION_DIGITS,
    Cell,
    Column,
    PlusMinus,
    Symbol,
    Table,
    Unidentified,
    UnitCell,
    capitalised,
    number,
)
from auvid_cli.vehicle.coefficients import SYMBOLS, is_name_of_term

MISSING = "—"
# Signs of a word that no narrow screen has room for.
_LONG = 40
# Whole names: those of a vehicle's own terms may begin like one of these.
_NAMED = re.compile(rf"(?<![\w|])(?:{'|'.join(map(re.escape, sorted(SYMBOLS, key=len, reverse=True)))})(?![\w|])")
# Between a name, or a sign, and the number that ends what is said of it; between a number and its percent or degrees.
_TIED = re.compile(r"(?<=[\w|=±<>]) (?=[-+]?\d[\d.e+-]*(?: [%°][\w/]*)?(?:[,;)]|\.(?!\d)|$))|(?<=\d) (?=[%°])")
# Where browsers end a line within a number.
_EXPONENT = re.compile(r"(?<=\de)-(?=\d)")
# A backtick without its like is text.
_CODE = re.compile(r"`([^`]+)`")
_GREEK = {"phi": "φ", "theta": "θ", "psi": "ψ", "delta": "δ"}


class ShownCell(NamedTuple):
    """A cell: what stands there, what stands lower behind it, and by what it is sorted and found."""

    text: str
    below: str = ""
    order: float | str = ""
    found: str = ""

    @property
    def is_long(self) -> bool:
        """Say whether it has a word, such as a hash, that may break anywhere."""
        return any(len(word) >= _LONG for word in self.text.split())


class Heading(NamedTuple):
    """A heading over so many columns, `rows` high."""

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
    """Cut a text at what stands between backticks: pieces, each with whether it is code."""
    pieces = _CODE.split(text)
    return [(piece, bool(place % 2)) for place, piece in enumerate(pieces) if piece]


def with_symbols(text: str) -> list[tuple[str, str]]:
    """Cut a text at the coefficients that it names: pieces, each with the subscript that follows it, or none."""
    pieces = []
    last = 0
    for match in _NAMED.finditer(text):
        letter, below = symbol_parts(match[0])
        pieces.append((text[last : match.start()] + letter, below))
        last = match.end()
    return [*pieces, (text[last:], "")]


def with_ties(text: str) -> str:
    """Let no line end between a name and its number, or within a number."""
    return _EXPONENT.sub("-\N{WORD JOINER}", _TIED.sub("\N{NO-BREAK SPACE}", text))


def shown(cell: Cell) -> ShownCell:
    """Return what a cell looks like."""
    match cell:
        case None:
            return ShownCell(MISSING)
        case Symbol(name):
            return ShownCell(*symbol_parts(name), order=name.lower(), found=name)
        case UnitCell(name):
            return ShownCell(unit_text(name))
        case PlusMinus(value, deviation):
            text = f"{number(value) or MISSING} ± {number(deviation, DEVIATION_DIGITS) or MISSING}"
            return ShownCell(text, order=_order(value))
        case Unidentified(marked):
            inner = shown(marked)
            return inner._replace(text=f"{inner.text} †")
        case str() if is_name_of_term(cell):
            return shown(Symbol(cell))
        case str():
            text = one_line(cell)
            return ShownCell(text, order=_number_or(text.lower()))
    return ShownCell(number(cell) or MISSING, order=_order(cell))


def _number_or(text: str) -> float | str:
    """Read a number that comes with the digits to be shown."""
    try:
        return _order(float(text))
    except ValueError:
        return text


def _order(value: float) -> float | str:
    return value if isfinite(value) else ""


def heading_rows(table: Table) -> list[list[Heading]]:
    """Return one row of headings, or two if columns belong to groups."""
    names = [_Name(column) for column in table.columns]
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


class _Name:
    """Names of a column in plain text; what Markdown writes in italics has asterisks around it."""

    def __init__(self, column: Column) -> None:
        self.header = one_line(capitalised(column.header))
        self.group = one_line(column.group).replace("*", "")
        self.numeric = column.numeric
