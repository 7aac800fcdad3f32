"""Commands run in the test process, because a new process takes seconds to start."""

import os
import sys
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


# The command as pip installs it: Python searches the folder of the program first, not the working folder.
PROGRAM = str(Path(sys.executable).with_name("auvid"))
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
_TRAPS = (
    *("pickle", "signal", "struct", "socket", "random", "tempfile", "copyreg", "json", "logging", "ctypes", "string"),
    *("numpy", "scipy", "h5py", "matplotlib", "numba", "dask", "distributed", "sitecustomize", "usercustomize"),
    "pydantic",
)


def lay_traps(folder: Path) -> None:
    """Fill a folder with modules that note that they were executed."""
    for name in _TRAPS:
        (folder / f"{name}.py").write_text(f"open({str(folder / 'executed')!r}, 'a').write({name!r} + ' ')\n")


def executed_traps(folder: Path) -> str:
    """Return the names of the modules of `lay_traps` that were executed."""
    noted = folder / "executed"
    return noted.read_text() if noted.exists() else ""
