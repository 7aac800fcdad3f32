"""An interrupt at the terminal reaches every process there, and is for the command alone to handle."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def block_sigint() -> Iterator[None]:
    """Keep interrupts from the processes and threads that are started in a block; here they wait until it ends."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # The first process of all would bring this one along, which undoes the mask.
    resource_tracker.ensure_running()
    # It is inherited.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
