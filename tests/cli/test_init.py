"""`auvid init`, and what can be done with the folder that it makes."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from auvid_cli.api.files import read_dataset
from auvid_cli.cli import start
from auvid_cli.cli.app import app
from auvid_cli.cli.start import joined
from auvid_cli.data.dataset import Dataset

from .conftest import assert_one_clear_complaint, auvid

FILES = {"vehicle.yaml", "sensors.yaml", "experiment.yaml", "map.yaml", "README.md"}
MINE = ("--length", "2", "m", "--diameter", ".2", "m", "--mass", "60kg", "--fin-span", "0.1 m", "--fin-area", "0.012")


@pytest.fixture(autouse=True)
def quick(without_figures):
    """Draw no figures."""


@pytest.mark.slow
def test_folder_from_outline_runs_without_an_edit(tmp_path):
    made = auvid("init", "mine", *MINE, cwd=tmp_path)
    assert made.exit_code == 0, made.output
    assert made.stdout.splitlines()[-1] == "next: auvid run mine"
    assert "water displaced by the hull" in made.stdout
    assert "assumed: --fin-position 1.88 m, --fins 4, --tail +, " in made.stdout
    assert {path.name for path in (tmp_path / "mine").iterdir()} == FILES
    short = (
        "--set",
        "manoeuvre.duration=40 s",
        "--set",
        "identification.filters=[ckf]",
        "--set",
        "identification.judge=false",
    )
    result = auvid("run", "mine", *short, cwd=tmp_path)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "results/mine/estimates/ckf.h5").is_file()
    # A log of the same vehicle, with the names of the map.
    write_log(read_dataset(tmp_path / "results/mine/dataset.h5"), tmp_path / "dive.csv")
    imported = auvid("import", "dive.csv", "--map", "mine/map.yaml", cwd=tmp_path)
    assert imported.exit_code == 0, imported.output
    assert {*read_dataset(tmp_path / "results/mine_dive/dataset.h5").sensors} == {
        "gyroscope",
        "attitude",
        "dvl",
        "depth",
    }


def write_log(dataset: Dataset, path: Path) -> None:
    """Write one row per sample of the DVL, the slowest sensor, in the columns of the map of a first folder."""
    time = dataset.sensors["dvl"].time

    def at_these(name: str) -> np.ndarray:
        record = dataset.sensors[name]
        return record.values[np.searchsorted(record.time, time - 1e-9)]

    rudder, elevator = np.rad2deg(dataset.inputs.values[np.searchsorted(dataset.inputs.time, time - 1e-9), :2].T)
    columns = np.column_stack(
        [
            time,
            *np.rad2deg(at_these("gyroscope")).T,
            *np.rad2deg(at_these("attitude")).T,
            *at_these("dvl").T,
            *at_these("depth").T,
            rudder,
            elevator,
            np.full(time.size, 1500.0),
        ]
    )
    names = "time,p,q,r,roll,pitch,heading,u,v,w,depth,rudder,elevator,revolutions"
    np.savetxt(path, columns, "%.9g", ",", header=names, comments="")


def test_a_folder_that_is_not_empty_stays_as_it_is(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/notes.txt").write_text("mine")
    complaint = auvid("init", "mine", "--like", "lauv", cwd=tmp_path)
    assert_one_clear_complaint(complaint, "mine: exists already, and is not empty; name another place")
    assert [path.name for path in tmp_path.rglob("*")] == ["mine", "notes.txt"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), ("missing --length, --diameter, --mass, --fin-span, --fin-area; ", "--like remus100")),
        (MINE[:6], ("missing --mass, --fin-span, --fin-area; ",)),
        ((*MINE[:6], "--mass", "180 kg", *MINE[-4:]), ("mass: 180 kg is 3.3 times the ",)),
        (("--length", "0", "m", *MINE[3:]), ("--length 0 m: length: must be greater than 0",)),
        (("--like", "remus"), ("--like remus: no such vehicle ships",)),
        (
            ("--like", "lauv", "--mass", "3"),
            (
                "--like lauv: ",
                "--mass",
            ),
        ),
        (("--like", "lauv", "--speed", "fast"), ("--speed: expected a speed such as",)),
        (("--like", "lauv", "--speed", "0"), ("--speed: must be from 0.05 to 50 m/s, got '0'",)),
    ],
)
def test_invalid_option_is_one_line_and_writes_nothing(options, words, tmp_path):
    complaint = auvid("init", "mine", *options, cwd=tmp_path)
    assert_one_clear_complaint(complaint, *words)
    assert len(complaint.stderr.splitlines()) == 1
    assert [*tmp_path.iterdir()] == []


def test_a_number_and_its_unit_may_be_two_words():
    units = {"--length": "m", "--mass": "kg"}
    assert joined(["--length", "2", "m", "mine"], units) == ["--length", "2 m", "mine"]
    assert joined(["--length", "2", "mine"], units) == ["--length", "2", "mine"]
    assert joined(["--length", "2", "kg"], units) == ["--length", "2", "kg"]
    assert joined(["m", "--fins", "4", "m", "--mass", "2e3", "g"], units) == [
        "m",
        "--fins",
        "4",
        "m",
        "--mass",
        "2e3 g",
    ]


def test_missing_values_are_asked_for_on_a_terminal(tmp_path, monkeypatch):
    monkeypatch.setattr(start, "is_interactive", lambda: True)
    command = ["init", str(tmp_path / "mine"), *MINE[:6], "--mass", "60"]
    result = CliRunner().invoke(app, command, input="wide\n10 cm\n-1\n120 cm^2\n", catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert result.output.count("Span of one fin from root to tip, e.g. 10 cm:") == 2
    assert "expected a length such as '0.2 m'" in result.output
    assert "must be larger than 0" in result.output
    assert {path.name for path in (tmp_path / "mine").iterdir()} == FILES


@pytest.mark.slow
def test_a_dialogue_on_a_real_terminal_ends_with_a_folder(tmp_path):
    pty = pytest.importorskip("pty", reason="terminals of Unix")
    ours, theirs = pty.openpty()
    os.write(ours, b"two\n2 m\n200 mm\n60\n0\n10 cm\n120 cm^2\n")
    command = [sys.executable, "-m", "auvid_cli", "init", "mine"]
    with subprocess.Popen(command, cwd=tmp_path, stdin=theirs, stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        output = b"".join(iter(lambda: _read(ours), b"")).decode()
    os.close(ours)
    assert process.returncode == 0, output
    assert "expected a length such as '0.2 m' or a bare number in m, got 'two'" in output
    assert output.count("Span of one fin from root to tip, e.g. 10 cm:") == 2
    assert "next: auvid run mine" in output
    assert {path.name for path in (tmp_path / "mine").iterdir()} == FILES


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:
        # On Linux a closed terminal raises this.
        return b""


def test_missing_answer_writes_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(start, "is_interactive", lambda: True)
    result = CliRunner().invoke(app, ["init", str(tmp_path / "mine")], input="2 m\n", catch_exceptions=False)
    assert result.exit_code == 130
    assert [*tmp_path.iterdir()] == []


def test_missing_values_without_terminal_are_one_error(tmp_path):
    result = CliRunner().invoke(app, ["init", str(tmp_path / "mine")], input="2 m\n", catch_exceptions=False)
    assert_one_clear_complaint(result, "missing --length")
    assert not Path(tmp_path / "mine").exists()
