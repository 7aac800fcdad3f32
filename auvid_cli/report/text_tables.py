"""Tables as text: CSV, Markdown and LaTeX."""

import re
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path

from auvid_cli.data.checks import NamedRows
from auvid_cli.data.files import write_text
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
    symbol_math,
    unit_latex,
    unit_text,
)
from auvid_cli.text import one_line

MARKDOWN_MISSING = "—"
# What begins something in Markdown or HTML. An underscore within a word begins nothing.
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
        # At the beginning of a row they would belong to the end of the row before.
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

    Returns
    -------
    list of pathlib.Path

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
    body = [[_markdown_cell(cell) for cell in row] for row in [*table.rows, *table.totals]]
    lines = ["| " + " | ".join(row) + " |" for row in [[_in_a_cell(h) for h in headers], marks, *body]]
    return "\n\n".join([f"## {table.title}", "\n".join(lines), *(_in_a_cell(note) for note in table.notes)])


def _markdown_cell(cell: Cell) -> str:
    match cell:
        case None:
            return MARKDOWN_MISSING
        case Symbol(name):
            return _in_a_cell(name)
        case UnitCell(name):
            return unit_text(name)
        case PlusMinus(value, deviation):
            return f"{number(value) or MARKDOWN_MISSING} ± {number(deviation, DEVIATION_DIGITS) or MARKDOWN_MISSING}"
        case Unidentified(marked):
            return f"{_markdown_cell(marked)} †"
        case str():
            return escape_markdown(cell)
    return number(cell) or MARKDOWN_MISSING


def _in_a_cell(text: str) -> str:
    """Write auvid's own words, which may have marks in them."""
    return one_line(text).replace("|", r"\|")


def escape_markdown(text: str) -> str:
    """Write plain text for Markdown."""
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
            *("    " + _line([_latex_cell(cell) for cell in row]) for row in table.rows),
            *([r"    \midrule"] if table.totals else []),
            *("    " + _line([_latex_cell(cell) for cell in row]) for row in table.totals),
            r"    \bottomrule",
            r"  \end{tabular}",
            *(rf"  \par\smallskip {escape_latex(note)}" for note in table.notes),
            r"\end{table}",
        ]
    )


def _group_headings(table: Table) -> list[str]:
    """Write the line above the headings that names groups of columns, with rules; nothing without groups."""
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


def _latex_cell(cell: Cell) -> str:
    match cell:
        case None:
            return LATEX_MISSING
        case Symbol(name):
            return symbol_math(name)
        case UnitCell(name):
            return unit_latex(name)
        case PlusMinus(value, deviation):
            return rf"{_number(number(value))} $\pm$ {_number(number(deviation, DEVIATION_DIGITS))}"
        case Unidentified(marked):
            return rf"{_latex_cell(marked)}\,$\dagger$"
        case str():
            return escape_latex(cell)
    return _number(number(cell))


def _number(text: str | None) -> str:
    if text is None:
        return LATEX_MISSING
    mantissa, _, exponent = text.partition("e")
    return rf"${mantissa}\times 10^{{{int(exponent)}}}$" if exponent else f"${mantissa}$"


def escape_latex(text: str) -> str:
    """Write plain text for LaTeX."""
    return one_line(text).translate(_ESCAPES)
