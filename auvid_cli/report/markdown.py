"""Printed tables as Markdown."""

from auvid_cli.report.notation import unit_text
from auvid_cli.report.table import DEVIATION_DIGITS, Cell, PlusMinus, Symbol, Table, Unidentified, Unit, number

MISSING = "—"


def render_markdown(tables: list[Table]) -> str:
    """One document with all tables."""
    return "# Results\n\n" + "\n\n".join(_table(table) for table in tables) + "\n"


def _table(table: Table) -> str:
    headers = [f"{column.group}, {column.header}" if column.group else column.header for column in table.columns]
    marks = ["---:" if column.numeric else "---" for column in table.columns]
    body = [[_cell(cell) for cell in row] for row in [*table.rows, *table.totals]]
    lines = ["| " + " | ".join(row) + " |" for row in [[_escape(h) for h in headers], marks, *body]]
    return "\n\n".join([f"## {table.title}", "\n".join(lines), *(_escape(note) for note in table.notes)])


def _cell(cell: Cell) -> str:
    match cell:
        case None:
            return MISSING
        case Symbol(name):
            return _escape(name)
        case Unit(name):
            return unit_text(name)
        case PlusMinus(value, deviation):
            return f"{number(value) or MISSING} ± {number(deviation, DEVIATION_DIGITS) or MISSING}"
        case Unidentified(marked):
            return f"{_cell(marked)} †"
        case str():
            return _escape(cell)
    return number(cell) or MISSING


def _escape(text: str) -> str:
    return text.replace("|", r"\|").replace("\n", " ")
