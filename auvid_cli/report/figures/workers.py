"""Processes that draw figures while others work."""

import gc
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Any

from auvid_cli.children import parentage
from auvid_cli.config.figure_format import FigureFormat
from auvid_cli.errors import FileError
from auvid_cli.interrupts import block_sigint

Submit = Callable[..., Future[Any]]

# More than a few would wait for each other's memory, and there are only a few figures.
_MOST = 4


def load_ahead() -> None:
    """Begin to load what draws, on a core that has nothing else to do yet; harmless where that has been done."""
    context = _context()
    context.set_forkserver_preload([f"auvid_cli.report.figures.{name}" for name in ("server", "patience", "kinds")])
    if context.get_start_method() == "forkserver":
        with block_sigint(), _environment_of_the_server():
            forkserver.ensure_running()


def _context() -> BaseContext:
    # Forking this process, which has threads, could lock it up; a server that has loaded matplotlib once forks well.
    has_server = "forkserver" in multiprocessing.get_all_start_methods()
    return multiprocessing.get_context("forkserver" if has_server else "spawn")


@contextmanager
def figure_workers() -> Iterator[Submit]:
    """Keep processes from the first figure on; what they have not begun when the block ends is dropped.

    Yields
    ------
    callable
        As `Executor.submit`.

    Raises
    ------
    FileError
        If one of them was killed.
    """
    count = min(os.cpu_count() or 1, _MOST)
    load_ahead()
    # None starts before there is something to draw: an interrupt while the core is compiled finds nobody to tell.
    pool = _Pool(count, _context())
    # A process is there only when its server has loaded everything: who has a figure to draw need not wait for that.
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
    """Processes, made when there is something to do: the locks between them are left behind if all end on the spot."""

    def __init__(self, count: int, context: BaseContext) -> None:
        self._count = count
        self._context = context
        self._lock = threading.Lock()
        self._workers: Executor | None = None

    def run(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Let one of them call a function, and wait for what it says."""
        with self._lock:
            self._workers = self._workers or self._made()
        return self._workers.submit(function, *arguments).result()

    def shutdown(self) -> None:
        """Wait until they are gone."""
        if self._workers is not None:
            self._workers.shutdown()

    def _made(self) -> Executor:
        try:
            return ProcessPoolExecutor(self._count, mp_context=self._context, initializer=_prepare)
        except OSError:
            # No shared memory for the locks between processes, as in some containers: one thread draws as well.
            return ThreadPoolExecutor(1)


@contextmanager
def _environment_of_the_server() -> Iterator[None]:
    """Keep a new Python from importing what lies in the current folder before what is installed; say who starts it."""
    variables = {"PYTHONSAFEPATH": "1"} | parentage()
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            del os.environ[name]
            if value is not None:
                os.environ[name] = value


def _prepare() -> None:
    # An interrupt is for the command to handle, which then ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    import auvid_cli.report.figures.patience  # noqa: F401

    # What matplotlib is made of need not be gone through again after each figure.
    gc.freeze()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End an idle worker whose command was killed: nothing else tells it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def draw_and_save(
    kind: str, arguments: tuple[Any, ...], folder: Path, name: str, formats: Collection[FigureFormat]
) -> list[Path]:
    """Draw a figure of a kind, see `kinds`, and write it. Only where this is called is matplotlib loaded."""
    from auvid_cli.report.figures.canvas import save
    from auvid_cli.report.figures.kinds import KINDS

    paths = save(KINDS[kind](*arguments), folder, name, formats)
    # A figure refers to itself, with all that it shows, and would be there while the next is drawn.
    gc.collect()
    return paths
