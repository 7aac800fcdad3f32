import csv
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest

from auvid_cli.vehicle.coefficients import N_COEFFICIENTS
from auvid_cli.vehicle.parameters import N_MOTION

from .conftest import assert_one_clear_complaint, auvid, run_among_traps

SHORT = ["--set", "manoeuvre.duration=12 s", "--set", "identification.judge=false"]


@pytest.fixture(autouse=True)
def quick(without_figures):
    """Figures are drawn where a command has its own process."""


def leftovers(folder):
    """Temporary files that a failed command should have removed; the lock of a results folder stays."""
    return [path for path in Path(folder).rglob(".*") if path.is_file() and path.name != ".lock"]


def written(folder):
    """Files of a folder except the modules of `run_among_traps`."""
    return [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".py"]


def test_linear_algebra_uses_one_thread():
    look = "import auvid_cli.__main__, numpy, threadpoolctl; print(threadpoolctl.threadpool_info()[0]['num_threads'])"
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    command = [sys.executable, "-c", look]
    result = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
    assert (result.stdout, result.stderr) == ("1\n", "")


@pytest.fixture(scope="module")
def run_with_traps(tmp_path_factory):
    """Folder of a run in its own process, the ended process, and the modules of the folder that were executed."""
    folder = tmp_path_factory.mktemp("run")
    result, executed = run_among_traps(folder, "run", *SHORT, "--filter", "ckf", "--filter", "tukf")
    assert result.returncode == 0, result.stderr
    return folder, result, executed


@pytest.fixture(scope="module")
def results(run_with_traps):
    return run_with_traps[:2]


@pytest.mark.slow
def test_run_executes_no_file_of_the_working_folder(run_with_traps):
    assert run_with_traps[2] == ""


JUDGED = ["--set", "manoeuvre.duration=20 s", "--set", "sensors.attitude.source=direct"]


def table(folder, name):
    lines = (folder / f"results/spiral/tables/{name}.csv").read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(lines))


@pytest.mark.slow
def test_smoother_runs_by_default_and_judges_filters(tmp_path):
    result = auvid("run", *JUDGED, "--filter", "ckf", cwd=tmp_path)
    rows = table(tmp_path, "summary")
    assert [row["filter"] for row in rows] == ["ckf", "smoother"]
    assert rows[1]["grade"] == "sound"
    assert result.exit_code == (rows[0]["grade"] != "sound")
    again = auvid("check", "results/spiral", "-v", cwd=tmp_path)
    assert "sound" in again.stdout
    assert again.exit_code in (result.exit_code, 1)


@pytest.mark.slow
def test_fault_gives_advice_and_exit_code_1(tmp_path):
    result = auvid("run", *JUDGED, "--set", "sensors.gyroscope.bias=0.2 deg/s", "--filter", "smoother", cwd=tmp_path)
    assert result.exit_code == 1
    output = " ".join(result.stdout.split())
    assert re.search(r"Smoother (doubtful: the data look like a fault: bias of [pqr]|inconsistent)", output)
    worst = max(table(tmp_path, "faults"), key=lambda row: abs(float(row["z"])))
    assert worst["fault"] in ("bias of p", "bias of q", "bias of r")
    assert abs(float(worst["size"])) == pytest.approx(0.0035, rel=0.3)


@pytest.mark.slow
def test_run_writes_dataset_estimates_tables_and_figures(results):
    folder, _ = results
    made = {str(path.relative_to(folder / "results/spiral")) for path in written(folder)}
    assert {"dataset.h5", "estimates/ckf.h5", "estimates/tukf.h5"} <= made
    assert 100_000 < (folder / "results/spiral/report.html").stat().st_size < 3_000_000
    assert {"tables/coefficients.csv", "tables/summary.csv", "tables/velocity_error.csv"} <= made
    assert {"tables/tables.md", "tables/tables.tex", "figures/path.png"} <= made
    assert not [name for name in made if name.endswith((".svg", ".pdf"))]
    assert all(3_000 < path.stat().st_size < 1_000_000 for path in (folder / "results/spiral/figures").iterdir())
    assert not leftovers(folder)


