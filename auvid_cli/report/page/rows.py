"""Rows of a CSV file as a printed table."""

from auvid_cli.data.named_rows import NamedRows
from auvid_cli.report.table import Cell, Column, Symbol, Table, UnitCell
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

_SYMBOLS = {*SYMBOLS, *MOTION_SYMBOLS}


def table_of_rows(key: str, title: str, rows: NamedRows) -> Table:
    """Lay out rows with the names of their columns in words; those without any value are left out."""
    kept = [k for k in range(len(rows.columns)) if any(row[k] not in (None, "") for row in rows.rows)]
    columns = tuple(
        Column(rows.columns[k].replace("_", " "), numeric=all(_is_number(row[k]) for row in rows.rows)) for k in kept
    )
    return Table(key, title, columns, [[_cell(rows.columns[k], row[k]) for k in kept] for row in rows.rows])


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, (int, float)) and not isinstance(value, bool))


def _cell(column: str, value: object) -> Cell:
    match value:
        case None | int() | float() if not isinstance(value, bool):
            return value
        case bool():
            return "yes" if value else "no"
    text = str(value)
    return UnitCell(text) if column == "unit" else Symbol(text) if text in _SYMBOLS else text
