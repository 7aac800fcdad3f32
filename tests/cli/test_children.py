"""Nothing outlives a command, however it ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from uuid import uuid4

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks in /proc")

_ENOUGH = 2.0


@pytest.fixture
def begun(tmp_path):
    """Function: a Python process with a mark in its environment, and a function that finds all that have it."""
    mark = f"AUVID_TEST={uuid4().hex}"
    environment = os.environ | dict([mark.split("=")])

    def marked() -> list[str]:
        commands = []
        for process in Path("/proc").glob("[0-9]*"):
            try:
                if mark.encode() in (process / "environ").read_bytes():
                    commands.append((process / "cmdline").read_text().replace("\0", " "))
            except OSError:
                continue
        return commands

    def begin(*arguments: str, **more: str):
        command = [sys.executable, *arguments]
        quiet = subprocess.DEVNULL
        return subprocess.Popen(command, cwd=tmp_path, env=environment | more, stdout=quiet, stderr=quiet), marked

    return begin


def left_of(marked) -> list[str]:
    """Return the processes that still run after a moment."""
    end = time.monotonic() + _ENOUGH
    while marked() and time.monotonic() < end:
        time.sleep(0.02)
    return marked()


@pytest.mark.slow
def test_early_end_leaves_no_drawing_process(begun):
    process, marked = begun("-m", "auvid_cli", "run", "--set", "nope=3")
    assert process.wait(60) == 2
    assert left_of(marked) == []


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM)])
def test_killed_command_leaves_no_drawing_process(begun, tmp_path, number):
    """And does not go on first: Python loses most exceptions that come while it compiles a module."""
    process, marked = begun("-m", "auvid_cli", "run")
    while not any("forkserver" in command for command in marked()):
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(number)
    assert process.wait(60) != 0
    assert left_of(marked) == []
    assert not list(tmp_path.rglob("*.h5"))


@pytest.mark.slow
def test_compiling_process_ends_with_killed_command(begun, tmp_path):
    code = """
import os, signal, time
from auvid_cli.numerics import compile_elsewhere
with compile_elsewhere("auvid_cli.filters.square_root"):
    time.sleep(0.5)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    process, marked = begun("-c", code, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert process.wait(60) == -signal.SIGKILL
    assert left_of(marked) == []


@pytest.mark.slow
def test_worker_ends_with_killed_command(begun, tmp_path):
    """Whatever the worker was doing, and however early."""
    program = tmp_path / "program.py"
    program.write_text("""
import os, signal, time
from auvid_cli.child_processes import Workers
Workers(1).submit(time.sleep, 60)
time.sleep(1.0)
os.kill(os.getpid(), signal.SIGKILL)
""")
    process, marked = begun(str(program))
    assert process.wait(60) == -signal.SIGKILL
    assert left_of(marked) == []
