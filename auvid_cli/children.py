"""Processes that end with the command that started them, however it ends."""

import ctypes
import signal
import sys

_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """Have this process killed as soon as the thread that started it is gone: to be called first, in the child.

    Only Linux offers it. Elsewhere a child goes on until it looks for its parent itself.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
