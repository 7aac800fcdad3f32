"""`auvid campaign`: first run, continued, failed and repeated."""

import os
import signal
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pandas as pd
import pytest

from auvid_cli.api import campaign as api
from auvid_cli.campaign.cluster import Cluster
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS

from .conftest import PROGRAM, assert_one_clear_complaint, auvid, run_among_traps

CAMPAIGN = """\
name: small
settings:
  manoeuvre.duration: 10 s
  manoeuvre.input_rate: 25 Hz
  sensors.attitude.source: direct
  identification.judge: false
seeds: 3
filters: [ckf, tukf]
vary: [{setting: identification.prior.factor, values: [1, 3]}]
"""


def command(*arguments):
    """One worker, which takes seconds to load what it needs, is as good as several."""
    return [PROGRAM, "campaign", "--workers", "1", *map(str, arguments)]


def campaign(*arguments, cwd):
    return auvid("campaign", *arguments, cwd=cwd)


@pytest.fixture(autouse=True)
def quick(monkeypatch, without_figures):
    """Workers in this process; those of the first campaign, and of those that are ended, are processes as usual."""

    @contextmanager
    def one_thread(workers):
        with ThreadPoolExecutor(1) as executor:
            yield Cluster(executor, lambda: 1)

    monkeypatch.setattr(api, "local_cluster", one_thread)


def rows(folder):
    home = folder / "results/campaigns/small"
    tables = [pd.read_parquet(home / name) for name in ("results", "incoming") if list(home.glob(f"{name}/*.parquet"))]
    return pd.concat(tables, ignore_index=True)


def runs(folder):
    table = rows(folder)
    return table[table["kind"] == "run"]