@pytest.mark.slow
def test_run_into_pipe_prints_summary_without_progress_bar(results):
    _, result = results
    assert "CKF" in result.stdout
    assert "TUKF" in result.stdout
    assert "\x1b" not in result.stdout + result.stderr
    assert result.stderr == ""


@pytest.mark.slow
def test_single_steps_give_estimates_of_run(results, tmp_path):
    folder, _ = results
    simulated = auvid("simulate", *SHORT, cwd=tmp_path)
    assert simulated.exit_code == 0
    assert simulated.stdout.splitlines()[-1] == f"next: auvid identify {Path('results/spiral/dataset.h5')}"
    assert auvid("identify", *SHORT, "--filter", "tukf", cwd=tmp_path).exit_code == 0
    assert auvid("report", cwd=tmp_path).exit_code == 0
    with (
        h5py.File(folder / "results/spiral/estimates/tukf.h5") as one,
        h5py.File(tmp_path / "results/spiral/estimates/tukf.h5") as other,
    ):
        assert (one["mean"][...] == other["mean"][...]).all()


@pytest.mark.slow
def test_identify_uses_settings_of_dataset_file(results, tmp_path):
    folder, _ = results
    (tmp_path / "mission.h5").write_bytes((folder / "results/spiral/dataset.h5").read_bytes())
    result = auvid("identify", "mission.h5", "-f", "ukf", cwd=tmp_path)
    assert result.exit_code == 0
    assert result.stdout.splitlines()[-1] == f"next: auvid report {Path('results/mission')}"
    assert (tmp_path / "results/mission/dataset.h5").is_file()
    assert auvid("report", "results/mission", cwd=tmp_path).exit_code == 0


@pytest.mark.slow
def test_identify_names_settings_of_errors_that_are_not_estimated(results, tmp_path):
    (tmp_path / "mission.h5").write_bytes((results[0] / "results/spiral/dataset.h5").read_bytes())
    settings = "{biases: [gyro], gyro: {walk: 1e-5 rad/s/s^0.5}, dvl: {scale_spread: 0.01}}"
    command = "identify", "mission.h5", "-f", "ckf", "--set", f"identification.estimate={settings}", *SHORT[2:]
    result = auvid(*command, cwd=tmp_path)
    assert result.exit_code == 0, result.stderr
    (note,) = [line for line in (result.stdout + result.stderr).splitlines() if "no effect" in line]
    assert note.startswith("note: identification.estimate.dvl ")


@pytest.mark.slow
def test_dataset_without_truth_gives_identical_estimates(results, tmp_path):
    folder, _ = results
    path = tmp_path / "mission.h5"
    path.write_bytes((folder / "results/spiral/dataset.h5").read_bytes())
    with h5py.File(path, "a") as file:
        del file["truth"]
    assert auvid("identify", "mission.h5", "-f", "tukf", "-o", "out", cwd=tmp_path).exit_code == 0
    with (
        h5py.File(folder / "results/spiral/estimates/tukf.h5") as one,
        h5py.File(tmp_path / "out/estimates/tukf.h5") as other,
    ):
        for name in ("time", "mean", "standard_deviation", "covariance", "innovations/dvl/innovation"):
            assert one[name][...].tobytes() == other[name][...].tobytes()


