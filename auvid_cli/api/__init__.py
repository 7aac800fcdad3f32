"""Python interface: each step of the work as a function. It prints nothing, and writes files only if asked.

`auvid_cli` offers the public names of these modules, and loads each when it is first used.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

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
    """Callbacks during long work. They do nothing here; a subclass overrides the ones that it needs."""

    def message(self, sentence: str) -> None:
        """Receive a sentence about a result or a written file."""

    @contextmanager
    def compiling(self) -> Iterator[object]:
        """Enclose imports of compiled modules, which may have to be compiled first."""
        yield

    @contextmanager
    def stage(self, label: str) -> Iterator[Callable[[str], None]]:
        """Enclose a step of unknown duration; yields a callback that changes the label."""
        yield lambda text: None

    @contextmanager
    def bars(self, *labels: str, unit: str = "") -> Iterator[list[Advance]]:
        """Enclose counted work; yields a callback per label."""
        yield [lambda done, total, note="": None for _ in labels]


class Destination(NamedTuple):
    """Where and how a step writes its results."""

    folder: Path | None  # results folder; None for the default folder of the step
    overwrite: bool  # whether to replace results of other data or settings, and all files derived from these results
    progress: Progress
    figure_formats: tuple[FigureFormat, ...] = ()


def write_and_draw(
    page: Path,
    place: Destination,
    tables: Mapping[str, NamedRows],
    add_figures: Callable[["FigureQueue"], None],
    lay_out: Callable[[], "Page"],
) -> list[Path]:
    """Write CSV tables, figures and a page into the results folder of the page, and return all files."""
    from auvid_cli.report.figures.draw import drawing
    from auvid_cli.report.page.render import write_page
    from auvid_cli.report.text_tables import write_csv_tables

    paths = write_csv_tables(tables, page.parent / "tables")
    with drawing(page.parent, place.figure_formats) as figures, place.progress.bars("figures") as (advance,):
        add_figures(figures)
        # The page is made while other processes draw.
        paths.append(write_page(lay_out(), page))
        return paths + figures.finish(advance)


# Modules of the compiled core that a second process can compile: they share no function with `load_vehicles`.
COMPILED_FILTERS = (
    "auvid_cli.filters.square_root",
    "auvid_cli.filters.least_squares",
    "auvid_cli.filters.smoother",
    "auvid_cli.filters.noise_search",
)


def load_vehicles() -> None:
    """Import the compiled modules that concern vehicles; this takes seconds if they must be compiled first."""
    import auvid_cli.identification.faults
    import auvid_cli.identification.process
    import auvid_cli.simulation.simulate  # noqa: F401
