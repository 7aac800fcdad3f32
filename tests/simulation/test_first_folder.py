"""Files of a first folder: auvid reads each of them."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.log_map import load_map
from auvid_cli.config.outline import outline_of_options
from auvid_cli.data.files import write_folder
from auvid_cli.errors import ConfigError
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.simulation import first_folder
from auvid_cli.simulation.first_folder import folder_like, folder_of_outline, sanity_notes, sanity_rows
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

OUTLINE = {"length": 2, "diameter": 0.2, "mass": 60, "fin_span": 0.1, "fin_area": 0.012}


@pytest.fixture(scope="module", autouse=True)
def short():
    """Spirals of a minute, to be fast."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(first_folder, "MIN_DURATION", 60.0)
        yield


@pytest.fixture(scope="module")
def mine(short):
    return folder_of_outline(Path("mine"), outline_of_options(OUTLINE))


def test_written_files_are_read_by_all_commands(mine, tmp_path):
    write_folder(tmp_path / "mine", mine.texts)
    experiment = load_experiment(find_experiment(str(tmp_path / "mine")))
    assert experiment.name == "mine"
    assert experiment.vehicle == mine.vehicle
    assert [*experiment.sensors.given()] == ["gyroscope", "dvl", "attitude", "depth"]
    # The settings proposed in the file have the speed of its own manoeuvre.
    proposed = re.findall(r"--set \"?([^\"\n ]+(?: m/s)?)", mine.texts["experiment.yaml"])
    assert len(proposed) == 2
    other = load_experiment(find_experiment(str(tmp_path / "mine")), proposed).manoeuvre
    assert (other.type, other.speed) == ("zigzag", pytest.approx(experiment.manoeuvre.speed))
    log, _ = load_map(tmp_path / "mine" / "map.yaml")
    assert (log.vehicle, log.identification.prior.mean) == (mine.vehicle, "geometry")
    assert (
        load_experiment(find_experiment("spiral"), (f"vehicle={tmp_path}/mine/vehicle.yaml",)).vehicle == mine.vehicle
    )


@pytest.mark.slow
@pytest.mark.parametrize("inverted", [False, True])
def test_spiral_passes_inspection_unless_roll_moment_is_inverted(mine, inverted, tmp_path):
    write_folder(tmp_path / "mine", mine.texts)
    data = simulate(load_experiment(find_experiment(str(tmp_path / "mine")), ("manoeuvre.duration=60 s",)))
    values = data.inputs.values.copy()
    if inverted:
        values[:, INPUT_SYMBOLS.index("roll_moment")] *= -1.0
    checks = inspect_dataset(replace(data, inputs=replace(data.inputs, values=values), truth=None)).checks
    failed = {(check.subject, check.check) for check in checks if check.passed is False}
    assert failed == ({("roll_moment", "response of p")} if inverted else set())


def test_map_of_vehicle_without_geometry_has_vehicle_prior(tmp_path):
    write_folder(tmp_path / "d", folder_like(tmp_path / "d", "dive", None).texts)
    log, _ = load_map(tmp_path / "d" / "map.yaml")
    assert log.identification.prior.mean == "vehicle"


def test_derived_numbers_have_status_and_source(mine):
    lines = [line for line in mine.texts["vehicle.yaml"].splitlines() if "{value:" in line]
    assert len(lines) == 46
    assert all("status: " in line for line in lines)
    assert all("source: " in line and "standard_deviation: " in line for line in lines if "derived: G" in line)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["remus100", "vehicles/remus100.yaml"])
def test_shipped_vehicle_is_copied(name):
    folder = folder_like(Path("mine"), name, None)
    assert folder.vehicle.name == "REMUS 100"
    assert folder.texts["vehicle.yaml"].startswith("# As vehicles/remus100.yaml of auvid: REMUS 100")
    assert "speed: 1.544 m/s" in folder.texts["experiment.yaml"]
    assert "speed: 1 m/s" in folder_like(Path("mine"), name, 1.0).texts["experiment.yaml"]


@pytest.mark.parametrize("name", ["remus", "spiral.yaml", "../spiral", "sensors/field.yaml", "", "/etc/passwd"])
def test_unknown_vehicle_raises_with_shipped_ones(name):
    with pytest.raises(ConfigError, match=r"no such vehicle ships.*dive, lauv, lrauv, remus100, vt690"):
        folder_like(Path("mine"), name, None)


@pytest.mark.parametrize(
    ("folder", "name"), [("a b;$x", "a_b_x"), ("-rf", "rf"), ("été", "t_"), ("..hidden", "hidden"), ("水", "first")]
)
def test_experiment_has_valid_name_from_folder(folder, name, tmp_path):
    files = folder_like(tmp_path / folder, "lauv", None)
    write_folder(tmp_path / folder, files.texts)
    assert load_experiment(tmp_path / folder / "experiment.yaml").name == name
    assert files.texts["README.md"].startswith(f"# {name}\n")


def test_sanity_rows_have_values_and_comparison(mine):
    rows = {row.quantity: row for row in sanity_rows(mine.vehicle, mine.spiral)}
    # Nose and tail taper, so the hull displaces between two thirds and all of a full cylinder.
    displaced = float(rows["water displaced by the hull"].value.split()[0])
    assert 0.67 < displaced / (1025.0 * 3.14159 * 0.01 * 2.0) < 1.0
    assert rows["water displaced by the hull"].comparison.startswith("mass 60 kg, ")
    assert rows["length"].comparison.startswith("10 diameters")
    # Fins with a span of 0.1 m and an area of 0.012 m^2.
    assert rows["fin: span, mean chord"][1:] == ("0.1, 0.12 m", "0.5 diameters, 0.06 lengths; 4 fins")
    # m d^2 / 8 of a full cylinder.
    assert rows["inertia about x"].comparison == "full cylinder: 0.3 kg m^2"
    assert [*sanity_notes(mine.vehicle, mine.spiral)] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "note"),
    [
        ({"length": 4, "mass": 115}, "length is 20 diameters; expected 4 to 15"),
        ({"mass": 70}, r"mass is 70 kg; expected about the 5\d\.\d* kg of water that the hull displaces"),
        ({"length": 1, "mass": 25, "speed": 6}, r"the spiral has \d\d% of the usual excitation"),
    ],
)
def test_implausible_vehicle_gives_note(change, note):
    folder = folder_of_outline(Path("mine"), outline_of_options(OUTLINE | change))
    notes = [*sanity_notes(folder.vehicle, folder.spiral)]
    assert any(re.search(note, text) for text in notes), notes


def test_short_vehicle_without_geometry_gives_note():
    folder = folder_like(Path("d"), "dive", None)
    assert "length is 3.84 diameters; expected 4 to 15 for a torpedo-shaped vehicle" in [
        *sanity_notes(folder.vehicle, folder.spiral)
    ]
