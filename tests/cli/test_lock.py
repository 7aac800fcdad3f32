"""Two commands never write into one results folder at the same time."""

import subprocess
import sys
import time

import pytest

from auvid_cli.data import files
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.files import locked

from .conftest import assert_one_clear_complaint, auvid


@pytest.fixture
def impatient(monkeypatch):
    """Commands of this process wait for a lock for a moment instead of a second."""
    monkeypatch.setattr(files, "LOCK_PATIENCE", 0.02)


@pytest.mark.slow
def test_second_of_two_commands_into_one_folder_is_refused(tmp_path, impatient):
    # Long enough that the second command is refused before the first ends.
    long = "simulate", "--set=manoeuvre.duration=900 s", "--seed", "1", "-o", "out"
    command = [sys.executable, "-m", "auvid_cli", *long]
    first = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "out/.lock").exists():
        assert first.poll() is None, first.stderr.read()
        time.sleep(0.01)
    second = auvid("run", "--set=manoeuvre.duration=6 s", "--filter=ckf", "--seed", "2", "-o", "out", cwd=tmp_path)
    _, first_said = first.communicate()
    assert first.returncode == 0, first_said
    assert_one_clear_complaint(second, "auvid: out")
    assert second.stderr.count("\n") == 1
    assert read_dataset(tmp_path / "out/dataset.h5").experiment.seed == 1


def test_command_waits_briefly_for_lock(tmp_path):
    code = """
import sys, time
from pathlib import Path
from auvid_cli.data.files import locked
with locked(Path(sys.argv[1])):
    print(flush=True)
    time.sleep(0.3)
"""
    with subprocess.Popen([sys.executable, "-c", code, tmp_path / "out"], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        result = auvid("simulate", "--set", "manoeuvre.duration=6 s", "-o", "out", cwd=tmp_path)
    assert result.exit_code == 0, result.output


@pytest.mark.posix
def test_killed_command_releases_lock(tmp_path):
    code = """
import os, signal, sys
from pathlib import Path
from auvid_cli.data.files import locked
with locked(Path(sys.argv[1])):
    os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run([sys.executable, "-c", code, tmp_path], check=False)
    with locked(tmp_path):
        pass


@pytest.mark.slow
def test_every_command_that_writes_results_waits_for_its_folder(tmp_path, impatient):
    path = tmp_path / "out/dataset.h5"
    assert auvid("simulate", "--set", "manoeuvre.duration=6 s", "-o", "out", cwd=tmp_path).exit_code == 0
    before = read_dataset(path).sha256
    assert auvid("identify", "out/dataset.h5", "-f", "ckf", cwd=tmp_path).exit_code in (0, 1)
    with locked(tmp_path / "out"):
        export = "export", "out/estimates/ckf.h5", "--to", "yaml"
        assert_one_clear_complaint(auvid(*export, cwd=tmp_path), "another auvid command")
        design = "design", "-o", "out", "--box", "150 m", "--depth", "20 m", "--fins", "14 deg"
        assert_one_clear_complaint(auvid(*design, cwd=tmp_path), "another auvid command")
        for command in ("inspect", "identify", "identifiability", "tune", "terms"):
            assert_one_clear_complaint(auvid(command, "out/dataset.h5", cwd=tmp_path), "another auvid command")
        assert_one_clear_complaint(auvid("report", "out", cwd=tmp_path), "another auvid command")
        assert_one_clear_complaint(
            auvid("simulate", "--seed", "7", "--overwrite", "-o", "out", cwd=tmp_path), "another"
        )
    assert read_dataset(path).sha256 == before
