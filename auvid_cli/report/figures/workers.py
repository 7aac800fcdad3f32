"""Processes that draw figures in parallel with the filters, and write them: only these processes load matplotlib."""

import logging
import multiprocessing
import os
import warnings
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from contextlib import chdir, contextmanager
from importlib.util import find_spec
from multiprocessing import forkserver
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvid_cli.child_processes import WorkerDied, Workers, starting_children
from auvid_cli.config.enums import FigureFormat
from auvid_cli.data.files import remove, replacing
from auvid_cli.errors import FileError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Submit = Callable[..., Future[Any]]

# Duration, s, above which memory matters more than time: the server and each process that draws take 100 MB.
LONG_DATA = 7200.0
# More workers would compete for memory, and there are few figures.
_MAX_WORKERS = 4


def load_ahead(duration: float = 0.0) -> None:
    """Start to load matplotlib in the fork server, in parallel with this process.

    `duration` is that of the data, s. If they are long, the server starts with the first figure instead.
    """
    if _start_method() == "forkserver":
        multiprocessing.get_context("forkserver").set_forkserver_preload(["auvid_cli.report.figures.server"])
        if duration <= LONG_DATA:
            with starting_children():
                forkserver.ensure_running()


def _start_method() -> str:
    # This process has threads and may not be forked safely; a server that has loaded matplotlib may.
    return "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"


@contextmanager
def figure_workers(duration: float = 0.0) -> Iterator[Submit]:
    """Start worker processes with the first figure and stop them at the end of the block.

    Figures that are not started by then are dropped.

    Parameters
    ----------
    duration : float
        Duration of the data, s; see `load_ahead`.

    Yields
    ------
    callable
        As `Executor.submit`.

    Raises
    ------
    FileError
        If a worker was killed.
    """
    load_ahead(duration)
    try:
        # A process keeps some 60 MB after a figure. A fork server starts a new one in 10 ms, with matplotlib loaded.
        method = _start_method()
        with Workers(min(os.cpu_count() or 1, _MAX_WORKERS), method, reuse=method == "spawn") as pool:
            yield pool.submit
    except WorkerDied as error:
        raise FileError(
            "figures: a process that draws them was killed, perhaps because memory ran out; "
            "the estimates are written, draw again with `auvid report`"
        ) from error


def load_matplotlib() -> None:
    """Load matplotlib with the settings that it ships with, whatever the environment and the user's files say."""
    os.environ["MPLBACKEND"] = "agg"
    # Its warnings are on folders of the user that it replaces.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    package = find_spec("matplotlib")
    assert package is not None
    assert package.origin is not None
    # It first looks for a settings file in the working folder.
    with chdir(Path(package.origin).with_name("mpl-data")):
        import matplotlib  # noqa: F401


def save(figure: "Figure", folder: Path, name: str, formats: Collection[FigureFormat]) -> list[Path]:
    """Write a figure in each of `formats`, and remove its files of other formats."""
    with warnings.catch_warnings():
        # A character of a name that the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        paths = [_save(figure, folder / f"{name}.{form}", form) for form in FigureFormat if form in formats]
    remove(folder / f"{name}.{form}" for form in FigureFormat if form not in formats)
    return paths


def _save(figure: "Figure", path: Path, form: FigureFormat) -> Path:
    # `Figure.savefig` would draw everything twice for each file, first only for the layout.
    with replacing(path) as temporary:
        match form:
            case FigureFormat.PNG:
                from matplotlib.backends.backend_agg import FigureCanvasAgg

                options = {"metadata": {"Software": "auvid"}, "pil_kwargs": {"compress_level": 4}}
                FigureCanvasAgg(figure).print_png(temporary, **options)
            case FigureFormat.SVG:
                from matplotlib.backends.backend_svg import FigureCanvasSVG

                FigureCanvasSVG(figure).print_svg(temporary, metadata={"Date": None})
            case FigureFormat.PDF:
                from matplotlib.backends.backend_pdf import FigureCanvasPdf

                FigureCanvasPdf(figure).print_pdf(temporary, metadata={"CreationDate": None})
    # The layout is kept for the next format.
    figure.set_layout_engine("none")
    return path
