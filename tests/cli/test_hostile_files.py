"""Every command that reads data files refuses impossible data with one line, and writes nothing."""

import shutil

import h5py
import pytest
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import write_estimate
from auvid_cli.identification.run import identify


@pytest.fixture(scope="module")
def results(simulated_with, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    write_dataset(folder / "dataset.h5", simulated_with("manoeuvre.duration=2 s"))
    estimate = identify(read_dataset(folder / "dataset.h5"), FilterName.TUKF)
    write_estimate(folder / "estimates/tukf.h5", estimate)
    return folder


def elsewhere(file):
    file.attrs["filter"] = "../../../x"


def complex_times(file):
    times = file["inputs/time"][...]
    del file["inputs/time"]
    file["inputs/time"] = times + 1j


def looped(file):
    del file["inputs"]
    file["inputs"] = h5py.SoftLink("/inputs")


def files(folder):
    return sorted(path for path in folder.rglob("*") if path.name != ".lock")


ESTIMATE, DATASET = "estimates/tukf.h5", "dataset.h5"


@pytest.mark.parametrize(
    ("command", "harmed", "harm"),
    [
        *((["identify", DATASET], DATASET, harm) for harm in (complex_times, looped)),
        (["inspect", DATASET], DATASET, complex_times),
        (["identifiability", DATASET, "--at", ESTIMATE], ESTIMATE, elsewhere),
        (["report", "."], ESTIMATE, elsewhere),
        (["report", "."], DATASET, looped),
        (["check", "."], ESTIMATE, elsewhere),
        (["validate", ESTIMATE, DATASET], ESTIMATE, elsewhere),
        (["export", ESTIMATE, "--to", "python"], ESTIMATE, elsewhere),
    ],
)
def test_hostile_file_is_one_line(command, harmed, harm, results, tmp_path, monkeypatch):
    folder = shutil.copytree(results, tmp_path / "a/b/c/results")
    with h5py.File(folder / harmed, "a") as file:
        harm(file)
    before = files(tmp_path)
    monkeypatch.chdir(folder)
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2
    assert result.stderr.startswith("auvid: ")
    assert result.stderr.count("\n") == 1
    assert harmed in result.stderr
    assert files(tmp_path) == before
