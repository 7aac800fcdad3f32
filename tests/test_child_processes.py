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

from auvid_cli.child_processes import WorkerDied, Workers, start_python
from auvid_cli.data import hdf5

KILLED_PARENT = """
import os, signal, subprocess, sys, time
from auvid_cli.child_processes import start_python
with start_python("-c", sys.argv[1], stdin=subprocess.PIPE, stdout=None) as child:
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


def output_of(*arguments: str) -> str:
    with start_python(*arguments, stdout=subprocess.PIPE) as process:
        return process.communicate()[0].decode().strip()


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.parametrize("platform", [sys.platform, "another"])
def test_child_ends_with_killed_parent(platform):
    # Its output ends when the last process that has it has ended.
    command = [sys.executable, "-c", KILLED_PARENT, CHILD.format(platform=platform)]
    assert subprocess.run(command, stdout=subprocess.PIPE, timeout=30, check=False).returncode == -signal.SIGKILL


@pytest.mark.parametrize("can_block", [True, False])
def test_ctrl_c_is_blocked_where_that_is_possible(can_block, monkeypatch):
    if not can_block:
        monkeypatch.delattr(signal, "pthread_sigmask", raising=False)
    code = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))"
    assert output_of("-c", code) == str(can_block)


def test_worker_has_a_safe_path_and_the_environment_stays_as_it_was(monkeypatch):
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    before = dict(os.environ)
    with Workers(1, "spawn") as workers:
        assert workers.submit(os.getenv, "PYTHONSAFEPATH").result() == "1"
        assert workers.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN
        assert dict(os.environ) == before


def test_error_in_a_worker_is_raised_and_the_worker_kept():
    with Workers(1, "spawn") as workers:
        process = workers.submit(os.getpid).result()
        with pytest.raises(ValueError, match="word"):
            workers.submit(int, "word").result()
        # Its result cannot be sent.
        with pytest.raises(TypeError):
            workers.submit(threading.Lock).result()
        assert workers.submit(os.getpid).result() == process


@pytest.mark.parametrize("layout", [lambda a: a, np.transpose, lambda a: a[:, 1:3], lambda a: a[:0]])
def test_arrays_reach_a_worker_unchanged(layout):
    array = layout(np.arange(12.0).reshape(3, 4))
    with Workers(1, "spawn") as workers:
        np.testing.assert_array_equal(workers.submit(operator.itemgetter(0), [array]).result(), array)


def test_worker_that_dies_is_replaced():
    with Workers(1, "spawn", attempts=2) as workers:
        process = workers.submit(os.getpid).result()
        with pytest.raises(WorkerDied):
            workers.submit(os._exit, 0).result()
        assert workers.submit(os.getpid).result() != process


def interrupted_while_busy():
    with Workers(1, "spawn") as workers:
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
    code = "import os; vars(os).pop('nice', None); import auvid_cli.report.figures.server; print('loaded')"
    assert output_of("-c", code) == "loaded"


@pytest.mark.slow
def test_scan_works_without_alarms(tmp_path):
    (tmp_path / "a.h5").write_text("no HDF5")
    code = "import signal; vars(signal).pop('alarm', None); from auvid_cli.data.hdf5 import main; main()"
    assert output_of("-c", code, "10", "0", str(tmp_path / "a.h5"))
    assert hdf5.scan_in_child([tmp_path / "a.h5"]) == [output_of("-c", code, "10", "0", str(tmp_path / "a.h5"))]
