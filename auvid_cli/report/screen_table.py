"""Tables for the terminal: alike, and with as much in them as there is room for."""

from collections.abc import Iterable

from rich import box
from rich.console import Console
from rich.table import Table

# Columns; wider than any table, so that none is measured as it would be squeezed.
_UNLIMITED = 10_000


def screen_table() -> Table:
    """Make an empty table as all of them look: a rule under the headings, and nothing else."""
    return Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))


def fits(console: Console, table: Table) -> bool:
    """Say whether a console is wide enough for a table without breaking its lines."""
    return console.measure(table, options=console.options.update(max_width=_UNLIMITED)).maximum <= console.width


def first_that_fits(console: Console, tables: Iterable[Table]) -> Table:
    """Return the first of ever narrower tables, at least one, for which there is room, or else the last."""
    table = Table()
    for table in tables:
        if fits(console, table):
            break
    return table