@pytest.mark.slow
def test_segments_are_fitted_together_and_reported(results, tmp_path):
    shutil.copy(results[0] / "results/spiral/dataset.h5", tmp_path / "mission.h5")
    command = ("identify", "mission.h5", "-f", "output_error", "-f", "tukf", "--use", ":5", "--use", "6:")
    result = auvid(*command, cwd=tmp_path)
    assert result.exit_code in (0, 1), result.stderr
    assert auvid("report", "results/mission", cwd=tmp_path).exit_code == result.exit_code
    with (tmp_path / "results/mission/tables/coefficients.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["filter"] for row in rows} == {"output_error", "tukf"}
    assert all(float(row["cramer_rao_bound"]) > 0.0 for row in rows)
    with h5py.File(tmp_path / "results/mission/estimates/tukf.h5") as file:
        time = file["time"][()]
    assert time[0] == 0.01
    assert time[-1] == 12.0
    assert not ((time > 5.0) & (time < 6.0)).any()


@pytest.mark.slow
def test_output_error_is_reported_with_filters(results, tmp_path):
    folder, _ = results
    (tmp_path / "mission.h5").write_bytes((folder / "results/spiral/dataset.h5").read_bytes())
    bounds = "identification.output_error.bounds={X_u|u|: [-10 kg/m, 0]}"
    command = ("identify", "mission.h5", "-f", "output_error", "-f", "tukf", "--set", bounds)
    result = auvid(*command, cwd=tmp_path)
    assert result.exit_code == 0, result.stderr
    assert "Shown: OE. " in result.stdout
    with h5py.File(tmp_path / "results/mission/estimates/output_error.h5") as file:
        assert file.attrs["status"] == "completed"
        assert file["mean"].shape == file["standard_deviation"].shape == (file["time"].size, N_COEFFICIENTS + N_MOTION)
        assert (file["mean"][:, :N_COEFFICIENTS] == file["mean"][0, :N_COEFFICIENTS]).all()
        assert file["covariance"].shape == (N_COEFFICIENTS + N_MOTION,) * 2
        for sensor in ("dvl", "gyroscope", "attitude"):
            assert {"time", "innovation", "variance", "nis"} <= set(file[f"innovations/{sensor}"])
    report = auvid("report", "results/mission", "--figure-format", "svg", "--figure-format", "pdf", cwd=tmp_path)
    assert report.exit_code == 0, report.stderr
    assert re.search(r"^ OE .* unjudged", report.stdout, re.MULTILINE)
    made = tmp_path / "results/mission"
    assert "| OE | " in (made / "tables/tables.md").read_text(encoding="utf-8")
    assert "output_error,X_u|u|," in (made / "tables/coefficients.csv").read_text(encoding="utf-8")
    assert {path.suffix for path in (made / "figures").iterdir()} == {".svg", ".pdf"}, "none of what was drawn before"


@pytest.mark.slow
def test_unconverged_fit_gives_exit_code_1(results, tmp_path):
    folder, _ = results
    (tmp_path / "mission.h5").write_bytes((folder / "results/spiral/dataset.h5").read_bytes())
    limit = "identification.output_error.max_evaluations=1"
    result = auvid("identify", "mission.h5", "-f", "output_error", "--set", limit, cwd=tmp_path)
    assert result.exit_code == 1
    assert "unconverged: " in result.stdout
    assert re.search(
        "^OE diverged: unconverged: .*; its residuals are .*max_evaluations=2", result.stdout, re.MULTILINE
    )
    last = result.stdout.splitlines()[-1]
    folder = Path("results/mission")
    assert last.endswith(f": auvid fit {folder / 'dataset.h5'} -o {folder / 'fit'}")


@pytest.mark.slow
@pytest.mark.parametrize("manoeuvre", ["zigzag_10_10", "doublets", "multisine", "turning_circle"])
def test_one_setting_changes_the_manoeuvre(manoeuvre, tmp_path):
    result = auvid("simulate", *SHORT, "--set", f"manoeuvre=manoeuvres/{manoeuvre}.yaml", cwd=tmp_path)
    assert result.exit_code == 0, result.stderr
    with h5py.File(tmp_path / "results/spiral/dataset.h5") as file:
        assert file["inputs/time"][-1] >= 11.9


def test_verbose_prints_durations(tmp_path):
    result = auvid("simulate", *SHORT, "--verbose", cwd=tmp_path)
    assert "simulate: " in result.stdout + result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("no_color", [False, True])
def test_terminal_shows_progress_bars(no_color, results, tmp_path):
    pty = pytest.importorskip("pty")
    (tmp_path / "mission.h5").write_bytes((results[0] / "results/spiral/dataset.h5").read_bytes())
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100"} | ({"NO_COLOR": "1"} if no_color else {})
    here, there = pty.openpty()
    command = [sys.executable, "-m", "auvid_cli", "identify", "mission.h5", "-f", "ckf"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=there, stderr=there, env=environment) as process:
        os.close(there)
        shown = b""
        while True:
            try:
                part = os.read(here, 4096)
            except OSError:  # Linux says that the other end has closed.
                break
            if not part:
                break
            shown += part
        os.close(here)
    assert process.returncode == 0
    assert b"ckf" in shown
    assert re.search(rb"([0-9]+)/\1 ", re.sub(rb"\x1b\[[0-9;]*m", b"", shown)), "a bar that reached its end"
    assert len(re.findall(rb"ckf: done in [0-9.]+ s\r\n", shown)) == 1, "what stays of all bars"
    assert (re.search(rb"\x1b\[[0-9;]*3[0-9]", shown) is None) == no_color


def test_quiet_prints_nothing(tmp_path):
    result = auvid("simulate", *SHORT, "--quiet", cwd=tmp_path)
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


def test_dry_run_prints_valid_settings_and_writes_nothing(tmp_path):
    result = auvid("run", *SHORT, "--seed", "7", "--dry-run", cwd=tmp_path)
    assert result.exit_code == 0
    assert not list(tmp_path.iterdir())
    (tmp_path / "resolved.yaml").write_text(result.stdout)
    again = auvid("run", "resolved.yaml", "--dry-run", cwd=tmp_path)
    assert again.stdout == result.stdout
    assert "seed: 7" in again.stdout


@pytest.mark.slow
def test_diverged_filter_gives_exit_code_1_and_others_finish(tmp_path):
    result = auvid(*("run", *SHORT, "--set", "identification.prior.factor=300", "-f", "ckf", "-f", "ekf"), cwd=tmp_path)
    assert result.exit_code == 1
    assert "diverged at t = " in result.stdout
    assert "narrow the prior (--set identification.prior.factor=1)" in " ".join(result.stdout.split())
    with h5py.File(tmp_path / "results/spiral/estimates/ckf.h5") as file:
        assert file.attrs["status"].startswith("diverged")
        assert file["mean"].shape[0] > 0
    assert (tmp_path / "results/spiral/estimates/ekf.h5").is_file()


def test_config_of_wrong_type_is_one_error(tmp_path):
    (tmp_path / "wrong.yaml").write_text("- a\n- list\n")
    assert_one_clear_complaint(auvid("run", "wrong.yaml", cwd=tmp_path), "wrong.yaml:1:1")


def test_truncated_dataset_is_one_error(results, tmp_path):
    folder, _ = results
    whole = (folder / "results/spiral/dataset.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    assert_one_clear_complaint(auvid("identify", "cut.h5", cwd=tmp_path), "cut.h5")
    assert not (tmp_path / "results").exists()


def test_a_dataset_simulated_with_other_settings_is_refused(results):
    folder, _ = results
    result = auvid("identify", *SHORT, "--set", "sensors.dvl.rate=5 Hz", cwd=folder)
    assert_one_clear_complaint(result, "sensors", "auvid simulate")


def test_report_refuses_an_estimate_of_another_dataset(results, tmp_path):
    folder, _ = results
    assert auvid("simulate", *SHORT, "--seed", "2", cwd=tmp_path).exit_code == 0
    stray = tmp_path / "results/spiral/estimates/ckf.h5"
    stray.parent.mkdir()
    stray.write_bytes((folder / "results/spiral/estimates/ckf.h5").read_bytes())
    assert_one_clear_complaint(auvid("report", cwd=tmp_path), "ckf.h5", "another dataset")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root and Windows may write anywhere")
def test_read_only_folder_is_one_error(tmp_path):
    tmp_path.chmod(0o555)
    assert_one_clear_complaint(auvid("simulate", *SHORT, cwd=tmp_path), "cannot be written")


def test_file_as_results_folder_is_one_error(tmp_path):
    (tmp_path / "results").write_text("in the way")
    assert_one_clear_complaint(auvid("simulate", *SHORT, cwd=tmp_path), "cannot be written")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "number", "code"),
    [("dataset.h5", signal.SIGINT, 130), ("estimates/.*", signal.SIGINT, 130), ("estimates/.*", signal.SIGTERM, 143)],
    ids=["loading", "filtering", "termination"],
)
def test_interrupting_leaves_no_half_written_file(tmp_path, number, code, first):
    """Whatever it is at; an interrupt at the terminal reaches those who draw figures as well."""
    command = [sys.executable, "-m", "auvid_cli", "run", "--filter", "ekf"]
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    folder = tmp_path / "results/spiral"
    deadline = time.monotonic() + 240
    while not list(folder.glob(first)):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    time.sleep(0.3)
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == code, stderr
    assert all(line.startswith("auvid: ") for line in stderr.splitlines()), stderr
    assert not leftovers(tmp_path)
    assert not list(folder.glob("estimates/*"))
    with h5py.File(folder / "dataset.h5") as file:
        assert file["sensors/gyroscope/p"].shape == (30001,)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "environment", "heavy"),
    [
        (["--help"], {}, {"pydantic"}),
        # Typer itself loads pydantic there, if it is installed.
        *(
            ([], {"_AUVID_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": "3"}, set())
            for words in ("auvid identify --filter ", "auvid run --set sensors.dvl.ra")
        ),
    ],
    ids=["help", "completion", "completion of keys"],
)
def test_help_and_completion_import_nothing_heavy(arguments, environment, heavy):
    command = [sys.executable, "-X", "importtime", Path(sys.executable).with_name("auvid"), *arguments]
    result = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=True)
    assert re.search("identify|tukf|sensors.dvl.rate=", result.stdout)
    imported = {line.rpartition("|")[2].strip() for line in result.stderr.splitlines()}
    assert "typer" in imported
    assert imported.isdisjoint(heavy | {"numba", "numpy", "scipy", "h5py", "matplotlib", "pint"})


