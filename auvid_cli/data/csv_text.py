"""Rows as CSV."""

import csv
import re
from collections.abc import Iterable, Sequence
from io import StringIO
from math import isnan
from typing import Any

from auvid_cli.printable import printable

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*(e[+-]?\d+)?|inf|nan)", re.ASCII | re.IGNORECASE)
# A spreadsheet takes for a formula what begins so.
_FORMULA = re.compile("'*[=+@-]")


def csv_text(header: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Write a header and rows as CSV; None and NaN are empty cells, floats keep all digits, for text see `csv_cell`."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(csv_cell, header))
    writer.writerows(map(csv_cell, row) for row in rows)
    return text.getvalue()


def csv_cell(value: Any) -> Any:
    """Put text in a line, and behind an apostrophe if it would be a formula; `csv_value` takes that away."""
    if isinstance(value, float) and isnan(value):
        return None
    if not isinstance(value, str) or _NUMBER.fullmatch(value):
        return value
    return f"'{printable(value)}" if _FORMULA.match(value) else printable(value)


def csv_value(cell: str) -> str:
    """Return the text of a cell that `csv_cell` made."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell
