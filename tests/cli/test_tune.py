"""`auvid tune` as a user runs it."""

import csv
import math
from concurrent.futures import Future
from dataclasses import replace
from typing import ClassVar

import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

from auvid_cli.api import Destination, Progress
from auvid_cli.api.analysis import tune_into
from auvid_cli.api.files import read_dataset
from auvid_cli.api.identification import identify
from auvid_cli.cli.app import app
from auvid_cli.cli.experiment import tune
from auvid_cli.config.extra_states import ProcessNoise
from auvid_cli.data.dataset_file import write_dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.report.screens import print_tuning

FEW = "identification.coefficients=[X_u|u|, N_url]"
SLOW = "sensors.attitude={source: direct, rate: 20 Hz}", "sensors.gyroscope.rate=20 Hz"


@pytest.fixture
def run():
    """Function: the command with arguments; its result."""
    alone = typer.Typer()
    alone.command()(tune)
    return lambda *arguments: CliRunner().invoke(alone, [str(argument) for argument in arguments])


@pytest.mark.slow
def test_tune_prints_noise_and_next_command(simulated_with, tmp_path, run):
    dataset = simulated_with("manoeuvre.duration=4 s", *SLOW, FEW)
    dvl = dataset.sensors["dvl"]
    half = replace(dvl, standard_deviation=0.5 * dvl.standard_deviation)
    write_dataset(tmp_path / "dataset.h5", replace(dataset, sensors=dataset.sensors | {"dvl": half}))
    result = run(tmp_path / "dataset.h5", "--sensors", "--set", "identification.gate=null")
    assert result.exit_code == 0, result.output
    with (tmp_path / "tables/tuning.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["setting"]: row for row in csv.DictReader(file)}
    assert len(rows) == 6
    found = rows["identification.measurement_noise.dvl"]
    assert float(found["low"]) < 2.0 < float(found["high"])
    assert "mean NIS of dvl" in result.output
    assert "process_noise.velocity" in result.output
    advice = result.output.splitlines()[-1]
    given = "--set=identification.gate=null"
    assert advice == f"next: auvid identify {tmp_path}/dataset.h5 {given} --set {tmp_path}/tuned.yaml"
    tuned = read_dataset(tmp_path / "dataset.h5", str(tmp_path / "tuned.yaml")).experiment.identification
    assert tuned.measurement_noise["dvl"] == pytest.approx(float(found["tuned"]), rel=0.01)
    rate = float(rows["identification.process_noise.rate"]["tuned"])
    assert tuned.process_noise.rate == pytest.approx((rate,), rel=0.01)


@pytest.mark.slow
def test_interrupted_tuning_keeps_best_noise_so_far(simulated_with, tmp_path, capsys):
    class Interrupting(Progress):
        sentences: ClassVar[list[str]] = []

        def message(self, sentence):
            self.sentences.append(sentence)
            if "trajectory 2 " in sentence:
                raise KeyboardInterrupt

    write_dataset(tmp_path / "dataset.h5", simulated_with("manoeuvre.duration=4 s", *SLOW, FEW))
    place = Destination(None, False, Interrupting())
    tuning, fits, *_ = tune_into(place, tmp_path / "dataset.h5", (), sensors=False, disturbance=False)
    assert tuning.gain > 0.0
    assert not tuning.converged
    assert all(math.isnan(noise.low) and math.isnan(noise.high) for noise in tuning.noises)
    print_tuning(Console(), tuning, fits)
    printed = " ".join(capsys.readouterr().out.split())
    assert "process_noise.rate" in printed
    assert "any smaller value fits as well" not in printed
    assert "no limit" not in printed
    read_dataset(tmp_path / "dataset.h5", str(tmp_path / "tuned.yaml"))
    assert any(sentence.startswith("interrupted") for sentence in Interrupting.sentences)


@pytest.mark.slow
def test_interrupt_of_the_fits_prints_the_noise(simulated_with, tmp_path, run, monkeypatch):
    def interrupted(self, timeout=None):
        raise KeyboardInterrupt

    write_dataset(tmp_path / "dataset.h5", simulated_with("manoeuvre.duration=4 s", *SLOW, FEW))
    monkeypatch.setattr(Future, "result", interrupted)
    result = run(tmp_path / "dataset.h5")
    assert result.exit_code == 0, result.output
    printed = " ".join(result.output.split())
    assert "interrupted: the noise is kept, but not compared with that of the settings" in printed
    assert "process_noise.rate" in printed
    assert "Before and after" not in printed
    assert "mean NIS" not in printed
    assert read_dataset(tmp_path / "dataset.h5", str(tmp_path / "tuned.yaml"))


@pytest.mark.slow
def test_tune_chooses_disturbance(simulated_with, tmp_path, run):
    asked = "{biases: [disturbance], disturbance: {force: {standard_deviation: 2 N, time_constant: 2 s}}}"
    dataset = simulated_with("manoeuvre.duration=4 s", *SLOW, FEW, f"identification.estimate={asked}")
    write_dataset(tmp_path / "dataset.h5", dataset)
    result = run(tmp_path / "dataset.h5", "--disturbance")
    assert result.exit_code == 0, result.output
    (said,) = [line for line in result.output.splitlines() if line.startswith("a disturbance")]
    assert said.startswith("a disturbance that is correlated in time is left out: it changes the log-likelihood by ")
    assert "2 more parameters need" in said
    tuned = read_dataset(tmp_path / "dataset.h5", str(tmp_path / "tuned.yaml")).experiment.identification
    assert tuned.estimate.biases == ()


def test_identify_with_noise_setting_tunes_first(simulated_with):
    dataset = simulated_with("manoeuvre.duration=4 s", *SLOW, FEW, "identification.noise=estimate")
    settings = identify(dataset, "ckf").experiment.identification
    assert settings.noise == "stated"
    assert settings.process_noise != ProcessNoise()


@pytest.mark.slow
def test_identify_prints_tuned_noise(simulated_with, tmp_path):
    asked = "{biases: [disturbance], disturbance: {force: {standard_deviation: 2 N, time_constant: 2 s}}}"
    dataset = simulated_with("manoeuvre.duration=4 s", *SLOW, FEW, f"identification.estimate={asked}")
    write_dataset(tmp_path / "dataset.h5", dataset)
    # Four seconds of data are too short for a judgement.
    settings = "--set=identification.noise=estimate", "--set=identification.judge=false"
    result = CliRunner().invoke(app, ["identify", f"{tmp_path}/dataset.h5", "--filter", "ckf", *settings])
    assert result.exit_code == 0, result.output
    (line,) = [line for line in result.output.splitlines() if line.startswith("estimated process noise")]
    identification = read_estimate(tmp_path / "estimates/ckf.h5").experiment.identification
    settings, force = identification.process_noise, identification.estimate.disturbance.force
    levels = f"force {force.standard_deviation[0]:.3g}, time constant {force.time_constant[0]:.3g} s"
    assert f"estimated disturbance, SI: {levels}" in result.output
    densities = {name: getattr(settings, name)[0] for name in ("velocity", "rate", "attitude")}
    assert line.endswith(", ".join(f"{name} {density:.3g}" for name, density in densities.items()))


def test_invalid_dataset_is_one_line(tmp_path, run, capsys):
    (tmp_path / "log.h5").write_text("t,u,v\n")
    assert run(tmp_path / "log.h5").exit_code == 2
