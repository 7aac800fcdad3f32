"""Call functions in child processes, which import no module of the working folder or of the user's script.

They end with their parent and ignore Ctrl-C.
"""

import ctypes
import gc
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

_PARENT = "AUVID_PARENT"
_PR_SET_PDEATHSIG = 1
_GRACE = 1.0  # s, for workers to end after SIGTERM
# Held while the environment and `__main__` are changed, because all threads share them.
_lock = threading.RLock()


@contextmanager
def starting_children() -> Iterator[None]:
    """Hide the working folder and the script from processes that the block starts, and keep Ctrl-C from them."""
    # With a safe path, Python does not import from the working folder.
    variables = {"PYTHONSAFEPATH": "1", _PARENT: str(os.getpid())}
    with _lock:
        script, before = sys.modules["__main__"], {name: os.environ.get(name) for name in variables}
        # `multiprocessing` would run the script again in each process.
        sys.modules["__main__"] = ModuleType("__main__")
        os.environ.update(variables)
        try:
            with _blocked_sigint():
                yield
        finally:
            sys.modules["__main__"] = script
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


class WorkerDied(Exception):
    """A worker process ended while it called a function, or did not start."""


class Workers(ThreadPoolExecutor):
    """Pool of threads, each of which calls functions in a process of its own; processes start when needed.

    Requests and results go through pipes, which no other user can open. An exception in a `with` block ends them.

    Parameters
    ----------
    count : int
        Largest number of processes.
    method : str, default "spawn"
        Start method of `multiprocessing`.
    attempts : int, default 1
        Number of workers that are tried for one call before it raises `WorkerDied`.
    reuse : bool, default True
        Whether a worker calls several functions. Otherwise it ends after the first, which frees all of its memory.
    """

    def __init__(self, count: int, method: str = "spawn", attempts: int = 1, reuse: bool = True) -> None:
        super().__init__(count)
        self._context: Any = multiprocessing.get_context(method)
        self._attempts = attempts
        self._reuse = reuse
        self._of_thread = threading.local()
        self._lock = threading.Lock()
        self._workers: set[_Worker] = set()
        self._is_killed = False

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        """Call a function in a worker; the future may raise `WorkerDied`."""
        return super().submit(self._call, (function, arguments, options))

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
                    self._end(worker)
                continue
            if not self._reuse:
                self._end(worker)
            if error is not None:
                raise error
            return result
        raise WorkerDied(str(reason) or "killed") from reason

    def _worker(self) -> "_Worker":
        """Return the worker of this thread."""
        if not hasattr(self._of_thread, "worker"):
            with self._lock:
                if self._is_killed:
                    raise EOFError
                self._of_thread.worker = _Worker(self._context)
                self._workers.add(self._of_thread.worker)
        return self._of_thread.worker

    def _end(self, worker: "_Worker") -> None:
        """End the worker of this thread."""
        del self._of_thread.worker
        self._workers.discard(worker)
        worker.end()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for the running calls, and end the workers."""
        super().shutdown(wait, cancel_futures=cancel_futures)
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
            _answer(pipe)


def _answer(pipe: Connection) -> None:
    """Call the function of one request; a function of its own, so that arguments are freed before the next request."""
    request, n_arrays = pipe.recv()
    arrays = [pipe.recv_bytes() for _ in range(n_arrays)]
    try:
        function, arguments, options = pickle.loads(request, buffers=arrays)
        pipe.send((function(*arguments, **options), None))
    except Exception as error:
        pipe.send((None, error))


def end_with_parent() -> None:
    """End this process when its parent ends: immediately on Linux, even if it is busy, elsewhere soon after."""
    started_by = int(os.environ.pop(_PARENT, os.getppid()))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # The parent may have ended before `prctl` was called.
        if os.getppid() != started_by:
            os._exit(1)
    # A fork server has no `parent_process`; without its parent it ends by itself, once its modules are loaded.
    elif (parent := multiprocessing.parent_process()) is not None:
        threading.Thread(target=_exit_after, args=(parent,), daemon=True).start()


def _exit_after(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)
