"""Tables on the terminal."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import accumulate
from types import MappingProxyType

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table as ScreenTable
from rich.text import Text

from auvid_cli.report.table import (
    DIGITS,
    CellStyle,
    Table,
    cell_text,
    number,
    unit_text,
)
from auvid_cli.text import printable_lines

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
    caption = Text(f" left out at {console.width} columns: {', '.join(left_out)}") if left_out else None
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
