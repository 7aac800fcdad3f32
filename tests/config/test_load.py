from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from auvid_cli.config import enums
from auvid_cli.config.enums import FilterName, shipped_configs
from auvid_cli.config.loading import dump_experiment, find_experiment, load_experiment, parse_experiment
from auvid_cli.config.manoeuvre import Recorded, Spiral
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.parameters import PARAMETERS
from auvid_cli.vehicle.rigid_body import mass_matrix

VEHICLES = ("vt690", "remus100", "lauv", "lrauv", "dive")


def vehicle_file(name: str) -> Path:
    return shipped_configs() / "vehicles" / f"{name}.yaml"


def test_load_equals_parse_of_text(text, tmp_path):
    path = tmp_path / "e.yaml"
    path.write_text(text)
    experiment = load_experiment(path, ["seed=7"])
    assert experiment == parse_experiment(text, "x", ["seed=7"])
    assert experiment.seed == 7
    assert isinstance(experiment.manoeuvre, Spiral)
    assert experiment.sensors.dvl.noise == (0.001,)
    assert experiment.vehicle.all_coefficients()["X_u|u|"] == -1.62


@pytest.mark.parametrize("name", VEHICLES)
def test_shipped_vehicle_round_trips(experiment_text, name):
    experiment = parse_experiment(experiment_text(name), name)
    again = parse_experiment(dump_experiment(experiment), "dump")
    assert again == experiment
    assert again.vehicle.all_coefficients() == experiment.vehicle.all_coefficients()


@pytest.mark.parametrize("name", VEHICLES)
def test_shipped_vehicle_is_complete_with_sources(experiment_text, name):
    vehicle = parse_experiment(experiment_text(name), name).vehicle
    assert list(vehicle.all_coefficients()) == [c.symbol for c in COEFFICIENTS]
    assert list(vehicle.known_parameters()) == [p.symbol for p in PARAMETERS]
    assert mass_matrix(vehicle.known_parameters()).shape == (6, 6)
    entries = yaml.safe_load(vehicle_file(name).read_text())
    for entry in [*entries["parameters"].values(), *entries["coefficients"].values()]:
        assert entry["status"].split(":")[0].split()[0] in ("read", "derived", "assumed")
    k = vehicle.known_parameters()
    means = k["M_wdot"] != k["Z_qdot"] or k["N_vdot"] != k["Y_rdot"]
    assert means == any("mean of each pair" in note for note in vehicle.notes)


def test_inertia_of_dive_is_that_of_its_cylinder(experiment_text):
    vehicle = parse_experiment(experiment_text("dive"), "dive").vehicle
    k, radius, length = vehicle.known_parameters(), vehicle.size.diameter / 2, vehicle.size.length
    assert k["m"] * radius**2 / 2 == pytest.approx(k["Ixx"], rel=0.002)
    assert k["m"] * (3 * radius**2 + length**2) / 12 == pytest.approx(k["Iyy"], rel=0.002)


def test_linear_damping_of_lauv_is_included_at_trim_speed(experiment_text):
    vehicle = parse_experiment(experiment_text("lauv"), "lauv").vehicle
    coefficients, speed = vehicle.all_coefficients(), 1.43
    assert coefficients["X_u|u|"] == pytest.approx(-2.4 - 2.4 / speed, rel=1e-5)
    assert coefficients["M_uwl"] == pytest.approx(-6.0 + 3.1 / speed, rel=1e-5)
    assert -coefficients["X_u|u|"] * speed**2 == pytest.approx(vehicle.known_parameters()["X_prop"], rel=1e-4)


@pytest.mark.slow
@given(
    noise=st.just(0.0) | st.floats(1e-9, 1e6),
    bias=st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3),
    status=st.text(),
)
@settings(max_examples=15)
def test_numbers_and_text_round_trip_exactly(experiment_text, noise, bias, status):
    plain = experiment_text("vt690")
    words = yaml.safe_dump({"value": 1e-5, "status": status}, default_flow_style=True, width=1e9).strip()
    overrides = [
        f"sensors.dvl.noise={noise!r}",
        f"sensors.dvl.bias={bias!r}",
        f"vehicle.coefficients.Y_url={words}",
    ]
    experiment = parse_experiment(plain, "x", overrides)
    assert experiment.sensors.dvl.bias == tuple(bias)
    assert parse_experiment(dump_experiment(experiment), "dump") == experiment


