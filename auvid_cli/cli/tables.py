"""Tables and figures of what a command found."""

from collections.abc import Callable, Mapping
from pathlib import Path

from auvid_cli.cli.terminal import Terminal
from auvid_cli.data.named_rows import NamedRows
from auvid_cli.report.csv_tables import write_csv_tables
from auvid_cli.report.figures.draw import FigureQueue, drawing


def write_and_draw(
    folder: Path, tables: Mapping[str, NamedRows], add_to: Callable[[FigureQueue], None], terminal: Terminal
) -> list[Path]:
    """Write tables into a results folder, and beside them what is added to the figures; return all files."""
    paths = write_csv_tables(tables, folder / "tables")
    with drawing(folder) as figures, terminal.progress("figures") as (progress,):
        add_to(figures)
        return paths + figures.finish(progress)
