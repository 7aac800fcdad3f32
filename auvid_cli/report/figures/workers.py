"""Processes that draw figures while others work."""

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
from typing import Any

from auvid_cli.child_processes import WorkerPool, starting_children
from auvid_cli.config.enums import FigureFormat
from auvid_cli.errors import FileError

Submit = Callable[..., Future[Any]]

# More workers would compete for memory, and there are few figures.
_MAX_WORKERS = 4


def load_ahead() -> None:
    """Start to load the drawing library in the fork server while this process does something else."""
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
    """Keep worker processes from the first figure to the end of the block; figures not begun by then are dropped.

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
    # Submitting the first figure waits until the server has loaded everything; the caller does not.
    threads = ThreadPoolExecutor(count)
    try:
        yield partial(threads.submit, pool.run)
    except BrokenProcessPool as error:
        raise FileError(
            "figures: a process that draws them was ended from outside, perhaps for want of memory; "
            "the estimates are written, `auvid report` draws again"
        ) from error
    finally:
        threads.shutdown(cancel_futures=True)
        pool.shutdown()


class _Pool:
    """Workers that start with the first figure, so that an interrupt before it finds none."""

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
            # Some containers have no shared memory for locks between processes; one thread draws as well.
            return ThreadPoolExecutor(1)


def draw_and_save(
    kind: str, arguments: tuple[Any, ...], folder: Path, name: str, formats: Collection[FigureFormat]
) -> list[Path]:
    """Draw a figure of a kind, see `kinds`, and write it; only here is matplotlib loaded."""
    from auvid_cli.report.figures.kinds import KINDS, save

    paths = save(KINDS[kind](*arguments), folder, name, formats)
    # A figure refers to itself and would stay in memory while the next is drawn.
    gc.collect()
    return paths
