"""`auvid fit` as a user runs it."""

import csv

import pytest
import typer
from typer.testing import CliRunner

from auvid_cli.cli.fit import fit
from auvid_cli.data.dataset_file import write_dataset
from auvid_cli.data.estimate_file import read_estimate


@pytest.fixture
def run():
    """Function: the command with arguments; its result."""
    alone = typer.Typer()
    alone.command()(fit)
    return lambda *arguments: CliRunner().invoke(alone, [str(argument) for argument in arguments])


@pytest.mark.parametrize(
    ("option", "value", "key"),
    [("--only", "tide", "tide"), ("--max-time", "-1 s", "larger than 0"), ("--max-time", "1 m", "--max-time")],
)
def test_invalid_option_is_refused_in_one_line(simulated_with, tmp_path, run, option, value, key):
    write_dataset(tmp_path / "dataset.h5", simulated_with("manoeuvre.duration=2 s"))
    result = run(tmp_path / "dataset.h5", option, value)
    assert result.exit_code == 2
    assert key in result.output
    assert "Traceback" not in result.output


@pytest.mark.slow
def test_fit_leaves_estimate_settings_steps_and_page(multisine_with, tmp_path, run):
    write_dataset(tmp_path / "dataset.h5", multisine_with())
    result = run(tmp_path / "dataset.h5")
    assert result.exit_code == 0, result.output
    assert "Judgement: sound." in result.output
    assert read_estimate(tmp_path / "estimates/smoother.h5").completed
    assert (tmp_path / "fit.yaml").is_file()
    assert "How this model was found" in (tmp_path / "fit.html").read_text(encoding="utf-8")
    with (tmp_path / "tables/fit_steps.csv").open(encoding="utf-8", newline="") as file:
        assert [row["action"] for row in csv.DictReader(file)] == ["start"]
