"""Start child processes that import nothing from the working folder, end with their parent and ignore Ctrl-C.

Every child process is started within `starting_children`, and calls `end_with_parent` first.
"""

import ctypes
import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

_PARENT = "AUVID_PARENT"
# Python does not import from the working folder.
SAFE_PATH = {"PYTHONSAFEPATH": "1"}
_PR_SET_PDEATHSIG = 1
_POLL_INTERVAL = 0.2  # s
# All threads share the environment.
_lock = threading.RLock()


@contextmanager
def starting_children() -> Iterator[None]:
    """Prepare the environment for processes that are started in the block, and keep Ctrl-C from them."""
    variables = SAFE_PATH | {_PARENT: str(os.getpid())}
    with _lock:
        before = {name: os.environ.get(name) for name in variables}
        os.environ.update(variables)
        try:
            with _blocked_sigint():
                yield
        finally:
            for name, value in before.items():
                del os.environ[name]
                if value is not None:
                    os.environ[name] = value


@contextmanager
def _blocked_sigint() -> Iterator[None]:
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Multiprocessing starts the tracker with its first process and then unblocks SIGINT; children inherit the mask.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_python(*arguments: str, environment: Mapping[str, str] | None = None, **options: Any) -> subprocess.Popen:
    """Start a Python process that imports this package, but no module of the working folder; silent by default."""
    quiet: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with starting_children():
        path = os.pathsep.join(filter(None, [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH")]))
        variables = os.environ | {"PYTHONPATH": path} | dict(environment or {})
        return subprocess.Popen([sys.executable, "-P", *arguments], env=variables, **(quiet | options))


class WorkerPool(ProcessPoolExecutor):
    """Executor whose processes end with this process and ignore Ctrl-C."""

    def __init__(self, count: int, method: str) -> None:
        # The locks of the executor start the resource tracker.
        with starting_children():
            super().__init__(count, multiprocessing.get_context(method), initializer=_prepare_worker)

    def submit(self, *arguments: Any, **options: Any) -> Future[Any]:
        """Start workers if needed, and submit the call to them."""
        with starting_children():
            return super().submit(*arguments, **options)


def _prepare_worker() -> None:
    # Modules stay loaded, so the garbage collector need not look at them.
    gc.freeze()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def end_with_parent() -> None:
    """End this process when its parent ends: immediately on Linux, even if it is busy, elsewhere soon after."""
    parent = int(os.environ.pop(_PARENT, os.getppid()))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # The parent may have ended before the call.
        if os.getppid() != parent:
            os._exit(1)
    else:
        threading.Thread(target=_exit_after, args=(parent,), daemon=True).start()


def _exit_after(parent: int) -> None:
    # An orphan gets another parent.
    while os.getppid() == parent:
        time.sleep(_POLL_INTERVAL)
    os._exit(1)
