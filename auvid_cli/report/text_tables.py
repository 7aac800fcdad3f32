"""Tables as text: CSV, Markdown and LaTeX."""

import re
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path

from auvid_cli.data.checks import NamedRows
from auvid_cli.data.files import write_text
from auvid_cli.report.table import (
    CellStyle,
    Table,
    capitalised,
    cell_text,
    symbol_math,
    unit_latex,
    unit_text,
)
from auvid_cli.text import one_line

MARKDOWN_MISSING = "—"
# Characters that start markup in Markdown or HTML. An underscore within a word does not.
_MARKS = str.maketrans({"&": "&amp;", "<": "&lt;", **{mark: f"\\{mark}" for mark in "\\`*[]|$~#"}})
LATEX_MISSING = "--"
_ESCAPES = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        **{character: f"\\{character}" for character in "&%$#_{}"},
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "|": r"\textbar{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "±": r"$\pm$",
        "µ": r"$\mu$",
        "†": r"$\dagger$",
        "é": r"\'{e}",
        "—": "---",
        # At the beginning of a row, LaTeX reads these as an option of the row above.
        "[": "{[}",
        "*": "{*}",
    }
)


def write_csv_tables(tables: Mapping[str, NamedRows], folder: Path) -> list[Path]:
    """Write each table as ``NAME.csv``.

    Parameters
    ----------
    tables : mapping of NamedRows
        By name.
    folder : pathlib.Path
        Made if it is missing.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    paths = []
    for name, table in tables.items():
        path = folder / f"{name}.csv"
        write_text(path, table.to_csv())
        paths.append(path)
    return paths


def render_markdown(tables: list[Table]) -> str:
    """Render one document with all tables."""
    return "# Results\n\n" + "\n\n".join(_markdown_table(table) for table in tables) + "\n"


def _markdown_table(table: Table) -> str:
    headers = [f"{c.group}, {c.header}" if c.group else capitalised(c.header) for c in table.columns]
    marks = ["---:" if column.numeric else "---" for column in table.columns]
    body = [[cell_text(cell, _MARKDOWN) for cell in row] for row in [*table.rows, *table.totals]]
    lines = ["| " + " | ".join(row) + " |" for row in [[_in_a_cell(h) for h in headers], marks, *body]]
    return "\n\n".join([f"## {table.title}", "\n".join(lines), *(_in_a_cell(note) for note in table.notes)])


def _in_a_cell(text: str) -> str:
    """Return auvid's own text for a cell; it may contain markup."""
    return one_line(text).replace("|", r"\|")


def escape_markdown(text: str) -> str:
    """Return plain text with the markup of Markdown escaped."""
    return re.sub(r"(?<!\w)_|_(?!\w)", r"\\_", one_line(text).translate(_MARKS))


def render_latex(tables: list[Table]) -> str:
    """Render one fragment with all tables."""
    return "% Needs \\usepackage{booktabs}.\n\n" + "\n\n".join(_latex_table(table) for table in tables) + "\n"


def _latex_table(table: Table) -> str:
    alignment = "".join("r" if column.numeric else "l" for column in table.columns)
    return "\n".join(
        [
            r"\begin{table}[htbp]",
            r"  \centering\small\setlength{\tabcolsep}{4pt}",
            rf"  \caption{{{escape_latex(table.title)}}}",
            rf"  \label{{tab:{table.key}}}",
            rf"  \begin{{tabular}}{{{alignment}}}",
            r"    \toprule",
            *_group_headings(table),
            "    " + _line([escape_latex(capitalised(column.header)) for column in table.columns]),
            r"    \midrule",
            *("    " + _line([cell_text(cell, _LATEX) for cell in row]) for row in table.rows),
            *([r"    \midrule"] if table.totals else []),
            *("    " + _line([cell_text(cell, _LATEX) for cell in row]) for row in table.totals),
            r"    \bottomrule",
            r"  \end{tabular}",
            *(rf"  \par\smallskip {escape_latex(note)}" for note in table.notes),
            r"\end{table}",
        ]
    )


def _group_headings(table: Table) -> list[str]:
    """Return the lines above the headings that name groups of columns; empty without groups."""
    cells, rules, begin = [], [], 1
    for group, members in groupby(column.group for column in table.columns):
        width = len(list(members))
        cells.append(rf"\multicolumn{{{width}}}{{c}}{{{escape_latex(group)}}}" if group else " & " * (width - 1))
        if group:
            rules.append(rf"\cmidrule(lr){{{begin}-{begin + width - 1}}}")
        begin += width
    return ["    " + _line(cells), "    " + " ".join(rules)] if rules else []


def _line(cells: list[str]) -> str:
    return " & ".join(cells) + r" \\"


def _math(number: str) -> str:
    """Return a number as LaTeX mathematics."""
    mantissa, _, exponent = number.partition("e")
    return rf"${mantissa}\times 10^{{{int(exponent)}}}$" if exponent else f"${mantissa}$"


def escape_latex(text: str) -> str:
    """Return plain text with the special characters of LaTeX escaped."""
    return one_line(text).translate(_ESCAPES)


_MARKDOWN = CellStyle(MARKDOWN_MISSING, _in_a_cell, unit_text, escape_markdown)
_LATEX = CellStyle(
    LATEX_MISSING, symbol_math, unit_latex, escape_latex, _math, plus_minus=r"$\pm$", mark=r"\,$\dagger$"
)
