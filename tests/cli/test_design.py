"""`auvid design`."""

import pytest

from auvid_cli.api import design as api
from auvid_cli.config.load import find_experiment, load_experiment

from .conftest import assert_one_clear_complaint, auvid

QUICK = "remus100", "--duration", "20 s", "--draws", "1", "--generations", "1"
FILES = {"manoeuvre.yaml", "inputs.csv", "track.geojson", "timeline.md", "checklist.md", "result.md"}


@pytest.fixture(autouse=True)
def quick(without_figures):
    """Figures are drawn in a test of their own."""


def test_a_crew_gets_its_files_and_reads_how_good_the_run_is(tmp_path):
    result = auvid("design", *QUICK, "--spread", "10 %", cwd=tmp_path)
    assert result.exit_code == 0, result.output
    assert "REMUS 100: 1 drawn from 10% of the vehicle file's values" in result.stdout
    assert all(name in result.stdout for name in ("designed", "spiral", "doublets", "zigzag"))
    assert {path.name for path in (tmp_path / "mission").glob("*.*")} == FILES
    assert (tmp_path / "mission/result.md").read_text(encoding="utf-8").count("\n- ") >= 3
    manoeuvre = f"manoeuvre={tmp_path}/mission/manoeuvre.yaml"
    assert load_experiment(find_experiment("remus100"), [manoeuvre]).manoeuvre.duration == 20.0
    again = auvid("design", *QUICK, cwd=tmp_path)
    assert_one_clear_complaint(again, "manoeuvre.yaml is there already", "--overwrite")


def test_an_interrupt_keeps_the_best_so_far(tmp_path, monkeypatch):
    search = api.searching

    def interrupted(task):
        yield next(search(task))
        raise KeyboardInterrupt

    monkeypatch.setattr(api, "searching", interrupted)
    result = auvid("design", *QUICK[:-2], cwd=tmp_path)
    assert result.exit_code == 0, result.output
    assert "interrupted: the best so far is kept" in result.stdout
    assert (tmp_path / "mission/manoeuvre.yaml").is_file()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--box", "3 deg"), ("--box: expected a length such as",)),
        (("--roll", "-3 deg", "--depth", "0 m"), ("--roll: ", "--depth: ")),
        (("--speed", "2 m/s"), ("lower --speed",)),
        (("--fins", "100 deg"), ("--fins 100 deg: expected more than 0 and below 1.6 rad",)),
        (("--budget", "soon"), ("--budget: expected a time",)),
        (("--criterion", "A"), ("--criterion A: expected D or worst",)),
        (("--origin", "here"), ("--origin here: expected latitude and longitude",)),
        (("--for", "N_x"), ("--for N_x: is not estimated",)),
        (("--box", "5 m", "--generations", "1"), ("relax --box",)),
        (("--at", "nowhere.h5"), ("nowhere.h5",)),
    ],
)
def test_what_cannot_be_is_one_line_that_names_the_option(options, words, tmp_path):
    result = auvid("design", "remus100", "--duration", "20 s", "--draws", "1", *options, cwd=tmp_path)
    assert_one_clear_complaint(result, *words)
    assert not (tmp_path / "mission/manoeuvre.yaml").exists()


def test_what_a_filter_would_use_besides_is_said_not_to_count(tmp_path):
    settings = "--set", "identification.attitude_from=inertial", "--set", "identification.estimate.biases=[current]"
    result = auvid("design", *QUICK, *settings, cwd=tmp_path)
    assert result.exit_code == 0, result.output
    assert "note: not counted: estimated errors (current)" in result.stdout
    assert "note: not counted: raw inertial sensors, in place of which the attitude counts" in result.stdout
