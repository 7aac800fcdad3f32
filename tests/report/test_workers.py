"""Processes that draw."""

import multiprocessing
import os
from multiprocessing import forkserver

import pytest

from auvid_cli.errors import FileError
from auvid_cli.report.figures.workers import LONG_DATA, figure_workers


def test_a_killed_worker_is_reported_in_plain_words():
    with pytest.raises(FileError, match=r"figures.*killed"), figure_workers() as submit:
        submit(os._exit, 1).result()


@pytest.mark.skipif("forkserver" not in multiprocessing.get_all_start_methods(), reason="no fork server here")
@pytest.mark.parametrize(("duration", "n_started"), [(LONG_DATA, 1), (LONG_DATA + 1.0, 0)])
def test_the_server_of_long_data_starts_with_the_first_figure(monkeypatch, duration, n_started):
    started = []
    monkeypatch.setattr(forkserver, "ensure_running", lambda: started.append(1))

    with figure_workers(duration) as submit:
        assert len(started) == n_started
        monkeypatch.undo()
        assert submit(abs, -3).result() == 3
