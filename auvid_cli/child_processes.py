"""Start child processes that import nothing from the working folder, end with their parent and ignore Ctrl-C.

Every child process is started within `starting_children`, and calls `end_with_parent` first.
"""

import ctypes
import gc
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

_PARENT = "AUVID_PARENT"
# Python does not import from the working folder.
_SAFE_PATH = {"PYTHONSAFEPATH": "1"}
_PR_SET_PDEATHSIG = 1
_POLL_INTERVAL = 0.2  # s
# Access right and time limit of Windows: to wait for the end of a process, without limit.
_SYNCHRONIZE = 0x100000
_INFINITE = 0xFFFFFFFF
_GRACE = 1.0  # s, for workers to end after SIGTERM
# Held while the environment is changed, because all threads share it.
_lock = threading.RLock()


@contextmanager
def starting_children() -> Iterator[None]:
    """Prepare the environment for processes that are started in the block, and keep Ctrl-C from them."""
    variables = _SAFE_PATH | {_PARENT: str(os.getpid())}
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
    # Start the tracker first: otherwise `multiprocessing` starts it with its first process and then unblocks SIGINT.
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


class WorkerDied(Exception):
    """A worker process ended while it called a function, or did not start."""


class Workers(Executor):
    """Processes that call functions; they start when needed, end with this process and ignore Ctrl-C.

    This process talks to them through pipes, which no other user can open. An exception in a `with` block ends them.

    Parameters
    ----------
    count : int
        Largest number of processes.
    method : str
        Start method of `multiprocessing`.
    attempts : int, default 1
        Number of workers that are tried for one call before it raises `WorkerDied`.
    """

    def __init__(self, count: int, method: str, attempts: int = 1) -> None:
        self._context: Any = multiprocessing.get_context(method)
        self._attempts = attempts
        self._threads = ThreadPoolExecutor(count)
        self._lock = threading.Lock()
        self._workers: set[_Worker] = set()
        self._idle: list[_Worker] = []
        self._is_killed = False

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        """Call a function in a worker; the future may raise `WorkerDied`."""
        return self._threads.submit(self._call, (function, arguments, options))

    def _call(self, request: tuple[Any, ...]) -> Any:
        reason: Exception = EOFError()
        for _ in range(self._attempts):
            worker = None
            try:
                worker = self._worker()
                result, error = worker.call(request)
            # The process failed; an error of the function itself is in `error`.
            except (EOFError, OSError) as death:
                reason = death
                if worker is not None:
                    self._workers.discard(worker)
                    worker.end()
                continue
            self._idle.append(worker)
            if error is not None:
                raise error
            return result
        raise WorkerDied(str(reason) or "killed") from reason

    def _worker(self) -> "_Worker":
        with self._lock:
            if self._is_killed:
                raise EOFError
            worker = self._idle.pop() if self._idle else _Worker(self._context)
            self._workers.add(worker)
            return worker

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for the running calls, and end the workers."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for worker in self._workers:
            worker.end()

    def __exit__(self, kind: object, *error: object) -> None:
        if kind is not None:
            with self._lock:
                self._is_killed = True
                workers = [*self._workers]
            # Terminated workers remove their temporary files; those that do not react in time are killed.
            for worker in workers:
                worker.process.terminate()
            end = time.monotonic() + _GRACE
            for worker in workers:
                worker.process.join(max(end - time.monotonic(), 0.0))
                worker.process.kill()
        self.shutdown(cancel_futures=True)


class _Worker:
    """A process, and the pipe to it."""

    def __init__(self, context: Any) -> None:
        self._pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs,), daemon=True)
        with starting_children():
            self.process.start()
        theirs.close()

    def call(self, request: tuple[Any, ...]) -> tuple[Any, Exception | None]:
        """Return the result of a function, or its error."""
        arrays = list[pickle.PickleBuffer]()
        pickled = pickle.dumps(request, protocol=5, buffer_callback=arrays.append)
        self._pipe.send((pickled, len(arrays)))
        # Each is sent from its own memory. A copy of all could be most of the memory of this process.
        for array in arrays:
            self._pipe.send_bytes(array.raw())
        return self._pipe.recv()

    def end(self) -> None:
        """Close the pipe, so that the process ends, and wait for it."""
        self._pipe.close()
        self.process.join()


def _serve(pipe: Connection) -> None:
    # Modules stay loaded, so the garbage collector need not look at them.
    gc.freeze()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    end_with_parent()
    with suppress(EOFError, OSError):
        while True:
            request, n_arrays = pipe.recv()
            arrays = [pipe.recv_bytes() for _ in range(n_arrays)]
            try:
                function, arguments, options = pickle.loads(request, buffers=arrays)
                pipe.send((function(*arguments, **options), None))
            except Exception as error:
                pipe.send((None, error))


def end_with_parent() -> None:
    """End this process when its parent ends: immediately on Linux, even if it is busy, elsewhere soon after."""
    parent = int(os.environ.pop(_PARENT, os.getppid()))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # The parent may have ended before `prctl` was called.
        if os.getppid() != parent:
            os._exit(1)
    else:
        threading.Thread(target=_exit_after, args=(parent,), daemon=True).start()


def _exit_after(parent: int) -> None:
    if sys.platform == "win32":
        # The number of the parent stays the same after its end, but Windows can wait for the end of a process.
        kernel = ctypes.WinDLL("kernel32")
        kernel.OpenProcess.restype = ctypes.c_void_p
        kernel.WaitForSingleObject(ctypes.c_void_p(kernel.OpenProcess(_SYNCHRONIZE, False, parent)), _INFINITE)
    else:
        # An orphan gets another parent.
        while os.getppid() == parent:
            time.sleep(_POLL_INTERVAL)
    os._exit(1)
