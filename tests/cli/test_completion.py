"""Completion in bash."""

import importlib.util
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from auvid_cli.config.loading import dump_experiment, find_experiment, load_experiment

ROOT = Path(__file__).parents[2]
KEYS = (ROOT / "auvid_cli/cli/setting_keys.txt").read_text(encoding="utf-8").split()


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("lake.yaml", "sea.yml", "dive.h5", "spiral_notes.txt"):
        Path(name).touch()


def offered(line: str) -> list[str]:
    """Return the completions of the last word of a line."""
    words = line.split(" ")
    environment = {
        "_AUVID_COMPLETE": "complete_bash",
        "COMP_WORDS": "\n".join(words),
        "COMP_CWORD": str(len(words) - 1),
    }
    return CliRunner().invoke(app, [], prog_name="auvid", env=environment).stdout.split()


@pytest.mark.parametrize(
    ("line", "offers"),
    [
        ("auvid run sp", ["spiral"]),
        ("auvid run --filter ckf l", ["lauv", "lrauv", "lake.yaml"]),
        ("auvid identify di", ["dive", "dive.h5"]),
        ("auvid simulate se", ["sea.yml"]),
        ("auvid campaign reg", ["regimes"]),
        ("auvid run --set sensors.dvl.ra", ["sensors.dvl.range=", "sensors.dvl.rate="]),
        ("auvid tune dive.h5 --set identification.process_noise.v", ["identification.process_noise.velocity="]),
        ("auvid run --set la", ["lake.yaml"]),
        # The shell completes file names.
        ("auvid run elsewhere/", []),
    ],
)
def test_experiments_files_and_keys_are_offered(line, offers):
    assert offered(line) == offers


@pytest.mark.parametrize("name", ["spiral", "field", "lauv"])
def test_every_setting_that_an_experiment_gives_has_a_key(name):
    given = yaml.safe_load(dump_experiment(load_experiment(find_experiment(name))))
    assert {*leaves("", given)} <= {*KEYS}


def leaves(path: str, given: dict):
    for key, value in given.items():
        place = f"{path}.{key}".lstrip(".")
        if isinstance(value, dict) and "value" not in value:
            yield from leaves(place, value)
        elif "|" not in place:
            yield place


def test_the_keys_are_those_of_the_settings_classes():
    spec = importlib.util.spec_from_file_location("make_reference", ROOT / "docs/make_reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.setting_keys().split() == KEYS, "python docs/make_reference.py"
