import os
from pathlib import Path

import pytest

from auvid_cli.api.files import read_dataset
from auvid_cli.config.loading import assemble, find_experiment, load_experiment, read_source
from auvid_cli.errors import ConfigError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "vehicles").mkdir()
    (tmp_path / "vehicles" / "a.yaml").write_text("name: a\nsize: {length: 1 m}\n")
    (tmp_path / "vehicles" / "b.yaml").write_text("name: b\n")
    (tmp_path / "e.yaml").write_text(
        "name: e\nvehicle: vehicles/a.yaml\n"
        "sensors: {dvl: {noise: [1, 2, 3], rate: 7 Hz}}\nmanoeuvre: {file: run.csv}\n"
    )
    return tmp_path


def assembled(folder: Path, *overrides: str):
    tree, mistakes = assemble(read_source(folder / "e.yaml"), overrides)
    return tree, [str(mistake) for mistake in mistakes]


def data(folder: Path, *overrides: str):
    tree, mistakes = assembled(folder, *overrides)
    assert mistakes == []
    return tree.data


def test_referenced_file_keeps_its_positions(folder):
    tree, _ = assembled(folder)
    *_, node = tree.descend(("vehicle", "size", "length"))
    assert node.content == "1 m"
    assert str(node.at) == f"{folder / 'vehicles' / 'a.yaml'}:2:16"


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("name=f", ("name",), "f"),
        ("seed=3", ("seed",), 3),
        ("vehicle.size.length=2 m", ("vehicle", "size", "length"), "2 m"),
        ("vehicle.coefficients.X_u|u|=-2 kg/m", ("vehicle", "coefficients", "X_u|u|"), "-2 kg/m"),
        ("sensors.dvl.noise.1=9", ("sensors", "dvl", "noise"), [1, 9, 3]),
        ("sensors.dvl.noise=[4, 5, 6]", ("sensors", "dvl", "noise"), [4, 5, 6]),
        ("sensors.dvl={rate: 1 Hz}", ("sensors", "dvl"), {"rate": "1 Hz"}),
        ("identification.ekf.transition=exact", ("identification",), {"ekf": {"transition": "exact"}}),
        ("name=a=b", ("name",), "a=b"),
        ("seed=", ("seed",), None),
    ],
)
def test_override_sets_value(folder, override, path, value):
    found = data(folder, override)
    for key in path:
        found = found[key]
    assert found == value


def test_last_override_wins(folder):
    assert data(folder, "seed=1", "seed=2")["seed"] == 2


def test_override_has_its_own_position(folder):
    tree, _ = assembled(folder, "vehicle.size={length: 3 furlong}")
    *_, node = tree.descend(("vehicle", "size", "length"))
    assert str(node.at) == "--set vehicle.size={length: 3 furlong}"


@pytest.mark.parametrize("override", ["seed", "=3", "a..b=1", ".a=1", ""])
def test_incomplete_override_is_reported(folder, override):
    _, mistakes = assembled(folder, override)
    (mistake,) = mistakes
    assert mistake.startswith(f"--set {override}: expected key.key=value")


@pytest.mark.parametrize("override", ["name.x=1", "sensors.dvl.noise.3=1", "sensors.dvl.noise=[1"])
def test_override_of_scalar_or_missing_entry_is_reported(folder, override):
    _, (mistake,) = assembled(folder, override)
    assert mistake.startswith(f"--set {override}: ")


def test_section_file_is_relative_to_experiment(folder):
    assert data(folder, "vehicle=vehicles/b.yaml")["vehicle"] == {"name": "b"}


def test_section_file_in_current_folder_wins(folder, tmp_path_factory, monkeypatch):
    here = tmp_path_factory.mktemp("here")
    (here / "vehicles").mkdir()
    (here / "vehicles" / "b.yaml").write_text("name: mine\n")
    monkeypatch.chdir(here)
    assert data(folder, "vehicle=vehicles/b.yaml", "vehicle.source=x")["vehicle"] == {
        "name": "mine",
        "source": "x",
    }


def test_recorded_file_is_relative_to_its_source(folder, tmp_path_factory, monkeypatch):
    (folder / "vehicles" / "m.yaml").write_text("file: ../run.csv\n")
    monkeypatch.chdir(tmp_path_factory.mktemp("here"))
    assert data(folder)["manoeuvre"]["file"] == str(folder / "run.csv")
    assert data(folder, "manoeuvre=vehicles/m.yaml")["manoeuvre"]["file"] == str(folder / "run.csv")
    assert data(folder, "manoeuvre.file=run.csv")["manoeuvre"]["file"] == str(Path.cwd() / "run.csv")
    assert data(folder, "manoeuvre.file=/x/run.csv")["manoeuvre"]["file"] == "/x/run.csv"