@pytest.mark.slow
def test_check_prints_advice_and_exit_code(results, tmp_path):
    """Twelve seconds of a gentle start are too short for half of the coefficients."""
    folder, _ = results
    result = auvid("check", "results/spiral", cwd=folder)
    assert result.exit_code == 1, result.stderr
    output = " ".join(result.stdout.split())
    assert re.search(r"CKF[^:]*: \d+ of \d+ passed, \d+ failed", output)
    assert "FAIL" in output
    assert re.search(r"coefficients \(identified\): The data do not determine these", output)
    rows = list(csv.DictReader((folder / "results/spiral/tables/checks.csv").read_text(encoding="utf-8").splitlines()))
    assert {row["passed"] for row in rows} >= {"True", "False"}
    assert all(bool(row["advice"]) == (row["passed"] != "True") for row in rows)


@pytest.mark.parametrize("command", ["check", "report"])
def test_missing_folder_is_one_error_and_is_not_made(command, tmp_path):
    assert_one_clear_complaint(auvid(command, "results/spiral", cwd=tmp_path), "results/spiral/dataset.h5")
    assert [*tmp_path.iterdir()] == []


def test_as_log_writes_logs_and_keeps_existing_files(tmp_path):
    survey = ("simulate", "field", "--as-log", "--set", "manoeuvre.duration=20 s", "-o", tmp_path)
    output = auvid(*survey).stdout
    assert f"next: auvid import --map {tmp_path / 'map.yaml'}" in output
    written = {path.name for path in tmp_path.iterdir()}
    assert written - {".lock"} == {"fins.csv", "compass.csv", "dvl.csv", "depth.csv", "vehicle.yaml", "map.yaml"}
    assert_one_clear_complaint(auvid(*survey), "fins.csv: exists already")
    assert auvid(*survey, "--overwrite").exit_code == 0