def test_dump_has_si_numbers_by_symbol(text):
    dumped = yaml.safe_load(dump_experiment(parse_experiment(text, "x", ["sensors.dvl.noise=1e-5"])))
    assert dumped["vehicle"]["coefficients"]["X_u|u|"] == {"value": -1.62, "status": "read"}
    assert dumped["sensors"]["dvl"]["noise"] == [1e-5]
    assert dumped["identification"]["filters"] == ["ekf", "ckf", "tukf"]
    assert "range" not in dumped["sensors"]["dvl"]


def test_recorded_manoeuvre_keeps_its_file(text):
    override = "manoeuvre={type: recorded, file: run.csv, duration: 10 s, speed: 2}"
    experiment = parse_experiment(text, "x", [override])
    assert isinstance(experiment.manoeuvre, Recorded)
    assert experiment.manoeuvre.file == str(Path.cwd() / "run.csv")
    assert parse_experiment(dump_experiment(experiment), "dump") == experiment


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "1:1: expected a mapping"),
        (b"- 1\n", "1:1: expected a mapping"),
        (b"name: a\nvehicle: b\xff\n", "2:11: not UTF-8 text: byte 0xff"),
        ("name: ä\n".encode("utf-16"), "1:1: not UTF-8 text: byte 0xff"),
        (b"name: a\n\tseed: 1\n", "2:1: not valid YAML: a tab"),
    ],
)
def test_invalid_file_is_reported_at_its_position(tmp_path, content, message):
    path = tmp_path / "e.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        load_experiment(path, ["seed=1"])
    assert str(caught.value).startswith(f"{path}:{message}")


def test_byte_order_mark_is_ignored(text, tmp_path):
    path = tmp_path / "e.yaml"
    path.write_text(text, encoding="utf-8-sig")
    assert load_experiment(path).name == "small"


def test_missing_file_and_folder_raise(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.yaml: no such file$"):
        load_experiment(tmp_path / "none.yaml")
    with pytest.raises(ConfigError, match=r"is a folder, not a file$"):
        load_experiment(tmp_path)


def test_find_experiment_finds_files_folders_and_shipped(tmp_path, monkeypatch):
    configs = tmp_path / "configs"
    configs.mkdir()
    (configs / "spiral.yaml").touch()
    (configs / "zigzag.yaml").touch()
    monkeypatch.setattr(enums, "PACKAGE", tmp_path / "package")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "zigzag").mkdir()
    (tmp_path / "mine.yaml").touch()
    assert find_experiment(None) == configs / "spiral.yaml"
    assert find_experiment("zigzag") == configs / "zigzag.yaml"
    assert find_experiment("mine.yaml") == Path("mine.yaml")
    # A folder with an experiment wins over a shipped experiment of that name.
    with pytest.raises(ConfigError, match=r"zigzag: folder without experiment\.yaml"):
        find_experiment(str(tmp_path / "zigzag"))
    (tmp_path / "zigzag" / "experiment.yaml").touch()
    assert find_experiment("zigzag") == Path("zigzag/experiment.yaml")
    for name in ("zagzig", "", "none.yaml"):
        with pytest.raises(ConfigError, match=f"'{name}' is neither a file nor .*: spiral, zigzag$"):
            find_experiment(name)


@pytest.mark.parametrize(
    ("overrides", "filters", "expected"),
    [
        ((), ["ckf", "ekf", "ckf"], ("ckf", "ekf", "smoother")),
        ((), ["smoother", "ekf"], ("smoother", "ekf")),
        (("identification.judge=false",), ["ckf"], ("ckf",)),
        # The smoother cannot have a gate.
        (("identification.gate=6",), ["ckf"], ("ckf",)),
    ],
)
def test_smoother_is_added_unless_disabled_or_gated(overrides, filters, expected, experiment_with):
    settings = experiment_with(*overrides).identification
    assert settings.with_judge([FilterName(name) for name in filters]) == expected
