"""Shipped settings: folder, descriptions and parts."""

import pytest

from auvid_cli.config import enums
from auvid_cli.config.enums import KINDS, shipped_configs, shipped_files, shipped_part
from auvid_cli.config.loading import load_experiment


def test_configs_inside_the_package_come_first(tmp_path, monkeypatch):
    monkeypatch.setattr(enums, "PACKAGE", tmp_path / "package")
    assert shipped_configs() == tmp_path / "configs"
    (tmp_path / "package" / "configs").mkdir(parents=True)
    assert shipped_configs() == tmp_path / "package" / "configs"


def test_every_shipped_file_has_kind_and_description():
    files = [file for kind in KINDS for file in shipped_files(kind)]
    assert len(files) == len([*shipped_configs().rglob("*.yaml")])
    for name, description in files:
        assert description[-1] in ".?", name
        assert 20 < len(description) <= 95, name


def test_description_is_comment_in_first_line(tmp_path, monkeypatch):
    monkeypatch.setattr(enums, "PACKAGE", tmp_path)
    for file in ("configs/a.yaml", "configs/vehicles/b.yaml"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("# A thing.\n# More of it.\nname: b\n")
    assert shipped_files("experiments") == [("a", "A thing.")]
    assert shipped_files("vehicles") == [("vehicles/b.yaml", "A thing.")]


@pytest.mark.parametrize("name", ["vehicles", "vehicles/none.yaml", "vehicles/../spiral.yaml", "../pyproject.toml", ""])
def test_unknown_part_is_none(name):
    assert shipped_part(name) is None


def test_absolute_name_is_none():
    assert shipped_part(str(shipped_configs() / "spiral.yaml")) is None


def test_parts_next_to_experiment_win_over_shipped(tmp_path, monkeypatch):
    # As after an installation: no settings in the current folder.
    monkeypatch.chdir(tmp_path)
    own = tmp_path / "mine"
    own.mkdir()
    parts = "vehicle: vehicles/lauv.yaml\nsensors: sensors/table_iii.yaml\nmanoeuvre: manoeuvres/zigzag_20_20.yaml\n"
    (own / "e.yaml").write_text(f"name: e\n{parts}")
    experiment = load_experiment(own / "e.yaml")
    assert (experiment.vehicle.name, experiment.manoeuvre.name) == ("LAUV", "zigzag 20/20")
    text = (shipped_configs() / "vehicles/lauv.yaml").read_text().replace("name: LAUV", "name: mine")
    (own / "vehicles").mkdir()
    (own / "vehicles/lauv.yaml").write_text(text)
    assert load_experiment(own / "e.yaml").vehicle.name == "mine"
    assert load_experiment(own / "e.yaml", ("vehicle=vehicles/remus100.yaml",)).vehicle.name == "REMUS 100"
