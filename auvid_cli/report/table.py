"""A printed table before it is Markdown, LaTeX or on the screen: columns, typed cells, notes."""

from collections.abc import Sequence
from itertools import compress
from math import floor, isfinite, log10
from typing import NamedTuple, TypeAlias

# Digits that the printed tables show of a value, of a standard deviation and of an error in percent.
DIGITS = 4
DEVIATION_DIGITS = 2
ERROR_DIGITS = 2


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


# None, like a number that is not finite, is a value that should stand here and does not.
Cell: TypeAlias = str | float | Symbol | UnitCell | PlusMinus | Unidentified | None
# Where the mark is explained.
UNIDENTIFIED = (
    "† not to be relied on: the standard deviation, or the least that the data allow, is above 20 % of the value (the "
    "true one where it is known), or the estimate is not sound."
)


class Column(NamedTuple):
    """Heading of a column and, if it belongs to several of a kind, of its group."""

    header: str
    group: str = ""
    numeric: bool = True


class Table(NamedTuple):
    """A table with its heading.

    Attributes
    ----------
    key : str
        Short name, for a LaTeX label.
    title : str
    columns : tuple of Column
    rows, totals : list of lists of Cell
        Body, and the rows below the rule.
    notes : tuple of str
        Sentences below the table.
    """

    key: str
    title: str
    columns: tuple[Column, ...]
    rows: list[list[Cell]]
    totals: Sequence[list[Cell]] = ()
    notes: tuple[str, ...] = ()

    def without(self, *headers: str) -> "Table":
        """Return the table without the columns of these headings."""
        kept = [column.header not in headers for column in self.columns]
        rows, totals = ([list(compress(row, kept)) for row in body] for body in (self.rows, self.totals))
        return self._replace(columns=tuple(compress(self.columns, kept)), rows=rows, totals=totals)


def capitalised(header: str) -> str:
    """Return a heading as documents write it; on the terminal it begins small."""
    return header[:1].upper() + header[1:] if header[:1].isascii() else header


def number(value: float, digits: int = DIGITS) -> str | None:
    """Write a number with so many significant digits, in decimal notation where that is readable.

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
    # Through text, so that 9.9996 counts as 10.00 before its digits are shared out.
    rounded = float(f"{value:.{digits - 1}e}")
    magnitude = floor(log10(abs(rounded)))
    if -5 < magnitude < 7:
        return f"{rounded:.{max(digits - 1 - magnitude, 0)}f}"
    return f"{rounded:.{digits - 1}e}"
