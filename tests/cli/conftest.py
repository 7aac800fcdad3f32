"""Commands run in the test process, because a new process takes seconds to start."""

from contextlib import chdir
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from auvid_cli.cli.app import app


@pytest.fixture(autouse=True)
def in_this_process(walked_here) -> None:
    """Check files in this process."""


def auvid(*arguments: object, cwd: Path | str = ".") -> Result:
    """Run a command in a folder; an unexpected exception fails the test."""
    with chdir(cwd):
        return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def assert_one_clear_complaint(result: Result, *words: str) -> None:
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("auvid: ")
    for word in words:
        assert word in result.stderr
