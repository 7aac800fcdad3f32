"""Child processes, with and without what only POSIX and only Linux offer."""

import operator
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from auvid_cli.child_processes import WorkerDied, Workers, starting_children

KILLED_PARENT = """
import multiprocessing, os, signal, sys, time
from auvid_cli.child_processes import starting_children
with starting_children():
    multiprocessing.get_context("spawn").Process(target=exec, args=(sys.argv[1], {})).start()
time.sleep(0.5)
os.kill(os.getpid(), signal.SIGKILL)
"""
CHILD = """
import sys, time
sys.platform = {platform!r}
from auvid_cli.child_processes import end_with_parent
end_with_parent()
time.sleep(60)
"""
UNGUARDED = """
import os
from auvid_cli.child_processes import Workers
with Workers(1) as workers:
    print(os.getpid() != workers.submit(os.getpid).result())
"""


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.parametrize("platform", [sys.platform, "another"])
def test_child_ends_with_killed_parent(platform):
    # Its output ends when the last process that has it has ended.
    command = [sys.executable, "-c", KILLED_PARENT, CHILD.format(platform=platform)]
    assert subprocess.run(command, stdout=subprocess.PIPE, timeout=30, check=False).returncode == -signal.SIGKILL


def test_script_is_not_run_again_by_workers(tmp_path):
    (tmp_path / "script.py").write_text(UNGUARDED)
    output = subprocess.run([sys.executable, tmp_path / "script.py"], capture_output=True, text=True, check=True).stdout
    assert output.split() == ["True"]


@pytest.mark.parametrize("can_block", [True, False])
def test_ctrl_c_is_blocked_where_that_is_possible(can_block, monkeypatch):
    if not can_block:
        monkeypatch.delattr(signal, "pthread_sigmask", raising=False)
    code = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))"
    with starting_children():
        output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert output.strip() == str(can_block)


def test_worker_has_a_safe_path_and_the_environment_stays_as_it_was(monkeypatch):
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    before = dict(os.environ)
    with Workers(1) as workers:
        assert workers.submit(os.getenv, "PYTHONSAFEPATH").result() == "1"
        assert workers.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN
        assert dict(os.environ) == before


def test_error_in_a_worker_is_raised_and_the_worker_kept():
    with Workers(1) as workers:
        process = workers.submit(os.getpid).result()
        with pytest.raises(ValueError, match="word"):
            workers.submit(int, "word").result()
        # Its result cannot be sent.
        with pytest.raises(TypeError):
            workers.submit(threading.Lock).result()
        assert workers.submit(os.getpid).result() == process


@pytest.mark.slow
@pytest.mark.parametrize("layout", [lambda a: a, np.transpose, lambda a: a[:, 1:3], lambda a: a[:0]])
def test_arrays_reach_a_worker_unchanged(layout):
    array = layout(np.arange(12.0).reshape(3, 4))
    with Workers(1) as workers:
        np.testing.assert_array_equal(workers.submit(operator.itemgetter(0), [array]).result(), array)


def test_worker_that_dies_is_replaced():
    with Workers(1, attempts=2) as workers:
        process = workers.submit(os.getpid).result()
        with pytest.raises(WorkerDied):
            workers.submit(os._exit, 0).result()
        assert workers.submit(os.getpid).result() != process


def interrupted_while_busy():
    with Workers(1) as workers:
        workers.submit(os.getpid).result()
        busy = workers.submit(time.sleep, 60.0)
        while not busy.running():
            time.sleep(0.01)
        raise KeyboardInterrupt


def test_exception_kills_busy_workers():
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted_while_busy()
    assert time.monotonic() - start < 30.0


@pytest.mark.slow
def test_figure_server_loads_without_priorities():
    code = "import os; vars(os).pop('nice', None); import auvid_cli.report.figures.server"
    subprocess.run([sys.executable, "-c", code], check=True)
