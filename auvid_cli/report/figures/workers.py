"""Processes that draw figures while others work."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from typing import Any

from auvid_cli.errors import FileError

# More than a few would wait for each other's memory, and there are only nine figures.
_MOST = 4


@contextmanager
def figure_workers() -> Iterator[Executor]:
    """Processes that are there from the first figure on; what they have not begun when the block ends is dropped.

    Raises
    ------
    FileError
        If one of them was killed.
    """
    count = min(os.cpu_count() or 1, _MOST)
    # Forking this process, which has threads, could lock it up; a server that has loaded matplotlib once forks well.
    # None starts before there is something to draw: an interrupt while the core is compiled finds nobody to tell.
    method = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    context = multiprocessing.get_context(method)
    context.set_forkserver_preload(["auvid_cli.report.figures.kinds"])
    if method == "forkserver":
        # The server would bring this one along, which undoes the mask.
        resource_tracker.ensure_running()
        # It inherits the mask: an interrupt at the terminal is for the command to handle, not for what loads here.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        with _without_the_current_folder():
            forkserver.ensure_running()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        workers: Executor = ProcessPoolExecutor(count, mp_context=context, initializer=_prepare)
    except OSError:
        # No shared memory for the locks between processes, as in some containers: one thread draws as well.
        workers = ThreadPoolExecutor(1)
    try:
        yield workers
    except BrokenProcessPool as error:
        raise FileError(
            "figures: a process that draws them was ended from outside, perhaps for want of memory; "
            "the estimates are written, `auvid report` draws again"
        ) from error
    finally:
        workers.shutdown(cancel_futures=True)


@contextmanager
def _without_the_current_folder() -> Iterator[None]:
    """Keep a new Python from importing what lies in the current folder before what is installed."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before


def _prepare() -> None:
    # An interrupt is for the command to handle, which then ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Filters go first; a figure has time until they are done.
    if hasattr(os, "nice"):
        os.nice(10)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Nothing tells an idle worker that the command was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def draw_and_save(kind: str, arguments: tuple[Any, ...], folder: Path, name: str) -> list[Path]:
    """Draw a figure of a kind, see `kinds`, and write it. Only where this is called is matplotlib loaded."""
    from auvid_cli.report.figures.canvas import save
    from auvid_cli.report.figures.kinds import KINDS

    return save(KINDS[kind](*arguments), folder, name)
