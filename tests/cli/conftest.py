"""Commands run in the test process, because a new process takes seconds to start."""

import os
import subprocess
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


def run_among_traps(folder: Path, *arguments: str) -> tuple[subprocess.CompletedProcess[str], str]:
    """Run auvid in a folder full of modules that note that they were executed; return the process and their names."""
    for name in _TRAPS:
        (folder / f"{name}.py").write_text(f"open({str(folder / 'executed')!r}, 'a').write({name!r} + ' ')\n")
    command = [PROGRAM, *arguments]
    ended = subprocess.run(command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=300)
    assert ended.returncode in (0, 1), ended.stderr
    assert "Traceback" not in ended.stderr
    noted = folder / "executed"
    return ended, noted.read_text() if noted.exists() else ""
