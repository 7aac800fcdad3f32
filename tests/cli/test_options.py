"""What short options stand for."""

from pathlib import Path

import pytest
import typer
import yaml
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from auvid_cli.cli.options import OutputOptions, TerminalOptions, command, dataset_path, overrides, spans
from auvid_cli.errors import ConfigError


@pytest.mark.parametrize(
    ("texts", "meant"),
    [
        (["0:80"], [[0, 80]]),
        (["100:"], [[100, None]]),
        ([":80"], [[None, 80]]),
        ([":20", "1 min : 80 s", "1e2:"], [[None, 20], ["1 min", "80 s"], ["1e2", None]]),
    ],
)
def test_a_span_without_an_end_is_null_there(texts, meant):
    assert yaml.safe_load(spans(texts)) == meant


@pytest.mark.parametrize("wrong", ["80", ":", " : ", "", "1:2:3", "::", "a:b", "3 m:"])
def test_what_is_no_pair_of_times_is_one_clear_complaint(wrong):
    with pytest.raises(ConfigError, match=r"--use .*: expected BEGIN:END in seconds, such as 0:80") as complaint:
        spans(["0:1", wrong])
    assert str(complaint.value).startswith(f"--use {wrong}: ")


def test_a_results_folder_is_not_called_like_a_dataset(tmp_path):
    result = CliRunner().invoke(app, ["simulate", "spiral", "-o", str(tmp_path / "dive.h5")])
    assert result.exit_code == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", ["30:10", "1 min:60"])
def test_a_span_ends_after_it_begins(wrong):
    with pytest.raises(ConfigError, match=f"--use {wrong}: ends before it begins"):
        spans([wrong])


def test_short_options_come_after_the_settings_that_they_override():
    merged = overrides(["name=a", "seed=1"], seed=7, use=["3:"])
    assert merged == ("name=a", "seed=1", "seed=7", "identification.use.spans=[[3, null]]")
    assert overrides(None) == ()


def test_a_log_that_is_no_dataset_yet_is_sent_to_import():
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
def test_every_command_that_takes_a_dataset_sends_a_log_to_import(command):
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
