"""One command in a forked process that has everything loaded, with a watch from outside.

libhdf5 may hold the interpreter for ever, so whoever watches is another process.
"""

import os
import resource
import select
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import NamedTuple, NoReturn

# In which a command must end by itself, or else by Ctrl-C; and how long that may take, as a part of it, s.
LIMIT = 30.0
_AFTER_INTERRUPT = 0.5
_MEMORY = 8 << 30
_FILE_SIZE = 1 << 30
# Until what has ended is no process any more, s.
_MOMENT = 0.001


class Ended(NamedTuple):
    """How a command ended: exit code, negative for a signal; the seconds and what it said."""

    code: int
    interrupted: bool
    killed: bool
    seconds: float
    out: str
    err: str


def perform(arguments: tuple[str, ...], folder: Path, limit: float) -> Ended:
    """Run auvid in a folder. After the limit comes Ctrl-C, and then the end."""
    out, err = folder.with_name("out.txt"), folder.with_name("err.txt")
    start = time.perf_counter()
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        _become(arguments, folder, out, err)
    watch = os.pidfd_open(pid)
    interrupted = killed = False
    try:
        if not _ends(watch, limit):
            interrupted = True
            os.kill(pid, signal.SIGINT)
            killed = not _ends(watch, _AFTER_INTERRUPT * limit)
    finally:
        os.close(watch)
        # Whatever it has left behind goes with it.
        _end_group(pid)
    status = os.waitpid(pid, 0)[1]
    seconds = time.perf_counter() - start
    code = os.waitstatus_to_exitcode(status)
    return Ended(code, interrupted, killed, seconds, _text(out), _text(err))


def _ends(watch: int, seconds: float) -> bool:
    return bool(select.select([watch], [], [], seconds)[0])


def _end_group(pid: int) -> None:
    try:
        os.killpg(pid, signal.SIGKILL)
    except ProcessLookupError:
        time.sleep(_MOMENT)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


def _become(arguments: tuple[str, ...], folder: Path, out: Path, err: Path) -> NoReturn:
    """Run the forked process: nothing of it comes back."""
    code = 1
    try:
        os.setsid()
        os.chdir(folder)
        for number, target in enumerate((Path(os.devnull), out, err)):
            opened = os.open(target, os.O_RDONLY if number == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
            os.dup2(opened, number)
            os.close(opened)
        sys.stdin = os.fdopen(0, closefd=False)
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
        sys.stderr = os.fdopen(2, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False)
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
        resource.setrlimit(resource.RLIMIT_FSIZE, (_FILE_SIZE, _FILE_SIZE))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.argv = ["auvid", *arguments]
        code = _exit_code()
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:
        # As where a process ends by itself.
        os.write(2, traceback.format_exc().encode())
    finally:
        os._exit(code)


def _exit_code() -> int:
    from auvid_cli.__main__ import main

    try:
        main()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0
