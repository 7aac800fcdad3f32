import json
import os
import shutil
import sys
import typing
from pathlib import Path

import h5py
import numpy as np
import pytest
import typer
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from auvid_cli.cli.data import export
from auvid_cli.config.enums import FilterName, FormatName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate_file import write_estimate
from auvid_cli.data.files import products
from auvid_cli.identification.run import identify

SUFFIXES = {"yaml": ".yaml", "json": ".json", "python": ".py", "matlab": ".m", "sdf": ".sdf"}
SUFFIXES |= {"holoocean": "_holoocean.py", "simulator": "_simulator.py", "mss": "_mss.m"}


def run(*arguments):
    app = typer.Typer()
    app.command()(export)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def results(simulated_with, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    write_dataset(folder / "dataset.h5", simulated_with("manoeuvre.duration=30 s"))
    estimate = identify(read_dataset(folder / "dataset.h5"), FilterName.TUKF)
    write_estimate(folder / "estimates/tukf.h5", estimate)
    return folder


@pytest.fixture
def own_results(results, tmp_path) -> Path:
    """A copy to do harm to."""
    return Path(shutil.copytree(results, tmp_path / "own"))


def assert_one_clear_complaint(result, *words):
    assert result.exit_code == 2
    assert result.stderr.startswith("auvid: ")
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("target", list(SUFFIXES))
def test_every_format_is_written_with_its_remarks(target, results):
    result = run(results / "estimates/tukf.h5", "--to", target)
    assert result.exit_code == 0, result.stderr
    path = results / f"export/virginia_tech_690_tukf{SUFFIXES[target]}"
    assert str(path) in result.stdout
    text = path.read_text(encoding="utf-8")
    if target == "json":
        assert "Nothing is lost." in result.stdout
        assert json.loads(text)["lost"] == {"terms": [], "notes": []}
    elif target == "sdf":
        assert "Fins are lift-drag surfaces" in result.stdout
        assert "Fins are lift-drag surfaces" in text
    else:
        assert "No term of the equations of motion is lost." in result.stdout
        assert "No term of the equations of motion is lost." in text


def test_all_formats_are_tested():
    assert {*SUFFIXES, "mcap"} == {name.value for name in FormatName}


@pytest.mark.slow
def test_diverged_run_is_written_as_mcap(own_results):
    with h5py.File(own_results / "estimates/tukf.h5", "r+") as file:
        file.attrs["status"] = "diverged at t = 9.000 s: the state was not finite"
    estimate, path = own_results / "estimates/tukf.h5", own_results / "export/virginia_tech_690_tukf.mcap"
    result = run(estimate, "--to", "mcap")
    assert result.exit_code == 0, result.stderr
    assert "diverged: at t = 9.000 s" in result.stdout
    assert "dead reckoned" in result.stdout
    assert path.read_bytes().startswith(b"\x89MCAP")
    assert path in products(own_results)
    assert run(estimate, "--to", "mcap").exit_code == 0
    path.write_bytes(b"\x89MCAP of somebody else")
    assert_one_clear_complaint(run(estimate, "--to", "mcap"), "was not exported from the same data", "--overwrite")


def test_mcap_without_packages_is_one_error(results, tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "auvid_cli.export.mcap_file", raising=False)
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    result = run(results / "estimates/tukf.h5", "--to", "mcap", "-o", tmp_path / "run.mcap")
    assert_one_clear_complaint(result, "pip install '.[ros]'")


def test_python_file_simulates(results, tmp_path, monkeypatch):
    assert run(results / "estimates/tukf.h5", "--to", "python", "-o", tmp_path / "vt690_found.py", "-q").stdout == ""
    monkeypatch.syspath_prepend(tmp_path)
    import vt690_found  # pyright: ignore

    monkeypatch.delitem(sys.modules, "vt690_found")
    start = [3.9, *np.zeros(8)]
    thrust = [0.0, 0.0, 73.8, 0.0]
    solution = solve_ivp(lambda t, motion: vt690_found.motion_derivative(motion, thrust), (0.0, 10.0), start, rtol=1e-8)
    assert solution.success
    assert solution.y[0, -1] == pytest.approx(3.9, abs=0.05)


def test_yaml_file_loads_as_vehicle(results, tmp_path):
    path = tmp_path / "found.yaml"
    assert run(results / "estimates/tukf.h5", "--to", "yaml", "-o", path).exit_code == 0
    vehicle = load_experiment(find_experiment(None), (f"vehicle={path}",)).vehicle
    with h5py.File(results / "estimates/tukf.h5") as file:
        state = list(typing.cast(h5py.Dataset, file["state"]).asstr()[...])
        final = dict(zip(state, typing.cast(h5py.Dataset, file["mean"])[-1], strict=True))
    assert vehicle.all_coefficients() == {symbol: final[symbol] for symbol in vehicle.all_coefficients()}


def test_a_diverged_estimate_is_refused_and_nothing_is_written(own_results, tmp_path):
    with h5py.File(own_results / "estimates/tukf.h5", "r+") as file:
        file.attrs["status"] = "diverged at t = 9.000 s: the state was not finite"
    result = run(own_results / "estimates/tukf.h5", "--to", "json", "-o", tmp_path / "model.json")
    assert_one_clear_complaint(result, "tukf diverged at t = 9.000 s", "nothing is exported")
    assert not (tmp_path / "model.json").exists()


def test_another_dataset_is_refused(own_results):
    with h5py.File(own_results / "dataset.h5", "r+") as file:
        file.attrs["remark"] = "not the same any more"
    assert_one_clear_complaint(run(own_results / "estimates/tukf.h5", "--to", "sdf"), "dataset.h5", "--dataset")


@pytest.mark.slow
def test_the_dataset_may_be_elsewhere(own_results, tmp_path):
    (own_results / "dataset.h5").rename(tmp_path / "mission.h5")
    lonely = own_results / "estimates/tukf.h5"
    assert_one_clear_complaint(run(lonely, "--to", "json"), "dataset not found", "--dataset")
    assert run(lonely, "--to", "json", "--dataset", tmp_path / "mission.h5").exit_code == 0


@pytest.mark.parametrize(("target", "name"), [("python", "my-model.py"), ("matlab", "690.m"), ("mss", "a.b.m")])
def test_invalid_function_name_is_refused(target, name, results, tmp_path):
    result = run(results / "estimates/tukf.h5", "--to", target, "-o", tmp_path / name)
    assert_one_clear_complaint(result, "not a valid name", repr(Path(name).stem))
    assert not (tmp_path / name).exists()


def test_missing_estimate_is_one_line(tmp_path):
    assert_one_clear_complaint(run(tmp_path / "nothing.h5", "--to", "yaml"), "nothing.h5")


def test_export_does_not_overwrite_estimate(own_results):
    estimate = own_results / "estimates/tukf.h5"
    before = estimate.read_bytes()
    result = run(estimate, "--to", "json", "-o", estimate)
    assert_one_clear_complaint(result, "would be written over")
    assert estimate.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("target", ["yaml", "json", "sdf"])
@pytest.mark.parametrize("name", ["é", os.fsdecode(b"\xff")], ids=["accent", "no text"])
def test_file_name_may_have_undecodable_bytes(target, name, results, tmp_path):
    path = tmp_path / f"{name}{SUFFIXES[target]}"
    result = run(results / "estimates/tukf.h5", "--to", target, "-o", path)
    assert result.exit_code == 0, result.stderr
    assert path.read_text(encoding="utf-8")
