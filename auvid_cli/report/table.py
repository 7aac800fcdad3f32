"""Tables independent of their output, and the notation of symbols and units."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import compress
from math import floor, isfinite, log10
from typing import NamedTuple, TypeAlias, TypeVar

from auvid_cli.vehicle.coefficients import COEFFICIENTS, is_name_of_term

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FINS = {"rudder": r"\delta_r", "elevator": r"\delta_e"}
_WORDS = {"heading": r"$\psi$", "down": "depth"}
_GREEK = ("phi", "theta", "psi")
# Longest subscript that is set in italics; longer ones are words.
_SHORT = 2
_DVL = {"dvl_scale": r"$s_{\mathrm{DVL}}$", "dvl_yaw": r"$\psi_{\mathrm{DVL}}$"}
_MAX_COEFFICIENTS = 14  # largest number in one picture
_COEFFICIENTS = {c.symbol: c for c in COEFFICIENTS}
# Digits that the printed tables show of a value, of a standard deviation and of an error in percent.
DIGITS = 4
DEVIATION_DIGITS = 2
ERROR_DIGITS = 2
# Explanation of the mark.
UNIDENTIFIED = (
    "† do not rely on it: the standard deviation, or the smallest that the data allow, exceeds 20 % of the value (of "
    "the true value if it is known; of the usual size if that is 0), or a doubt about the estimate concerns it."
)


def symbol_math(symbol: str) -> str:
    r"""Write a symbol as mathematics for LaTeX and mathtext, for example ``$X_{u|u|}$`` or ``$\psi$``."""
    if symbol in _WORDS:
        return _WORDS[symbol]
    if symbol in _GREEK:
        return rf"$\{symbol}$"
    if symbol in _COEFFICIENTS:
        letter, subscript = symbol.split("_", 1)
        coefficient = _COEFFICIENTS[symbol]
        if coefficient.group == "control":
            subscript = "".join(_FINS.get(signal, signal) for signal in coefficient.signals)
        return f"${letter}_{{{subscript}}}$"
    if symbol in _DVL:
        return _DVL[symbol]
    if is_name_of_term(symbol):
        letter, subscript = symbol.split("_", 1)
        return f"${letter}_{{{subscript.replace('_', ',')}}}$"
    if "_" in symbol:
        # An error state: the bias of a quantity, or a component of the current.
        word, of = symbol.split("_", 1)
        subscript = rf"\{of}" if of in _GREEK else of if len(of) <= _SHORT else rf"\mathrm{{{of}}}"
        return f"${word[0]}_{{{subscript}}}$"
    letter, subscript = symbol[0], symbol[1:]
    return f"${letter}_{{{subscript}}}$" if subscript else f"${letter}$"


def unit_text(unit: str) -> str:
    """Write a unit in Unicode, for example ``kg·m²/rad²``."""
    raised = re.sub(r"\^(-?\d+)(?!\.)", lambda power: power[1].translate(_SUPERSCRIPTS), unit)
    return raised.replace("*", "·")


def unit_latex(unit: str) -> str:
    r"""Write a unit in LaTeX, for example ``kg\,m$^{2}$/rad$^{2}$``."""
    return re.sub(r"\^(-?\d+)", r"$^{\1}$", unit).replace("*", r"\,")


def by_kind(symbols: Sequence[str]) -> dict[str, list[str]]:
    """Return coefficients by "forces" and "moments" if they are too many for one picture, otherwise all by ``""``."""
    if len(symbols) <= _MAX_COEFFICIENTS:
        return {"": list(symbols)}
    groups = {"forces": [s for s in symbols if s[0] in "XYZ"], "moments": [s for s in symbols if s[0] not in "XYZ"]}
    return {kind: group for kind, group in groups.items() if group}


def filter_label(name: str) -> str:
    """Return the displayed name of a filter: EKF and so on, OE for output error, and smoother."""
    return {"output_error": "OE", "smoother": "smoother"}.get(name, name.upper())


def setting_text(value: object) -> str:
    """Write a value of an axis of a campaign."""
    return f"{value:g}" if isinstance(value, float) else str(value)


class Symbol(NamedTuple):
    """A coefficient or a motion component, by its name in auvid."""

    name: str


class UnitCell(NamedTuple):
    """A unit, as pint reads it."""

    name: str


class PlusMinus(NamedTuple):
    """A value and its standard deviation, in the same unit."""

    value: float
    deviation: float


class Unidentified(NamedTuple):
    """A value that the data do not determine: never printed without a mark."""

    cell: float | PlusMinus


Row = TypeVar("Row")
# None and a number that is not finite are missing values.
Cell: TypeAlias = str | float | Symbol | UnitCell | PlusMinus | Unidentified | None


class Column(NamedTuple):
    """Heading of a column, and of its group if columns are grouped."""

    header: str
    group: str = ""
    numeric: bool = True


class Table(NamedTuple):
    """A table with its heading."""

    key: str  # short name, used in the LaTeX label
    title: str
    columns: tuple[Column, ...]
    rows: list[list[Cell]]  # rows of the body
    totals: Sequence[list[Cell]] = ()  # rows below the rule, such as averages
    notes: tuple[str, ...] = ()  # sentences below the table

    def without(self, *headers: str) -> "Table":
        """Return the table without the columns of these headings."""
        kept = [column.header not in headers for column in self.columns]
        rows, totals = ([list(compress(row, kept)) for row in body] for body in (self.rows, self.totals))
        return self._replace(columns=tuple(compress(self.columns, kept)), rows=rows, totals=totals)


def text_column(header: str) -> Column:
    """Return the heading of a column of text."""
    return Column(header, numeric=False)


def tabulated(
    key: str,
    title: str,
    rows: Iterable[Row],
    cells: Mapping[Column, Callable[[Row], Cell]],
    notes: tuple[str, ...] = (),
) -> Table:
    """Return a table with a function for each column, which makes its cells from the rows."""
    return Table(key, title, tuple(cells), [[cell(row) for cell in cells.values()] for row in rows], notes=tuple(notes))


def capitalised(header: str) -> str:
    """Return a heading with a capital first letter, for documents."""
    return header[:1].upper() + header[1:] if header[:1].isascii() else header


def number(value: float, digits: int = DIGITS) -> str | None:
    """Return a number with `digits` significant digits, in decimal notation where that is readable.

    Returns
    -------
    str or None
        For example ``12.40``, ``12350``, ``1.235e-07``; None if the value is not finite.
    """
    if not isfinite(value):
        return None
    if isinstance(value, int):
        return str(value)
    if value == 0.0:
        return "0"
    # Round first, so that 9.9996 becomes 10.00 before the number of decimals is chosen.
    rounded = float(f"{value:.{digits - 1}e}")
    magnitude = floor(log10(abs(rounded)))
    if -5 < magnitude < 7:
        return f"{rounded:.{max(digits - 1 - magnitude, 0)}f}"
    return f"{rounded:.{digits - 1}e}"


class CellStyle(NamedTuple):
    """Style in which a medium, such as LaTeX, writes cells."""

    missing: str  # text of an unknown value
    symbol: Callable[[str], str]  # returns the text of a symbol
    unit: Callable[[str], str]  # returns the text of a unit
    text: Callable[[str], str]  # returns plain text with its markup escaped
    number: Callable[[str], str] = str  # returns the text of a number that already has its digits
    plus_minus: str = "±"  # sign before a standard deviation
    mark: str = " †"  # mark of an unidentified value
    digits: int = DIGITS  # significant digits of a value

    def number_text(self, value: float, digits: int) -> str:
        """Return a number with `digits` significant digits, or the sign of a missing value."""
        text = number(value, digits)
        return self.missing if text is None else self.number(text)


def cell_text(cell: Cell, style: CellStyle) -> str:
    """Return the text of a cell in the style of a medium."""
    match cell:
        case None:
            return style.missing
        case Symbol(name):
            return style.symbol(name)
        case UnitCell(name):
            return style.unit(name)
        case PlusMinus(value, deviation):
            deviation_text = style.number_text(deviation, DEVIATION_DIGITS)
            return f"{style.number_text(value, style.digits)} {style.plus_minus} {deviation_text}"
        case Unidentified(marked):
            return cell_text(marked, style) + style.mark
        case str():
            return style.text(cell)
    return style.number_text(cell, style.digits)