@pytest.mark.parametrize(
    ("reference", "reason"),
    [("nope.yaml", "no such file"), ("folder.yaml", "is a folder, not a file")],
)
def test_unreadable_reference_is_reported_at_its_position(folder, reference, reason):
    (folder / "folder.yaml").mkdir()
    (folder / "e.yaml").write_text(f"name: e\nvehicle: {reference}\n")
    _, mistakes = assembled(folder)
    assert mistakes == [f"{folder / 'e.yaml'}:2:10: vehicle: {folder / reference}: {reason}"]


def test_misspelled_shipped_file_gives_suggestion(folder):
    _, (mistake,) = assembled(folder, "sensors=sensors/table_3.yaml")
    assert "no such file; did you mean 'sensors/table_iii.yaml'" in mistake


def test_folder_with_name_of_shipped_file_is_reported(folder):
    (folder / "vehicles" / "lauv.yaml").mkdir()
    _, (mistake,) = assembled(folder, "vehicle=vehicles/lauv.yaml")
    assert mistake.endswith(f"{folder / 'vehicles' / 'lauv.yaml'}: is a folder, not a file")


@pytest.mark.parametrize("target", ["nowhere.yaml", "lauv.yaml"])
def test_broken_link_with_name_of_shipped_file_is_reported(folder, target):
    (folder / "vehicles" / "lauv.yaml").symlink_to(target)
    _, (mistake,) = assembled(folder, "vehicle=vehicles/lauv.yaml")
    assert "link" in mistake


def test_broken_link_with_name_of_shipped_experiment_is_not_replaced(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("spiral").symlink_to("nowhere")
    with pytest.raises(ValueError, match="link"):
        read_source(find_experiment("spiral"))


@pytest.mark.parametrize("make", [lambda path: os.mkfifo(path), lambda path: path.symlink_to("/dev/zero")])
@pytest.mark.posix
def test_pipe_or_device_raises(tmp_path, make):
    make(tmp_path / "e.yaml")
    with pytest.raises(ValueError, match="pipe or a device"):
        read_source(tmp_path / "e.yaml")


def test_large_file_raises(tmp_path):
    (tmp_path / "e.yaml").write_text("#" * 1_000_001)
    with pytest.raises(ValueError, match="larger than 1 MB"):
        read_source(tmp_path / "e.yaml")


def test_deeply_nested_override_is_reported(folder):
    _, (mistake,) = assembled(folder, f"{'a.' * 2000}a=1")
    assert "2001 nested keys" in mistake


def test_invalid_yaml_in_reference_is_reported_in_its_file(folder):
    (folder / "vehicles" / "a.yaml").write_text("name: a\nsize: {length: 1 m\n")
    _, (mistake,) = assembled(folder)
    assert mistake.startswith(f"{folder / 'vehicles' / 'a.yaml'}:3:1: vehicle: not valid YAML")


def test_only_sections_name_files(folder):
    (folder / "e.yaml").write_text("name: vehicles/a.yaml\n")
    assert data(folder) == {"name": "vehicles/a.yaml"}


def test_yaml_file_as_override_has_its_own_positions(tmp_path):
    file = tmp_path / "tuned.yaml"
    file.write_text("identification:\n  process_noise: {rate: 2e-3}\n")
    experiment = load_experiment(find_experiment("spiral"), ("identification.process_noise.rate=1", str(file)))
    assert experiment.identification.process_noise.rate == pytest.approx((2e-3,))
    assert experiment.identification.process_noise.velocity == pytest.approx((1e-4,))
    file.write_text("identification:\n  process_noise: {rate: -1}\n")
    with pytest.raises(ConfigError, match=r"tuned\.yaml:2:25"):
        load_experiment(find_experiment("spiral"), (str(file),))
    file.write_text("- 1\n")
    with pytest.raises(ConfigError, match=r"tuned\.yaml: expected settings, key: value"):
        load_experiment(find_experiment("spiral"), (str(file),))


def test_override_of_recorded_data_raises(tmp_path):
    (tmp_path / "more.yaml").write_text("seed: 3\n")
    with pytest.raises(ConfigError, match=r"more\.yaml: seed: has no effect"):
        read_dataset(tmp_path / "dataset.h5", str(tmp_path / "more.yaml"))
