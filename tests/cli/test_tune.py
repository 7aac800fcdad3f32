"""`auvid tune` as a user runs it."""

import csv
from dataclasses import replace

import pytest
import typer
from typer.testing import CliRunner

from auvid_cli.cli.tune import tune
from auvid_cli.data.dataset_file import write_dataset

FEW = "identification.coefficients=[X_u|u|, N_url]"
SLOW = "sensors.attitude={source: direct, rate: 20 Hz}", "sensors.gyroscope.rate=20 Hz"


@pytest.fixture
def run():
    """Function: the command with arguments; its result."""
    app = typer.Typer()
    app.command()(tune)
    return lambda *arguments: CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_it_says_what_the_noise_is_and_what_to_do_with_it(simulated_with, tmp_path, run):
    dataset = simulated_with("manoeuvre.duration=4 s", *SLOW, FEW)
    dvl = dataset.sensors["dvl"]
    half = replace(dvl, standard_deviation=0.5 * dvl.standard_deviation)
    write_dataset(tmp_path / "dataset.h5", replace(dataset, sensors=dataset.sensors | {"dvl": half}))
    result = run(tmp_path / "dataset.h5", "--sensors")
    assert result.exit_code == 0, result.output
    with (tmp_path / "tables/tuning.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["setting"]: row for row in csv.DictReader(file)}
    assert len(rows) == 6
    found = rows["identification.measurement_noise.dvl"]
    assert float(found["low"]) < 2.0 < float(found["high"])
    assert "measurement_noise.dvl" in result.output
    assert "mean NIS of dvl" in result.output
    advice = result.output.splitlines()[-1]
    assert advice.startswith(f"Next: auvid identify {tmp_path}/dataset.h5 --set identification.process_noise.velocity=")
    assert f"--set identification.measurement_noise.dvl={float(found['tuned']):.3g}" in advice


def test_what_is_no_dataset_is_one_line(tmp_path, run, capsys):
    (tmp_path / "log.h5").write_text("t,u,v\n")
    assert run(tmp_path / "log.h5").exit_code == 2
