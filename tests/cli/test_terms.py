"""`auvid terms` as a user runs it."""

import csv

import pytest
from typer.testing import CliRunner

from auvid_cli.api.files import read_dataset
from auvid_cli.cli.app import app
from auvid_cli.data.dataset_file import write_dataset

PLANTED = 'vehicle.terms=[{name: "N_|v|r", row: N, factors: ["|v|", r], value: -1500}]'


@pytest.fixture
def run(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    return lambda *arguments: CliRunner().invoke(app, ["terms", *map(str, arguments)])


@pytest.mark.slow
def test_found_term_is_written_for_identify(multisine_with, tmp_path, run):
    file = tmp_path / "dataset.h5"
    write_dataset(file, multisine_with(PLANTED, "manoeuvre.duration=20 s"))
    result = run(file, "--set", "vehicle.terms=[]", "--most", "1")
    assert result.exit_code == 0, result.output
    assert "Found: N_|v|r." in result.output
    advice = result.output.splitlines()[-1]
    assert advice == f"next: auvid identify {file} '--set=vehicle.terms=[]' --set {tmp_path}/terms.yaml"
    (term,) = read_dataset(file, "vehicle.terms=[]", str(tmp_path / "terms.yaml")).experiment.vehicle.terms
    assert (term.name, term.row, term.factors) == ("N_|v|r", "N", ("|v|", "r"))
    with (tmp_path / "tables/terms.csv").open(encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))
    assert [row["term"] for row in rows if row["found"] == "True"] == ["N_|v|r"]
    # Only candidates that were fitted have a gain on the held-out data.
    assert {row["held_out_gain"] == "" for row in rows} == {True, False}


@pytest.mark.slow
def test_complete_model_gives_no_term_and_no_file(multisine_with, tmp_path, run):
    file = tmp_path / "dataset.h5"
    write_dataset(file, multisine_with("manoeuvre.duration=20 s"))
    result = run(file)
    assert result.exit_code == 0, result.output
    assert "No term is proposed" in result.output
    assert not (tmp_path / "terms.yaml").exists()
