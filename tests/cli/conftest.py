"""Commands in this process: one of its own takes seconds to load all that they need."""

from contextlib import chdir
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from auvid_cli.cli.app import app


@pytest.fixture(autouse=True)
def in_this_process(walked_here) -> None:
    """Commands start no process to go through their files."""


def auvid(*arguments: object, cwd: Path | str = ".") -> Result:
    """Run a command in a folder; what it does not foresee fails the test."""
    with chdir(cwd):
        return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def assert_one_clear_complaint(result: Result, *words: str) -> None:
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("auvid: ")
    for word in words:
        assert word in result.stderr
