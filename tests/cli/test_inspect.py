"""`auvid inspect` as a user runs it."""

import csv
from dataclasses import replace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from auvid_cli.cli.data import inspect
from auvid_cli.data.dataset_file import write_dataset


@pytest.fixture
def run(without_figures):
    """Function: the command with arguments, without the figure that another test draws; its result."""
    app = typer.Typer()
    app.command()(inspect)

    def invoke(*arguments):
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    return invoke


def rows(folder):
    with (folder / "tables/inspection.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_good_data_pass_and_write_table_and_figure(short_run, tmp_path, run):
    write_dataset(tmp_path / "dataset.h5", short_run)
    result = run(tmp_path / "dataset.h5")
    assert result.exit_code == 0, result.output
    verdicts = rows(tmp_path)
    assert list(verdicts[0]) == ["subject", "check", "statistic", "threshold", "passed", "advice"]
    assert all(row["passed"] in ("True", "") for row in verdicts)
    assert {"rate", "jitter", "clock", "spikes", "noise floor", "excitation", "fast enough"} <= {
        row["check"] for row in verdicts
    }
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"timeline.png"}
    passed = sum(row["passed"] == "True" for row in verdicts)
    assert f"data: {passed} of {len(verdicts)} passed" in result.output
    assert "fast enough" not in result.output
    assert "fast enough" in run(tmp_path / "dataset.h5", "--verbose").output


@pytest.mark.slow
@pytest.mark.parametrize("opens", [True, False])
def test_open_starts_browser_or_prints_page(short_run, tmp_path, run, monkeypatch, opens):
    asked = []
    monkeypatch.setattr("webbrowser.open", lambda address: asked.append(address) or opens)
    write_dataset(tmp_path / "dataset.h5", short_run)
    result = run(tmp_path / "dataset.h5", "--open")
    assert asked == [(tmp_path / "inspection.html").as_uri()]
    assert ("no browser could be started" in result.output) is not opens
    assert "No check fails" in (tmp_path / "inspection.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_failed_check_gives_advice_and_exit_code_1(short_run, tmp_path, run):
    record = short_run.sensors["gyroscope"]
    turned = replace(record, values=record.values * np.array([1.0, 1.0, -1.0]))
    write_dataset(
        tmp_path / "mission.h5", replace(short_run, sensors=short_run.sensors | {"gyroscope": turned}, truth=None)
    )
    result = run(tmp_path / "mission.h5", "-o", tmp_path / "out")
    assert result.exit_code == 1
    assert {(row["subject"], row["check"]) for row in rows(tmp_path / "out") if row["passed"] == "False"} == {
        ("gyroscope", "r against psi"),
        ("gyroscope", "r against heading"),
    }
    assert "The sign of r is wrong" in " ".join(result.output.split())


@pytest.mark.slow
def test_quiet_prints_nothing(short_run, tmp_path, run):
    write_dataset(tmp_path / "dataset.h5", short_run)
    assert run(tmp_path / "dataset.h5", "-q").output == ""


def test_invalid_file_is_one_error(tmp_path, run):
    result = run(tmp_path / "nothing.h5")
    assert result.exit_code == 2
    assert "auvid: " in result.output
    assert "nothing.h5" in result.output


@pytest.mark.slow
def test_use_inspects_only_that_part(short_run, tmp_path, run):
    """The gyroscope is turned in the second half only."""
    record = short_run.sensors["gyroscope"]
    sign = np.where(record.time < 30.0, 1.0, -1.0)[:, None]
    turned = replace(record, values=record.values * sign)
    path = tmp_path / "dataset.h5"
    write_dataset(path, replace(short_run, sensors=short_run.sensors | {"gyroscope": turned}, truth=None))
    assert run(path, "--use", "0:29.9").exit_code == 0
    late = run(path, "--use", "30.1:60")
    assert late.exit_code == 1
    assert "The sign of r is wrong" in " ".join(late.output.split())


@pytest.mark.parametrize(
    ("use", "complaint"),
    [
        (("0:20", "30:40"), "2 parts given; expected one"),
        (("70:80",), "from t = 70 s to 80 s"),
        (("now",), "expected BEGIN:END in seconds"),
    ],
)
def test_invalid_part_is_one_error(use, complaint, short_run, tmp_path, run):
    write_dataset(tmp_path / "dataset.h5", short_run)
    result = run(tmp_path / "dataset.h5", *(word for span in use for word in ("--use", span)))
    assert result.exit_code == 2
    assert complaint in result.output


@pytest.mark.slow
def test_last_line_is_next_command(short_run, tmp_path, run):
    path = tmp_path / "dataset.h5"
    write_dataset(path, short_run)
    assert run(path, "--use", "0:40").output.splitlines()[-1] == f"next: auvid fit {path} --use 0:40"
    dvl = short_run.sensors["dvl"]
    backwards = replace(dvl, values=-dvl.values)
    write_dataset(path, replace(short_run, sensors=short_run.sensors | {"dvl": backwards}))
    last = run(path).output.splitlines()[-1]
    assert last.startswith("1 check fails. Next: ")
    assert "auvid identify" not in last


@pytest.mark.slow
def test_fixed_coefficients_without_value_are_named(short_run, with_settings, tmp_path, run):
    bare = with_settings(short_run.without_truth(), "vehicle.coefficients={X_u|u|: -5}")
    write_dataset(tmp_path / "bare.h5", bare)
    assert "add values" not in run(tmp_path / "bare.h5", "-o", tmp_path / "out").output
    held = with_settings(bare, "identification.coefficients=[N_uudr]")
    write_dataset(tmp_path / "held.h5", held)
    last = " ".join(run(tmp_path / "held.h5", "-o", tmp_path / "held").output.split())
    assert "First add values of Y_v|v|" in last
