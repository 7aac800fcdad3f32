"""Printed tables as LaTeX, to be put into a document that loads booktabs."""

from itertools import groupby

from auvid_cli.printable import one_line
from auvid_cli.report.notation import symbol_math, unit_latex
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

MISSING = "--"

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


def render_latex(tables: list[Table]) -> str:
    """Render one fragment with all tables."""
    return "% Needs \\usepackage{booktabs}.\n\n" + "\n\n".join(_table(table) for table in tables) + "\n"


def _table(table: Table) -> str:
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
            *("    " + _line([_cell(cell) for cell in row]) for row in table.rows),
            *([r"    \midrule"] if table.totals else []),
            *("    " + _line([_cell(cell) for cell in row]) for row in table.totals),
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


def _cell(cell: Cell) -> str:
    match cell:
        case None:
            return MISSING
        case Symbol(name):
            return symbol_math(name)
        case UnitCell(name):
            return unit_latex(name)
        case PlusMinus(value, deviation):
            return rf"{_number(number(value))} $\pm$ {_number(number(deviation, DEVIATION_DIGITS))}"
        case Unidentified(marked):
            return rf"{_cell(marked)}\,$\dagger$"
        case str():
            return escape_latex(cell)
    return _number(number(cell))


def _number(text: str | None) -> str:
    if text is None:
        return MISSING
    mantissa, _, exponent = text.partition("e")
    return rf"${mantissa}\times 10^{{{int(exponent)}}}$" if exponent else f"${mantissa}$"


def escape_latex(text: str) -> str:
    """Write plain text for LaTeX."""
    return one_line(text).translate(_ESCAPES)
