"""Progress of long work, and the tables, figures and page of a results folder."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from auvid_cli.config.enums import FigureFormat
from auvid_cli.data.checks import NamedRows

if TYPE_CHECKING:
    from auvid_cli.report.figures.draw import FigureQueue
    from auvid_cli.report.page.parts import Page


class Advance(Protocol):
    """Callback that moves a progress bar."""

    def __call__(self, done: float, total: float, note: str = "") -> None:
        """Move the bar to `done` of `total`; `note` is shown next to the rate."""
        ...


class Progress:
    """Callbacks of long work, which do nothing; a subclass overrides those that it needs."""

    def message(self, sentence: str) -> None:
        """Take a sentence about what has been found or written."""

    @contextmanager
    def stage(self, label: str) -> Iterator[Callable[[str], None]]:
        """Enclose a step of unknown length; yields a callback that takes a new label."""
        yield lambda text: None

    @contextmanager
    def bars(self, *labels: str, unit: str = "") -> Iterator[list[Advance]]:
        """Enclose counted work; yields a callback for each label."""
        yield [lambda done, total, note="": None for _ in labels]


def write_and_draw(
    folder: Path,
    tables: Mapping[str, NamedRows],
    add_figures: Callable[["FigureQueue"], None],
    page: Path,
    lay_out: Callable[[], "Page"],
    figure_formats: Collection[FigureFormat],
    progress: Progress,
) -> list[Path]:
    """Write CSV tables, figures and a page into a results folder, and return all files."""
    from auvid_cli.report.figures.draw import drawing
    from auvid_cli.report.page.render import write_page
    from auvid_cli.report.text_tables import write_csv_tables

    paths = write_csv_tables(tables, folder / "tables")
    with drawing(folder, figure_formats) as figures, progress.bars("figures") as (advance,):
        add_figures(figures)
        # Laid out while other processes draw.
        paths.append(write_page(lay_out(), page))
        return paths + figures.finish(advance)
