"""Processes that draw."""

import os

import pytest

from auvid_cli.errors import FileError
from auvid_cli.report.figures.workers import figure_workers


def test_a_killed_worker_is_reported_in_plain_words():
    with pytest.raises(FileError, match=r"figures.*killed"), figure_workers() as submit:
        submit(os._exit, 1).result()
