"""Text of a user's files in tables, in figures and on the screen is nothing but text."""

import csv
import re
from io import StringIO
from xml.etree import ElementTree

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from rich.table import Table as ScreenTable
from rich.text import Text

from auvid_cli.config.enums import FigureFormat
from auvid_cli.data.checks import csv_text, csv_value
from auvid_cli.report.figures.style import head, new_figure, plain
from auvid_cli.report.figures.workers import save
from auvid_cli.report.table import Column, Table
from auvid_cli.report.text_tables import PlainConsole, render_latex, render_markdown
from auvid_cli.text import printable

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
pieces = st.lists(st.sampled_from([*"=+-@'\"\t\r\n,;|\\$%&#_{}[]*`<>~^ab1.", "\x1b[2J", "\u202e"]), max_size=12)
hostile = texts | pieces.map("".join)


def table_of(*cells):
    return Table("key", "Title", tuple(Column("x", numeric=False) for _ in cells), [list(cells)])


@given(hostile)
@example('=HYPERLINK("http://x")')
@example("'=1+1")
@example("@SUM(1)")
@example("-1+1")
@example("\t=1")
@example("-2_000")
def test_a_csv_cell_is_read_back_and_is_no_formula(text):
    rows = list(csv.reader(StringIO(csv_text(["x", text], [[1, text]]), newline="")))
    for cell in (rows[0][1], rows[1][1]):
        assert csv_value(cell) == printable(text)
        assert cell[:1] not in tuple("=+-@\t\r") or re.fullmatch(r"[+-](\d+\.?\d*(e[+-]?\d+)?|inf|nan)", cell.lower())
    assert len(rows) == 2


@given(st.floats())
def test_a_number_in_csv_stays_a_number(number):
    (_, (cell, text)) = csv.reader(StringIO(csv_text(["x", "y"], [[number, str(number)]])))
    assert cell == text == repr(number)


# Commands, and signs that stand for themselves behind a backslash.
_LATEX_ESCAPE = r"\\(text\w+\{\}|[&%$#_{}]|'\{e\})|\{[\[*]\}|\$\\(pm|mu|dagger)\$"


@given(hostile)
@example(r"\input{/etc/passwd}")
@example(r"\\[5pt]")
def test_a_latex_cell_has_nothing_that_latex_understands(text):
    body = render_latex([table_of(text, "end")]).split("\\midrule\n    ")[1].split(" & end \\\\\n")[0]
    assert not re.search(r"[\\&%$#_{}~^\[*\n]", re.sub(_LATEX_ESCAPE, "", body))


@given(hostile)
@example("<img src=x onerror=alert(1)>")
@example("a\n\n# b | c `d` [e](f)")
def test_a_markdown_cell_stays_a_cell_without_marks(text):
    lines = render_markdown([table_of(text, "end")]).splitlines()
    assert len(lines) == 7
    cell = lines[-1].removeprefix("| ").removesuffix(" | end |")
    assert not re.search(r"[<`*\[\]|$~#]", re.sub(r"\\.", "", cell))


@pytest.mark.parametrize("text", ["$", "$x$", "$\\frac{$", "a$b$c$d", "\\$x$", "$\\undefined$", "\x1b\x00"])
def test_a_name_in_a_figure_is_no_mathematics(text):
    figure = new_figure(1.0, 1.0)
    axes = figure.subplots()
    head(axes, plain(text))
    FigureCanvasAgg(figure).draw()
    assert axes.title._preprocess_math(axes.title.get_text()) == (printable(text), False)


def test_a_name_in_other_letters_is_drawn_without_a_warning(tmp_path):
    figure = new_figure(1.0, 1.0)
    head(figure.subplots(), plain("水 <b> & --> \x00"))
    _, svg = save(figure, tmp_path, "figure", (FigureFormat.PNG, FigureFormat.SVG))
    ElementTree.parse(svg)


@pytest.mark.parametrize("text", ["\x1b[2J", "[red]x[/red]", "\x9b2J", "\x07\x08", "\u202ex", "\x1b]0;title\x07"])
@pytest.mark.parametrize("colours", [True, False])
def test_the_screen_is_steered_by_nothing_that_it_shows(text, colours):
    console = PlainConsole(file=StringIO(), force_terminal=colours, width=60, legacy_windows=False)
    table = ScreenTable()
    table.add_column(Text(text))
    table.add_row(Text(text))
    console.print(table)
    console.print(text, markup=False, soft_wrap=True)
    without_colours = re.sub(r"\x1b\[[0-9;]*m", "", console.file.getvalue())
    assert without_colours.replace("\n", "").isprintable()
    assert without_colours.splitlines()[-1] in (
        printable(text),
        printable(text.replace("\x07", "").replace("\x08", "")),
    )
