"""`auvid fit` as a user runs it."""

import csv
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from auvid_cli.cli.data import fit
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset_file import write_dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.simulation.field_log import field_log
from auvid_cli.simulation.simulate import simulate


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


def test_results_folder_stands_for_its_dataset(simulated_with, tmp_path, run, monkeypatch):
    received = []
    monkeypatch.setattr("auvid_cli.api.analysis.fit_into", lambda place, source, *rest: received.append(source))
    monkeypatch.setattr("auvid_cli.cli.data.print_fit", lambda result, terminal: 0)
    write_dataset(tmp_path / "dataset.h5", simulated_with("manoeuvre.duration=2 s"))
    assert run(tmp_path).exit_code == 0
    assert [source.path for source in received] == [tmp_path / "dataset.h5"]
    identified = CliRunner().invoke(app, ["identify", str(tmp_path), "--dry-run", "--set", "seed=no"])
    assert identified.exit_code == 2
    assert "experiment.yaml" not in identified.output


@pytest.fixture
def survey(tmp_path, monkeypatch):
    """Logs of a short survey with their map in `field/`, in the working folder."""
    monkeypatch.chdir(tmp_path)
    run = simulate(load_experiment(find_experiment("field"), ("manoeuvre.duration=20 s",)))
    (tmp_path / "field").mkdir()
    for name, text in field_log(run).items():
        (tmp_path / "field" / name).write_text(text, encoding="utf-8")
    return Path("field")


def test_logs_are_imported_in_any_order_with_the_map_next_to_them(survey, run, monkeypatch):
    received = []
    monkeypatch.setattr("auvid_cli.api.analysis.fit_into", lambda place, source, *rest: received.append(source))
    monkeypatch.setattr("auvid_cli.cli.data.print_fit", lambda result, terminal: 0)
    result = run(*sorted(survey.glob("*.csv")), "--set", "identification.prior.relative=20 %")
    assert result.exit_code == 0, result.output
    (source,) = received
    assert source.path == Path("results/survey/dataset.h5")
    assert sorted(source.dataset.sensors) == ["attitude", "depth", "dvl"]
    assert source.dataset.experiment.identification.prior.relative == 0.2
    (survey / "map.yaml").rename("other.yaml")
    missing = run(*survey.glob("*.csv"))
    assert missing.exit_code == 2
    assert "auvid import --suggest" in missing.output


def test_dataset_among_logs_is_refused(survey, run):
    result = run(survey / "dvl.csv", "dataset.h5")
    assert result.exit_code == 2
    assert "dataset.h5: expected one dataset" in result.output


def test_run_with_fit_simulates_and_searches(tmp_path, monkeypatch):
    received = []
    monkeypatch.setattr("auvid_cli.api.analysis.fit_into", lambda place, source, *rest: received.append(source))
    monkeypatch.setattr("auvid_cli.cli.data.print_fit", lambda result, terminal: 1)
    arguments = ["run", "--fit", "--set", "manoeuvre.duration=5 s", "-o", str(tmp_path)]
    assert CliRunner().invoke(app, arguments).exit_code == 1
    (source,) = received
    assert source.path == tmp_path / "dataset.h5"
    both = CliRunner().invoke(app, [*arguments, "--filter", "ckf"])
    assert both.exit_code == 2
    assert "--filter" in both.output


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


@pytest.mark.slow
def test_search_may_be_repeated_but_does_not_replace_another_estimate(multisine_with, tmp_path, run):
    write_dataset(tmp_path / "dataset.h5", multisine_with("manoeuvre.fin_trim.rudder=1 deg"))
    first = run(tmp_path / "dataset.h5", "--only", "current")
    assert first.exit_code == 1, first.output
    again = run(tmp_path / "dataset.h5", "--only", "fin_trim")
    assert again.exit_code == 0, again.output
    assert "trim of the fins" in again.output
    assert "N_uudr" in again.output  # the coefficients are the first thing that it prints
    other = run(tmp_path / "dataset.h5", "--use", "0:20")
    assert other.exit_code == 2
    assert "other settings of `identification`" in other.output
    (tmp_path / "fit.yaml").unlink()
    unknown = run(tmp_path / "dataset.h5")
    assert unknown.exit_code == 2
    assert "--overwrite" in unknown.output
