"""Printed tables as Markdown."""

import re

from auvid_cli.printable import one_line
from auvid_cli.report.notation import unit_text
from auvid_cli.report.table import (
    DEVIATION_DIGITS,
    Cell,
    PlusMinus,
    Symbol,
    Table,
    Unidentified,
    UnitCell,
    capitalised,
    number,
)

MISSING = "—"

# What begins something in Markdown or HTML. An underscore within a word begins nothing.
_MARKS = str.maketrans({"&": "&amp;", "<": "&lt;", **{mark: f"\\{mark}" for mark in "\\`*[]|$~#"}})


def render_markdown(tables: list[Table]) -> str:
    """Render one document with all tables."""
    return "# Results\n\n" + "\n\n".join(_table(table) for table in tables) + "\n"


def _table(table: Table) -> str:
    headers = [f"{c.group}, {c.header}" if c.group else capitalised(c.header) for c in table.columns]
    marks = ["---:" if column.numeric else "---" for column in table.columns]
    body = [[_cell(cell) for cell in row] for row in [*table.rows, *table.totals]]
    lines = ["| " + " | ".join(row) + " |" for row in [[_in_a_cell(h) for h in headers], marks, *body]]
    return "\n\n".join([f"## {table.title}", "\n".join(lines), *(_in_a_cell(note) for note in table.notes)])


def _cell(cell: Cell) -> str:
    match cell:
        case None:
            return MISSING
        case Symbol(name):
            return _in_a_cell(name)
        case UnitCell(name):
            return unit_text(name)
        case PlusMinus(value, deviation):
            return f"{number(value) or MISSING} ± {number(deviation, DEVIATION_DIGITS) or MISSING}"
        case Unidentified(marked):
            return f"{_cell(marked)} †"
        case str():
            return escape_markdown(cell)
    return number(cell) or MISSING


def _in_a_cell(text: str) -> str:
    """Write auvid's own words, which may have marks in them."""
    return one_line(text).replace("|", r"\|")


def escape_markdown(text: str) -> str:
    """Write plain text for Markdown."""
    return re.sub(r"(?<!\w)_|_(?!\w)", r"\\_", one_line(text).translate(_MARKS))
