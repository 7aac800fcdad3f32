"""Processes that end with the command that started them, however it ends."""

import ctypes
import os
import signal
import sys
import threading
import time

_PARENT = "AUVID_PARENT"
_PR_SET_PDEATHSIG = 1
# s
_LOOK_EVERY = 0.2


def parentage() -> dict[str, str]:
    """Return what a child needs in its environment to know who started it."""
    return {_PARENT: str(os.getpid())}


def end_with_parent() -> None:
    """Have this process killed as soon as the thread that started it is gone: to be called first, in the child.

    Only Linux offers it. Elsewhere a child goes on until it looks for its parent itself.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # The parent may have ended before this was said.
        if os.environ[_PARENT] != str(os.getppid()):
            os._exit(1)


def watch_parent() -> None:
    """Let this process end within a moment of the one that started it, whatever it is doing."""
    threading.Thread(target=_end_after, args=(os.getppid(),), daemon=True).start()


def _end_after(parent: int) -> None:
    # Whose parent is gone is given to another.
    while os.getppid() == parent:
        time.sleep(_LOOK_EVERY)
    os._exit(1)
