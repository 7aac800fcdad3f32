"""Tables for the terminal, against what the terminal makes of them."""

from io import StringIO

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from auvid_cli.report.table import Column, Table
from auvid_cli.report.text_tables import fits, narrowed, screen_table


def console_of(width):
    return Console(file=StringIO(), width=width)


def shown(table, width):
    console = console_of(width)
    console.print(table)
    return [line.rstrip() for line in console.file.getvalue().splitlines() if line.strip()]


def table_of(*cells):
    columns = tuple(Column(f"c{number}", numeric=False) for number, _ in enumerate(cells))
    return screen_table(console_of(80), Table("key", "Title", columns, [list(cells)]))


@given(st.lists(st.text("abc", min_size=2, max_size=30), min_size=1, max_size=5), st.integers(8, 120))
def test_a_table_fits_where_it_is_shown_as_on_the_widest_terminal(cells, width):
    table = table_of(*cells)
    assert fits(console_of(width), table) == (shown(table, width) == shown(table, 1000))


def test_a_column_that_is_left_out_is_gone_from_body_and_totals():
    columns = tuple(Column(header) for header in ("a", "b", "a"))
    table = Table("key", "Title", columns, [[1.0, 2.0, 3.0]], [["x", "y", "z"]]).without("a")
    assert (table.columns, table.rows, table.totals) == ((Column("b"),), [[2.0]], [["y"]])


@pytest.mark.parametrize(("width", "said"), [(80, []), (50, ["b"]), (30, ["b", "a"])])
def test_a_table_names_the_columns_that_it_has_no_room_for(width, said):
    table = Table("key", "Title", tuple(Column(header) for header in "abc"), [["x" * 20] * 3])
    console = console_of(width)
    console.print(narrowed(console, table, ["absent", "b", "a"]))
    below = " ".join(console.file.getvalue().split()).rpartition("x" * 20)[2].strip()
    assert below == (f"left out at {width} columns (widen the terminal): {', '.join(said)}" if said else "")
