"""Tables as text: CSV, Markdown, LaTeX and the terminal."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import accumulate, groupby
from pathlib import Path
from types import MappingProxyType

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table as ScreenTable
from rich.text import Text

from auvid_cli.data.checks import NamedRows
from auvid_cli.data.files import write_text
from auvid_cli.report.table import (
    DIGITS,
    CellStyle,
    Table,
    capitalised,
    cell_text,
    number,
    symbol_math,
    unit_latex,
    unit_text,
)
from auvid_cli.text import one_line, printable_lines

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


MISSING = "-"
NO_STYLES: Mapping[str, str] = MappingProxyType({})
# Columns; wider than any table, so that none is measured as it would be squeezed.
_UNLIMITED = 10_000
# ASCII replacements of auvid's signs.
_PLAIN = str.maketrans({"±": "+-", "µ": "u", "†": "?"})


class PlainConsole(Console):
    """A console that prints control characters of a text as visible escapes."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Turn something into segments, as `Console.render`."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable_lines(text), style, control)


def screen_table(
    console: Console,
    table: Table,
    digits: int = DIGITS,
    unbroken: Collection[str] = (),
    styles: Mapping[str, str] = NO_STYLES,
    left_out: Sequence[str] = (),
) -> ScreenTable:
    """Return a table for a console, with the names of the columns that were left out below it.

    Parameters
    ----------
    digits : int
        Significant ones of a number.
    unbroken : collection of str
        Headings of columns whose lines are not broken, however narrow the console is.
    styles : mapping
        Styles of cells by their text.
    left_out : sequence of str
        Names of the columns that were left out.
    """
    caption = (
        Text(f" left out at {console.width} columns (widen the terminal): {', '.join(left_out)}") if left_out else None
    )
    screen = ScreenTable(
        box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), caption=caption, caption_justify="left"
    )
    for column in table.columns:
        header, justify = Text(encodable(console, column.header)), "right" if column.numeric else "left"
        screen.add_column(header, justify=justify, no_wrap=column.header in unbroken, overflow="fold")
    style = _cell_style(console, digits)
    for row in [*table.rows, *table.totals]:
        if table.totals and row is table.totals[0]:
            screen.add_section()
        texts = (cell_text(cell, style) for cell in row)
        screen.add_row(*(Text(text, styles.get(text, "")) for text in texts))
    return screen


def narrowed(console: Console, table: Table, dropped: Sequence[str], digits: int = DIGITS) -> ScreenTable:
    """Render a table, without the first columns of `dropped` that do not fit."""
    headers = [column.header for column in table.columns]
    dropped = [header for header in dropped if header in headers]
    screen = ScreenTable()
    for count, narrower in enumerate(accumulate(dropped, Table.without, initial=table)):
        screen = screen_table(console, narrower, digits, left_out=dropped[:count])
        if fits(console, screen):
            break
    return screen


def fits(console: Console, table: ScreenTable) -> bool:
    """Whether a table fits on a console without broken lines."""
    return console.measure(table, options=console.options.update(max_width=_UNLIMITED)).maximum <= console.width


def printed(value: float | None, digits: int = DIGITS) -> str:
    """Write a number for the terminal, a dash where there is none."""
    return MISSING if value is None else number(value, digits) or MISSING


def print_texts(console: Console, texts: Iterable[str]) -> None:
    """Print texts without markup, each on lines of its own."""
    for text in texts:
        console.print(Text(text))


def encodable(console: Console, text: str) -> str:
    """Return the text, or plain letters for auvid's signs where the terminal's encoding lacks them."""
    return text if _has_signs(console, text) else text.translate(_PLAIN)


def _cell_style(console: Console, digits: int) -> CellStyle:
    return CellStyle(
        MISSING,
        symbol=str,
        unit=lambda name: unit_text(name) if _has_signs(console, unit_text(name)) else name,
        text=str,
        plus_minus=encodable(console, "±"),
        mark=encodable(console, "†"),
        digits=digits,
    )


def _has_signs(console: Console, text: str) -> bool:
    try:
        text.encode(console.encoding)
    except UnicodeEncodeError:
        return False
    return True
