"""Processes that draw figures in parallel with the filters."""

import gc
import logging
import multiprocessing
import os
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from contextlib import chdir, contextmanager
from importlib.util import find_spec
from multiprocessing import forkserver
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvid_cli.child_processes import WorkerDied, Workers, starting_children
from auvid_cli.config.enums import FigureFormat
from auvid_cli.errors import FileError

if TYPE_CHECKING:
    from auvid_cli.report.figures.draw import FigureRequest

Submit = Callable[..., Future[Any]]

# More workers would compete for memory, and there are few figures.
_MAX_WORKERS = 4


def load_ahead() -> None:
    """Start to load matplotlib in the fork server, in parallel with this process."""
    if _start_method() == "forkserver":
        multiprocessing.get_context("forkserver").set_forkserver_preload(["auvid_cli.report.figures.server"])
        with starting_children():
            forkserver.ensure_running()


def _start_method() -> str:
    # This process has threads and may not be forked safely; a server that has loaded matplotlib may.
    return "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"


@contextmanager
def figure_workers() -> Iterator[Submit]:
    """Start worker processes with the first figure and stop them at the end of the block.

    Figures that are not started by then are dropped.

    Yields
    ------
    callable
        As `Executor.submit`.

    Raises
    ------
    FileError
        If a worker was killed.
    """
    load_ahead()
    try:
        with Workers(min(os.cpu_count() or 1, _MAX_WORKERS), _start_method()) as pool:
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


def draw_and_save(request: "FigureRequest", folder: Path, name: str, formats: Collection[FigureFormat]) -> list[Path]:
    """Draw the figure of a request and write it; called in a process that may load matplotlib."""
    load_matplotlib()
    from auvid_cli.report.figures.kinds import draw_figure, save

    paths = save(draw_figure(request), folder, name, formats)
    # A figure refers to itself; without this it would stay in memory while the next one is drawn.
    gc.collect()
    return paths
