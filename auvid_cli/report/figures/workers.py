"""Processes that draw figures in parallel with the filters."""

import gc
import multiprocessing
import os
import threading
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing import forkserver
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvid_cli.child_processes import WorkerPool, starting_children
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
        modules = [f"auvid_cli.report.figures.{name}" for name in ("server", "kinds")]
        multiprocessing.get_context("forkserver").set_forkserver_preload(modules)
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
    count = min(os.cpu_count() or 1, _MAX_WORKERS)
    load_ahead()
    pool = _Pool(count)
    # The first submit waits until the server has loaded matplotlib; a thread waits instead of the caller.
    threads = ThreadPoolExecutor(count)
    try:
        yield partial(threads.submit, pool.run)
    except BrokenProcessPool as error:
        raise FileError(
            "figures: a process that draws them was killed, perhaps because memory ran out; "
            "the estimates are written, draw again with `auvid report`"
        ) from error
    finally:
        threads.shutdown(cancel_futures=True)
        pool.shutdown()


class _Pool:
    """Worker processes that start with the first figure, so that an earlier interrupt has none to stop."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._lock = threading.Lock()
        self._workers: Executor | None = None

    def run(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function in a worker and wait for its result."""
        with self._lock:
            self._workers = self._workers or self._start()
        return self._workers.submit(function, *arguments).result()

    def shutdown(self) -> None:
        """Wait until the workers have ended."""
        if self._workers is not None:
            self._workers.shutdown()

    def _start(self) -> Executor:
        try:
            return WorkerPool(self._count, _start_method())
        except OSError:
            # Some containers have no shared memory for locks between processes; then one thread draws.
            return ThreadPoolExecutor(1)


def draw_and_save(request: "FigureRequest", folder: Path, name: str, formats: Collection[FigureFormat]) -> list[Path]:
    """Draw the figure of a request and write it; called in a process that may load matplotlib."""
    from auvid_cli.report.figures.kinds import draw_figure, save

    paths = save(draw_figure(request), folder, name, formats)
    # A figure refers to itself; without this it would stay in memory while the next one is drawn.
    gc.collect()
    return paths
