"""Shared options."""

from pathlib import Path

import pytest
import typer
import yaml
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from auvid_cli.cli.options import OutputOptions, TerminalOptions, command, dataset_path, fit_command, overrides, spans
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.errors import ConfigError


def test_command_of_a_fit_uses_the_same_part_of_the_data():
    settings = load_experiment(find_experiment(None), ["identification.use.spans=[[0, 80.5], [90, null]]"])
    words = fit_command(Path("results/my run"), settings).split(" --use=")
    dataset, folder = Path("results/my run/dataset.h5"), Path("results/my run/fit")
    assert words == [f"auvid fit '{dataset}'", "0:80.5", f"90: -o '{folder}'"]
    assert fit_command(Path("results"), None) == f"auvid fit {Path('results/dataset.h5')} -o {Path('results/fit')}"


@pytest.mark.parametrize(
    ("texts", "meant"),
    [
        (["0:80"], [[0, 80]]),
        (["100:"], [[100, None]]),
        ([":80"], [[None, 80]]),
        ([":20", "1 min : 80 s", "1e2:"], [[None, 20], ["1 min", "80 s"], ["1e2", None]]),
    ],
)
def test_open_span_has_null(texts, meant):
    assert yaml.safe_load(spans(texts)) == meant


@pytest.mark.parametrize("wrong", ["80", ":", " : ", "", "1:2:3", "::", "a:b", "3 m:"])
def test_invalid_span_is_an_error(wrong):
    with pytest.raises(ConfigError, match=r"--use .*: expected BEGIN:END") as complaint:
        spans(["0:1", wrong])
    assert str(complaint.value).startswith(f"--use {wrong}: ")


def test_results_folder_with_name_of_dataset_is_refused(tmp_path):
    result = CliRunner().invoke(app, ["simulate", "spiral", "-o", str(tmp_path / "dive.h5")])
    assert result.exit_code == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", ["30:10", "1 min:60"])
def test_span_that_ends_before_it_begins_is_refused(wrong):
    with pytest.raises(ConfigError, match=f"--use {wrong}: END must be later"):
        spans([wrong])


def test_seed_and_use_override_settings():
    merged = overrides(["name=a", "seed=1"], seed=7, use=["3:"])
    assert merged == ("name=a", "seed=1", "seed=7", "identification.use.spans=[[3, null]]")
    assert overrides(None) == ()


def test_log_instead_of_dataset_advises_import():
    with pytest.raises(ConfigError, match=r"auvid import --suggest lake/dive\.csv -o map\.yaml"):
        dataset_path("lake/dive.csv")


@pytest.mark.parametrize(
    "command",
    [
        "run dive.csv",
        "simulate dive.csv",
        "design dive.csv",
        "inspect dive.csv",
        "tune dive.csv",
        "terms dive.csv",
        "validate ckf.h5 dive.csv",
        "design remus100 --given dive.csv",
        "export ckf.h5 --to mcap --dataset dive.csv",
    ],
)
def test_every_command_with_a_dataset_refuses_logs(command):
    result = CliRunner().invoke(app, command.split())
    assert result.exit_code == 2
    assert "auvid import --suggest dive.csv -o map.yaml" in result.output


def test_command_gets_option_groups_and_returns_exit_code():
    given = []

    @command
    def show(*, output: OutputOptions, console: TerminalOptions) -> int:
        given.extend([output, console])
        return 1

    single = typer.Typer()
    single.command()(show)
    assert CliRunner().invoke(single, ["-o", "lake", "--quiet"]).exit_code == 1
    assert given == [OutputOptions(Path("lake")), TerminalOptions(quiet=True)]
