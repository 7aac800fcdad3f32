"""`auvid validate` from the command line."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from auvid_cli.cli.judge import validate
from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Use
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import new_estimate, write_estimate
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify, set_up_filters

WHITE = "sensors.attitude={source: direct, rate: 25 Hz, noise: 0.1 deg}"
CIRCLE = "manoeuvre={type: turning_circle, duration: 60 s, speed: 3.9 m/s, rudder: -15 deg, approach: 10 s}"


@pytest.fixture(autouse=True)
def quick(fewer_starts) -> None:
    """A few predictions ahead say as much of a command as many."""


def run(*arguments):
    app = typer.Typer()
    app.command()(validate)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def results(simulated_with, tmp_path_factory) -> Path:
    """A results folder with an estimate from a spiral, and a dataset of a turning circle."""
    folder = tmp_path_factory.mktemp("results")
    write_dataset(folder / "dataset.h5", simulated_with("manoeuvre.duration=100 s", WHITE))
    estimate = identify(read_dataset(folder / "dataset.h5"), FilterName.CKF)
    write_estimate(folder / "estimates/ckf.h5", estimate)
    write_dataset(folder / "circle.h5", simulated_with(CIRCLE, WHITE, "seed=5"))
    return folder


@pytest.mark.slow
def test_a_good_model_passes_and_leaves_tables_and_figures(results, tmp_path):
    result = run(results / "estimates/ckf.h5", results / "circle.h5", "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert result.stdout.count("The model of the CKF predicts these data.") == 1
    assert result.stdout.startswith("Yaw rate in turns 20 s ahead: ")
    assert result.stdout.splitlines()[-1] == f"next: auvid export {results / 'estimates/ckf.h5'} --to yaml"
    made = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert made == {
        ".lock",
        "dataset.h5",
        "validation.html",
        *(f"tables/{name}.csv" for name in ("validation", "manoeuvres", "validation_checks")),
        *(f"figures/validation_{name}.png" for name in ("velocities", "attitude", "horizons")),
    }
    with (tmp_path / "tables/manoeuvres.csv").open(encoding="utf-8") as file:
        numbers = {row["number"]: row for row in csv.DictReader(file)}
    assert float(numbers["radius"]["predicted"]) == pytest.approx(float(numbers["radius"]["measured"]), rel=0.01)


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_a_changed_vehicle_fails_with_exit_code_1(results, simulated_with, tmp_path):
    mass = simulated_with("manoeuvre.duration=2 s").experiment.vehicle.known_parameters()["m"]
    changed = simulated_with(
        CIRCLE, WHITE, "seed=5", "vehicle.coefficients.N_uudr=-4 kg/rad", f"vehicle.parameters.m={1.2 * mass}"
    )
    write_dataset(tmp_path / "changed.h5", changed)
    result = run(results / "estimates/ckf.h5", tmp_path / "changed.h5", "-o", tmp_path)
    assert result.exit_code == 1, result.output
    assert "FAIL" in result.stdout
    assert "another vehicle (m differ)" in " ".join(result.stdout.split())
    words = " ".join(result.stdout.split())
    assert "it is not recommended" in words
    assert "predicts these data" not in words
    assert result.stdout.splitlines()[-1] == f"next: auvid fit {results / 'dataset.h5'} -o {results / 'fit'}"


@pytest.mark.slow
def test_its_own_data_are_refused_even_as_a_copy(results, tmp_path):
    own = read_dataset(results / "dataset.h5")
    write_dataset(tmp_path / "copy.h5", own.without_truth())
    for path, words in ((results / "dataset.h5", "the same data"), (tmp_path / "copy.h5", "made from some of these")):
        result = run(results / "estimates/ckf.h5", path, "-o", tmp_path / "out")
        assert result.exit_code == 2
        assert words in result.stderr
        assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_missing_file_is_reported(results, tmp_path):
    for arguments in ((tmp_path / "no.h5", results / "circle.h5"), (results / "estimates/ckf.h5", tmp_path / "no.h5")):
        result = run(*arguments)
        assert result.exit_code == 2
        assert "no.h5" in result.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_quiet_prints_nothing(results, tmp_path):
    result = run(results / "estimates/ckf.h5", results / "circle.h5", "-q", "-o", tmp_path)
    assert (result.exit_code, result.output) == (0, "")


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_unused_part_of_own_dataset_is_accepted(results, tmp_path):
    dataset = read_dataset(results / "dataset.h5")
    half = 0.5 * float(dataset.inputs.time[-1])
    use = {"spans": ((0.0, half),)}
    settings = dataset.experiment.identification.model_copy(update={"use": Use.model_validate(use)})
    early = replace(dataset, experiment=dataset.experiment.model_copy(update={"identification": settings}))
    (run_of,) = set_up_filters(prepare(early), [FilterName.CKF])
    with new_estimate(tmp_path / "early.h5", run_of.header) as writer:
        writer.finish(run_of.run(writer.append))
    new = run(tmp_path / "early.h5", results / "dataset.h5", "--use", f"{half + 0.1}:1000", "-o", tmp_path / "out")
    assert new.exit_code in (0, 1), new.stderr
    assert (tmp_path / "out/tables/validation.csv").is_file()
    seen = run(tmp_path / "early.h5", results / "dataset.h5", "--use", f"{half - 5.0}:1000", "-o", tmp_path / "seen")
    assert seen.exit_code == 2
    assert "the same data" in seen.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_several_datasets_and_segments_are_judged_together(results, simulated_with, tmp_path):
    write_dataset(tmp_path / "other.h5", simulated_with(CIRCLE, WHITE, "seed=6"))
    some, estimate = ("--use", "0:20", "--use", "25:60"), results / "estimates/ckf.h5"
    result = run(estimate, results / "circle.h5", tmp_path / "other.h5", *some, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    with (tmp_path / "out/tables/validation.csv").open(encoding="utf-8") as file:
        free = {row["signal"]: row for row in csv.DictReader(file) if row["kind"] == "free_run"}
    rate = 25.0
    assert float(free["p"]["measurements"]) == pytest.approx(2 * (18.0 + 31.5) * rate, rel=0.05)
    assert read_dataset(tmp_path / "out/dataset.h5").sha256 == read_dataset(results / "circle.h5").sha256
    own = run(estimate, results / "circle.h5", results / "dataset.h5", "-o", tmp_path / "own")
    assert own.exit_code == 2
    assert "the same data" in own.stderr
