"""Tables, figures and the page of what a command found."""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from auvid_cli.cli.terminal import Terminal
from auvid_cli.config.figure_format import FigureFormat
from auvid_cli.data.named_rows import NamedRows
from auvid_cli.report.csv_tables import write_csv_tables
from auvid_cli.report.figures.draw import FigureQueue, drawing
from auvid_cli.report.page.write_page import write_page

if TYPE_CHECKING:
    from auvid_cli.report.page.parts import Page


def write_and_draw(
    folder: Path,
    tables: Mapping[str, NamedRows],
    add_to: Callable[[FigureQueue], None],
    page: tuple[Path, Callable[[], "Page"]],
    terminal: Terminal,
    figure_format: Collection[FigureFormat] | None,
) -> list[Path]:
    """Write tables into a results folder, beside them what is added to the figures, and a page; return all files."""
    paths = write_csv_tables(tables, folder / "tables")
    with drawing(folder, figure_format) as figures, terminal.progress("figures") as (progress,):
        add_to(figures)
        place, lay_out = page
        # While others draw.
        paths.append(write_page(lay_out(), place))
        return paths + figures.finish(progress)