@pytest.fixture(scope="module")
def finished_with_traps(tmp_path_factory):
    """Folder of a campaign in its own processes, its result, and the modules of the folder that were executed."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "small.yaml").write_text(CAMPAIGN)
    result, executed = run_among_traps(folder, *command("small.yaml", "--keep-estimates")[1:])
    assert result.returncode == 0, result.stderr
    return folder, result, executed


@pytest.fixture(scope="module")
def finished(finished_with_traps):
    return finished_with_traps[:2]


@pytest.mark.slow
def test_campaign_executes_no_file_of_the_working_folder(finished_with_traps):
    assert finished_with_traps[2] == ""


@pytest.mark.slow
def test_campaign_writes_results_tables_and_figures(finished):
    folder, result = finished
    home = folder / "results/campaigns/small"
    assert len(runs(folder)) == 12
    assert {"ckf", "tukf"} <= set(result.stdout.split())
    for name in ("runs.csv", "filters.csv", "coefficients.csv", "comparisons.csv", "campaign.md"):
        assert (home / "tables" / name).stat().st_size > 100
    assert (home / "figures/spread.png").stat().st_size > 1000
    assert "ckf and tukf, steady-state error" in (home / "report.html").read_text(encoding="utf-8")
    filters = pd.read_csv(home / "tables/filters.csv")
    assert list(filters["runs"]) == [3, 3, 3, 3]
    table = rows(folder)
    assert len(table[table["kind"] == "coefficient"]) == 12 * N_COEFFICIENTS
    assert set(table.loc[table["kind"] == "motion", "name"]) == {"u", "v", "w", "p", "q", "r", "phi", "theta", "psi"}


@pytest.mark.slow
def test_keep_estimates_writes_complete_estimates(finished):
    folder, _ = finished
    table = rows(folder)
    files = sorted((folder / "results/campaigns/small/estimates").iterdir())
    assert len(files) == 12
    estimate = read_estimate(files[0])
    own = table[(table["run"] == files[0].stem) & (table["kind"] == "coefficient")].set_index("name")
    for symbol, value in estimate.final_coefficients().items():
        assert own.loc[symbol, "estimate"] == value


@pytest.mark.slow
def test_finished_campaign_is_only_reported_again(finished):
    folder, first = finished
    before = {path: path.stat().st_mtime_ns for path in (folder / "results/campaigns/small/results").iterdir()}
    result = campaign("small.yaml", cwd=folder)
    assert result.exit_code == 0
    assert result.stdout == first.stdout
    assert before == {path: path.stat().st_mtime_ns for path in (folder / "results/campaigns/small/results").iterdir()}


@pytest.mark.slow
def test_more_seeds_and_levels_extend_existing_results(finished, tmp_path):
    folder, _ = finished
    (tmp_path / "small.yaml").write_text(CAMPAIGN.replace("seeds: 3", "seeds: 4").replace("[1, 3]", "[1, 3, 10]"))
    result = campaign("small.yaml", "--output", folder / "results/campaigns/small", "--dry-run", cwd=tmp_path)
    assert result.stdout.startswith("small: 24 runs: ")
    assert "4 seeds; 12 finished" in result.stdout
    assert "12 runs take about " in result.stdout


@pytest.mark.slow
def test_other_settings_do_not_mix_with_existing_results(finished):
    folder, first = finished
    result = campaign("small.yaml", "--set", "settings.manoeuvre.duration=8 s", "--set", "seeds=1", cwd=folder)
    assert result.exit_code == 0, result.stderr
    assert len(runs(folder)) == 4
    assert "12 runs with other settings" in result.stdout
    again = campaign("small.yaml", cwd=folder)
    assert len(runs(folder)) == 12
    assert first.stdout.splitlines()[:8] == again.stdout.splitlines()[:8]


@pytest.mark.slow
def test_dry_run_counts_remaining_runs(finished):
    folder, _ = finished
    assert "0 runs remain" in campaign("small.yaml", "--dry-run", cwd=folder).stdout
    assert "12 runs take about" in campaign("small.yaml", "--dry-run", "--again", cwd=folder).stdout


def test_dry_run_does_not_estimate_the_time_of_a_search(tmp_path):
    result = campaign("fit", "--set", "seeds=2", "--dry-run", cwd=tmp_path)
    assert "2 runs remain; duration unknown, because `fit: true`" in result.stdout


def test_dry_run_writes_nothing(tmp_path):
    (tmp_path / "small.yaml").write_text(CAMPAIGN)
    assert campaign("small.yaml", "--dry-run", cwd=tmp_path).exit_code == 0
    assert not (tmp_path / "results").exists()


@pytest.mark.slow
@pytest.mark.posix
def test_killed_campaign_continues(tmp_path):
    (tmp_path / "small.yaml").write_text(CAMPAIGN.replace("seeds: 3", "seeds: 5"))
    process = subprocess.Popen(command("small.yaml"), cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    home = tmp_path / "results/campaigns/small/incoming"
    deadline = time.monotonic() + 200.0
    while len(list(home.glob("*.parquet"))) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    kept = runs(tmp_path).set_index("run")["processor_time"]
    assert 4 <= len(kept) < 20
    result = campaign("small.yaml", cwd=tmp_path)
    assert result.exit_code == 0, result.stderr
    whole = runs(tmp_path)
    assert len(whole) == whole["run"].nunique() == 20
    # Processor time is never the same twice: what was kept was not done again.
    again = whole.set_index("run")["processor_time"].loc[kept.index]
    pd.testing.assert_series_equal(again, kept)


@pytest.mark.slow
def test_interrupted_campaign_reports_finished_runs(tmp_path):
    (tmp_path / "small.yaml").write_text(CAMPAIGN.replace("seeds: 3", "seeds: 100"))
    process = subprocess.Popen(
        command("small.yaml"),
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    home = tmp_path / "results/campaigns/small/incoming"
    deadline = time.monotonic() + 200.0
    while not list(home.glob("*.parquet")):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    # As a terminal does it: the workers get it, too.
    os.killpg(process.pid, signal.SIGINT)
    output, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "of 400 runs are finished and kept" in output
    assert complaint == "auvid: interrupted; files already written are complete\n"


@pytest.mark.slow
def test_failed_run_is_reported_and_repeated_by_retry(tmp_path):
    text = (
        CAMPAIGN.replace("seeds: 3", "seeds: 1")
        .replace("[1, 3]", "[1]")
        .replace(
            "vary: [",
            "vary: [{name: start, levels: {level: {}, upright: {manoeuvre.pitch: 1.5, manoeuvre.initial_pitch: 1.5}}},",
        )
    )
    (tmp_path / "small.yaml").write_text(text)
    result = campaign("small.yaml", cwd=tmp_path)
    assert result.exit_code == 1, result.stderr
    assert "2 runs failed; first reason: " in result.stdout
    assert "--retry" in result.stdout
    failures = pd.read_csv(tmp_path / "results/campaigns/small/failures.csv")
    assert set(failures["settings"]) == {"start = upright, identification.prior.factor = 1"}
    assert set(runs(tmp_path)["start"]) == {"level"}
    # Not tried again unless asked for.
    assert "0 runs remain" in campaign("small.yaml", "--dry-run", cwd=tmp_path).stdout
    assert "2 runs failed" in campaign("small.yaml", "--retry", cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: small\nfilters: [ckff]\n", ["small.yaml:2:11", "ckff"]),
        (
            "name: small\nvary: [{setting: sensors.dvl.rat, values: [1 Hz]}]\n",
            ["small.yaml:2:44", "rat", "did you mean"],
        ),
        ("", ["small.yaml"]),
    ],
)
def test_invalid_campaign_writes_nothing(tmp_path, text, words):
    (tmp_path / "small.yaml").write_text(text)
    result = campaign("small.yaml", cwd=tmp_path)
    assert_one_clear_complaint(result, *words)
    assert not (tmp_path / "results").exists()


def test_unknown_name_lists_shipped_campaigns(tmp_path):
    result = campaign("nothing", cwd=tmp_path)
    assert result.exit_code == 2
    assert (
        "neither a file nor a campaign that ships with auvid: biased, coloured, fit, judgement, paper, regimes"
        in result.stderr
    )
