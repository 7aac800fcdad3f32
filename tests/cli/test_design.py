"""`auvid design`."""

import json
import re
import shutil

import pytest
from distributed import LocalCluster

from auvid_cli.api import design as api
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset_file import write_dataset
from auvid_cli.simulation.simulate import simulate

from .conftest import assert_one_clear_complaint, auvid

QUICK = "remus100", "--duration", "20 s", "--draws", "1", "--generations", "1"
FILES = {"manoeuvre.yaml", "inputs.csv", "track.geojson", "timeline.md", "checklist.md", "result.md", "search.json"}


@pytest.fixture(autouse=True)
def quick(without_figures):
    """Figures are drawn in a test of their own."""


@pytest.fixture(scope="module")
def designed(tmp_path_factory, leave_figures_out):
    """Folder with a finished quick design in `mission`, and what the command printed; to be copied."""
    folder = tmp_path_factory.mktemp("designed")
    with pytest.MonkeyPatch.context() as patch:
        leave_figures_out(patch)
        result = auvid("design", *QUICK, cwd=folder)
    assert result.exit_code == 0, result.output
    return folder, result.stdout


@pytest.mark.slow
def test_design_writes_mission_files_and_gain(tmp_path):
    result = auvid("design", *QUICK, "--spread", "10 %", cwd=tmp_path)
    assert result.exit_code == 0, result.output
    assert "REMUS 100: 1 trial vehicles drawn from the vehicle file's values (standard deviation 10 %)" in result.stdout
    assert all(name in result.stdout for name in ("designed", "spiral", "doublets", "zigzag"))
    assert {path.name for path in (tmp_path / "mission").glob("[!.]*.*")} == FILES
    assert "next: auvid run remus100 --set" in result.stdout
    assert (tmp_path / "mission/result.md").read_text(encoding="utf-8").count("\n- ") >= 3
    manoeuvre = f"manoeuvre={tmp_path}/mission/manoeuvre.yaml"
    assert load_experiment(find_experiment("remus100"), [manoeuvre]).manoeuvre.duration == 20.0
    again = auvid("design", *QUICK, cwd=tmp_path)
    assert_one_clear_complaint(again, "manoeuvre.yaml: exists already", "--overwrite")


@pytest.mark.slow
def test_interrupt_keeps_best_manoeuvre(tmp_path, monkeypatch):
    search = api.searching

    def interrupted(task, before):
        yield next(search(task, before))
        raise KeyboardInterrupt

    monkeypatch.setattr(api, "searching", interrupted)
    result = auvid("design", *QUICK[:-2], cwd=tmp_path)
    assert result.exit_code == 0, result.output
    assert "interrupted: " in result.stdout
    assert (tmp_path / "mission/manoeuvre.yaml").is_file()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--box", "3 deg"), ("--box: expected a length such as",)),
        (
            ("--roll", "-3 deg", "--depth", "0 m"),
            ("--roll -3 deg: must be greater than 0", "--depth 0 m: must be greater than 0"),
        ),
        (("--pitch", "89 deg"), ("--pitch 89 deg: must be less than 1.48 rad",)),
        (("--speed", "2 m/s"), ("lower --speed",)),
        (("--fins", "100 deg"), ("--fins 100 deg: must be larger than 0",)),
        (("--budget", "soon"), ("--budget: expected a time",)),
        (("--criterion", "A"), ("--criterion A: expected D or worst",)),
        (("--origin", "here"), ("--origin here: expected latitude and longitude",)),
        (("--for", "N_x"), ("--for N_x: not estimated",)),
        (("--box", "5 m", "--generations", "1"), ("relax --box",)),
        (("--at", "nowhere.h5"), ("nowhere.h5",)),
        (("--given", "nowhere.h5"), ("nowhere.h5",)),
        (("--energy", "3 m"), ("--energy: expected an energy such as '20 kJ'",)),
        (("--energy", "1 J", "--generations", "1"), ("relax --energy", "kJ'")),
    ],
)
def test_invalid_limit_is_one_line_with_its_option(options, words, tmp_path):
    result = auvid("design", "remus100", "--duration", "20 s", "--draws", "1", *options, cwd=tmp_path)
    assert_one_clear_complaint(result, *words)
    assert not (tmp_path / "mission/manoeuvre.yaml").exists()
    # The same command with other limits, as the message advises, must not be refused.
    assert not (tmp_path / "mission/search.json").exists()


@pytest.mark.slow
def test_same_command_continues_search_and_other_settings_are_refused(designed, tmp_path):
    shutil.copytree(designed[0], tmp_path, dirs_exist_ok=True)
    further = auvid("design", *QUICK[:-1], "2", "--overwrite", cwd=tmp_path)
    assert further.exit_code == 0, further.output
    assert "continues after 1 generations" in further.stdout
    state = tmp_path / "mission/search.json"
    assert len(json.loads(state.read_text())["costs"]) == 2
    for path in (tmp_path / "mission").iterdir():
        if path.is_file() and path != state:
            path.unlink()
    other = auvid("design", *QUICK, "--seed", "5", cwd=tmp_path)
    assert_one_clear_complaint(other, "search.json: belongs to a search with other settings", "--overwrite")
    state.write_text('{"kind": "auvid design search", "costs": [[1], []]}')
    assert_one_clear_complaint(auvid("design", *QUICK, cwd=tmp_path), "search.json: damaged")


@pytest.mark.slow
def test_given_dataset_adds_its_information(designed, tmp_path):
    write_dataset(tmp_path / "dive.h5", simulate(remus("manoeuvre.duration=30 s")))
    informed = auvid("design", *QUICK, "--given", "dive.h5", "--output", "second", cwd=tmp_path)
    assert informed.exit_code == 0, informed.output
    assert "information already available: dive.h5" in informed.stdout
    means = [float(re.search(r"vehicle: ([\d.]+) % after 5 s", text)[1]) for text in (designed[1], informed.stdout)]
    assert means[1] < 0.7 * means[0]
    write_dataset(
        tmp_path / "few.h5", simulate(remus("manoeuvre.duration=5 s", "identification.coefficients=[N_uudr]"))
    )
    refused = auvid("design", *QUICK, "--given", "few.h5", "--output", "third", cwd=tmp_path)
    assert_one_clear_complaint(refused, "--given few.h5: keeps X_u|u|", "identification.coefficients")


def remus(*overrides):
    return load_experiment(find_experiment("remus100"), overrides)


@pytest.mark.slow
def test_dask_scheduler_gives_same_design(designed, tmp_path):
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        scheduler = "--scheduler", cluster.scheduler_address
        there = auvid("design", *QUICK, "--output", "there", *scheduler, cwd=tmp_path)
    assert there.exit_code == 0, there.output
    texts = [(folder / "manoeuvre.yaml").read_text() for folder in (designed[0] / "mission", tmp_path / "there")]
    assert texts[0] == texts[1]


@pytest.mark.slow
def test_design_lists_what_it_does_not_include(tmp_path):
    settings = "--set", "identification.attitude_from=inertial", "--set", "identification.estimate.biases=[current]"
    result = auvid("design", *QUICK, *settings, cwd=tmp_path)
    assert result.exit_code == 0, result.output
    assert "note: not included in the design: estimated errors (current)" in result.stdout
    assert "note: not included in the design: raw inertial sensors (the attitude counts instead)" in result.stdout
