import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import typer
import yaml
from typer.testing import CliRunner

from auvid_cli.cli.data import import_log
from auvid_cli.config.enums import shipped_configs
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, SENSORS

MAP = f"""\
name: sea_trial
vehicle: {shipped_configs() / "vehicles" / "vt690.yaml"}
identification: {{filters: [ckf]}}
logs: {{rates: gyroscope.csv, velocity: dvl.csv, angles: attitude.csv, commands: inputs.csv}}
time: time
sensors:
  gyroscope: {{log: rates, columns: {{p: p, q: q, r: r}}, standard_deviation: 0.07 deg/s}}
  dvl: {{log: velocity, columns: {{u: u, v: v, w: w}}, standard_deviation: estimate}}
  attitude: {{log: angles, columns: {{phi: phi, theta: theta, psi: psi}}, standard_deviation: 1 deg}}
inputs: {{log: commands, rudder: rudder, elevator: elevator, surge_force: surge_force, roll_moment: roll_moment}}
"""


def auvid_import(*arguments):
    app = typer.Typer()
    app.command()(import_log)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def to_csv(path, names, *columns):
    table = np.column_stack(columns)
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.17g")


@pytest.fixture(scope="module")
def exported(short_run, tmp_path_factory):
    """A simulated run as a vehicle might have logged it: a CSV file per sensor, and its map."""
    folder = tmp_path_factory.mktemp("log")
    for name, record in short_run.sensors.items():
        symbols = [quantity.symbol for quantity in SENSORS[name]]
        to_csv(folder / f"{name}.csv", ["time", *symbols], record.time, record.values)
    to_csv(folder / "inputs.csv", ["time", *INPUT_SYMBOLS], short_run.inputs.time, short_run.inputs.values)
    (folder / "map.yaml").write_text(MAP)
    return folder


@pytest.mark.slow
def test_simulated_run_comes_back_from_its_csv_files(short_run, exported, tmp_path):
    result = auvid_import("--map", exported / "map.yaml", "-o", tmp_path / "dataset.h5")
    assert result.exit_code == 0, result.output
    imported = read_dataset(tmp_path / "dataset.h5")
    assert imported.truth is None
    assert set(imported.sensors) == {"gyroscope", "dvl", "attitude"}
    for name, record in imported.sensors.items():
        assert record.time == pytest.approx(short_run.sensors[name].time, abs=1e-12)
        assert record.values == pytest.approx(short_run.sensors[name].values, abs=1e-12, nan_ok=True)
    assert imported.inputs.time == pytest.approx(short_run.inputs.time, abs=1e-12)
    assert imported.inputs.values == pytest.approx(short_run.inputs.values, abs=1e-12)
    run = imported.experiment
    assert (run.name, run.recording.map, run.recording.origin) == ("sea_trial", MAP, 0.0)
    assert [file.name for file in run.recording.files] == ["gyroscope.csv", "dvl.csv", "attitude.csv", "inputs.csv"]
    assert all(re.fullmatch("[0-9a-f]{64}", file.sha256) for file in run.recording.files)


@pytest.mark.slow
def test_import_prints_summary_and_next_command(exported, tmp_path):
    result = auvid_import("--map", exported / "map.yaml", "-o", tmp_path / "dataset.h5")
    assert re.search(r"dvl +7 +421 +0 +60 +\d+ +0", result.output)
    assert "dvl: standard deviation estimated from the signal: " in result.output
    assert f"auvid inspect {tmp_path / 'dataset.h5'}" in "".join(result.output.split("\n"))


@pytest.mark.slow
def test_import_writes_to_results_folder_by_default(exported, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert auvid_import("--map", exported / "map.yaml", "-q").output == ""
    assert (tmp_path / "results" / "sea_trial" / "dataset.h5").is_file()


def test_log_argument_overrides_log_of_map(exported, tmp_path):
    result = auvid_import("velocity=none.csv", "--map", exported / "map.yaml", "-o", tmp_path / "d.h5")
    assert result.exit_code == 2
    assert "none.csv: no such file" in result.output
    assert not (tmp_path / "d.h5").exists()


@pytest.mark.slow
def test_suggested_map_of_exported_logs_imports_once_it_is_filled_in(short_run, exported, tmp_path):
    logs = [exported / f"{name}.csv" for name in ("gyroscope", "dvl", "attitude", "inputs")]
    path = tmp_path / "map.yaml"
    assert auvid_import("--suggest", *logs, "-o", path).exit_code == 0
    refused = auvid_import("--map", path, "-o", tmp_path / "d.h5")
    assert refused.exit_code == 2
    assert "sensors.dvl.unit: got nothing" in refused.output
    text = re.sub(
        r"(?s)vehicle: #.*?logs:", f"vehicle: {shipped_configs()}/vehicles/vt690.yaml\nlogs:", path.read_text()
    )
    text = text.replace("unit: null # required: m/s", "unit: m/s # m/s")
    path.write_text(text.replace("standard_deviation: null", "standard_deviation: estimate"))
    result = auvid_import("--map", path, "-o", tmp_path / "d.h5")
    assert result.exit_code == 0, result.output
    imported = read_dataset(tmp_path / "d.h5")
    for name in ("gyroscope", "dvl", "attitude"):
        assert imported.sensors[name].values == pytest.approx(short_run.sensors[name].values, abs=1e-12, nan_ok=True)
    assert imported.inputs.values == pytest.approx(short_run.inputs.values, abs=1e-12)


def test_map_sets_layout_of_text_files(tmp_path):
    rows = [f"{k / 10};{2 + k / 8};{k % 3}".replace(".", ",") for k in range(50)]
    rows[7] = "0,7;gone;1"
    log = tmp_path / "log.txt"
    log.write_text("\n".join(["Boat 7", "made by hand; all of it", "time;speed (kn);rudder [deg]", *rows]))
    path = tmp_path / "map.yaml"
    path.write_text(
        f"name: boat\nvehicle: {shipped_configs()}/vehicles/lauv.yaml\n"
        "logs: {log: {file: log.txt, delimiter: ;, header_row: 3, decimal: ',', missing: [gone]}}\n"
        "time: time\nsensors:\n  dvl: {columns: {u: speed (kn)}, standard_deviation: 1 cm/s}\n"
        "inputs: {rudder: rudder}\n"
    )
    result = auvid_import("--map", path, "-o", tmp_path / "d.h5")
    assert result.exit_code == 0, result.output
    imported = read_dataset(tmp_path / "d.h5")
    expected = (2 + np.arange(50) / 8) * 1852 / 3600
    expected[7] = np.nan
    assert imported.sensors["dvl"].values[:, 0] == pytest.approx(expected, nan_ok=True)
    assert np.isnan(imported.sensors["dvl"].values[:, 1:]).all()
    assert imported.inputs.values[:, 0] == pytest.approx(np.radians(np.arange(50) % 3))


def test_units_in_cells_and_under_the_names_are_suggested_and_imported(tmp_path):
    log, path = tmp_path / "log.csv", tmp_path / "map.yaml"
    rows = [f"{100 * k},{k % 7}.5 deg,{k % 3} deg,{k} cm/s,{k % 5}" for k in range(50)]
    log.write_text("\n".join(["time,roll,pitch,u,rudder", "ms,,,,deg", *rows]) + "\n")
    assert auvid_import("--suggest", log, "-o", path).exit_code == 0
    text = re.sub(
        r"(?s)vehicle: #.*?logs:", f"vehicle: {shipped_configs()}/vehicles/lauv.yaml\nlogs:", path.read_text()
    )
    path.write_text(text.replace("standard_deviation: null", "standard_deviation: 0.1"))
    result = auvid_import("--map", path, "-o", tmp_path / "d.h5")
    assert result.exit_code == 0, result.output
    imported, k = read_dataset(tmp_path / "d.h5"), np.arange(50)
    assert imported.sensors["attitude"].values[:, :2] == pytest.approx(
        np.radians(np.column_stack((k % 7 + 0.5, k % 3)))
    )
    assert imported.sensors["dvl"].values[:, 0] == pytest.approx(0.01 * k)
    assert imported.sensors["dvl"].time == pytest.approx(0.1 * k)
    assert imported.inputs.values[:, 0] == pytest.approx(np.radians(k % 5))


TWO_FILES = f"""\
name: boat
vehicle: {shipped_configs()}/vehicles/lauv.yaml
logs: {{log: [a.csv, b.csv]}}
time: time
sensors: {{dvl: {{columns: {{u: u}}, standard_deviation: 1 cm/s}}}}
inputs: {{rudder: dr}}
"""


@pytest.mark.parametrize(
    ("begin", "message", "code"),
    [
        (5.0, None, 0),  # goes on
        (4.55, "from 4.550 to 4.900 s", 0),
        (
            0.0,
            "from 0.000 to 4.900 s",
            2,
        ),
    ],
)
def test_overlapping_clocks_are_reported_or_refused(tmp_path, begin, message, code):
    for name, start, speed in (("a", 0.0, 2.0), ("b", begin, 3.0)):
        time = start + np.arange(50) / 10
        to_csv(tmp_path / f"{name}.csv", ["time", "u", "dr"], time, speed + np.sin(time), 0.1 * np.cos(time))
    (tmp_path / "map.yaml").write_text(TWO_FILES)
    result = auvid_import("--map", tmp_path / "map.yaml", "-o", tmp_path / "d.h5")
    assert result.exit_code == code, result.output
    output = " ".join(result.output.split())
    assert message in output if message else "file 2" not in output
    if code:
        assert "map.yaml:5:11: sensors.dvl: " in output


@pytest.mark.parametrize("arguments", [[], ["--suggest"], ["--suggest", "x.csv", "--map", "m.yaml"], ["x.csv"]])
def test_invalid_call_is_one_line(arguments):
    result = auvid_import(*arguments)
    assert result.exit_code == 2
    assert "auvid: " in result.output
    assert "--suggest" in result.output


def test_suggest_and_map_exclude_each_other():
    result = auvid_import("--suggest", "x.csv", "--map", "m.yaml")
    assert "--suggest and --map: expected one of them" in result.stderr


@pytest.mark.slow
def test_interrupt_during_imports_is_one_line():
    """Raised as the settings classes are built, where pydantic would make a SchemaError of it."""
    code = """
import os, signal, sys
from importlib.abc import MetaPathFinder

class Interrupting(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "auvid_cli.config.log_map":
            os.kill(os.getpid(), signal.SIGINT)
            raised.append(name)

raised = []
sys.meta_path.insert(0, Interrupting())
from auvid_cli.cli.data import import_log
try:
    import_log(map_file="map.yaml", quiet=False, verbose=False)
except SystemExit as end:
    print(raised, end.code)
"""
    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert imported.stdout == "['auvid_cli.config.log_map'] 130\n", imported.stderr
    assert imported.stderr == "auvid: interrupted; files already written are complete\n"


def test_command_loads_nothing_heavy_before_it_runs():
    heavy = ("numpy", "pandas", "h5py", "pydantic")
    code = f"import sys, auvid_cli.cli.data; print([name for name in {heavy} if name in sys.modules])"
    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert imported.stdout.strip() == "[]"


@pytest.mark.parametrize("target", ["dvl.csv", "map.yaml"])
def test_import_never_overwrites_its_inputs(exported, tmp_path, target):
    folder = tmp_path / "log"
    shutil.copytree(exported, folder)
    before = (folder / target).read_bytes()
    result = auvid_import("--map", folder / "map.yaml", "-o", folder / target)
    assert result.exit_code == 2
    assert "would be written over" in result.stderr
    suggested = auvid_import("--suggest", folder / "dvl.csv", "-o", folder / target)
    assert suggested.exit_code == 2
    assert "exists already" in suggested.stderr
    assert (folder / target).read_bytes() == before


@pytest.fixture
def own_log(exported, tmp_path):
    """A copy of the logs with its own vehicle file, and the dataset imported from them."""
    folder = tmp_path / "log"
    shutil.copytree(exported, folder)
    shutil.copy(shipped_configs() / "vehicles" / "vt690.yaml", folder / "v.yaml")
    (folder / "map.yaml").write_text(re.sub("vehicle: .*", "vehicle: v.yaml", MAP))
    assert auvid_import("--map", folder / "map.yaml", "-o", tmp_path / "d.h5").exit_code == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("link", [None, "symlink_to", "hardlink_to"])
def test_import_never_overwrites_vehicle_file_of_map(own_log, tmp_path, link):
    vehicle, output = own_log / "v.yaml", tmp_path / "linked.yaml"
    before = vehicle.read_bytes()
    if link is None:
        output = vehicle
    else:
        getattr(output, link)(vehicle)
    for options in ((), ("--overwrite",)):
        result = auvid_import("--map", own_log / "map.yaml", "-o", output, *options)
        assert result.exit_code == 2
        assert "would be written over" in result.stderr
    assert vehicle.read_bytes() == before


@pytest.mark.slow
def test_another_import_is_replaced_only_when_asked(own_log, tmp_path):
    path = tmp_path / "d.h5"
    before = path.read_bytes()
    assert auvid_import("--map", own_log / "map.yaml", "-o", path).exit_code == 0
    assert path.read_bytes() == before, "the same logs by the same map are the same data"
    (own_log / "map.yaml").write_text((own_log / "map.yaml").read_text().replace("1 deg", "2 deg"))
    result = auvid_import("--map", own_log / "map.yaml", "-o", path)
    assert result.exit_code == 2
    assert "d.h5: was made with other settings of `recording`" in result.stderr
    assert path.read_bytes() == before
    assert auvid_import("--map", own_log / "map.yaml", "-o", path, "--overwrite").exit_code == 0
    assert path.read_bytes() != before


@pytest.mark.slow
def test_import_replaces_only_datasets(own_log, tmp_path):
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    result = auvid_import("--map", own_log / "map.yaml", "-o", notes)
    assert result.exit_code == 2
    assert "notes.txt" in result.stderr
    assert notes.read_text() == "mine"
    assert auvid_import("--map", own_log / "map.yaml", "-o", "/dev/null", "--overwrite").exit_code == 2


def test_vehicle_of_suggested_map_is_named(exported, tmp_path):
    log = exported / "dvl.csv"
    path = tmp_path / "map.yaml"
    assert auvid_import("--suggest", log, "--like", "remus100", "-o", path).exit_code == 0
    assert "\nvehicle: vehicles/remus100.yaml\n" in path.read_text()
    own = tmp_path / "mine.yaml"
    own.write_text((shipped_configs() / "vehicles" / "vt690.yaml").read_text())
    result = auvid_import("--suggest", log, "--vehicle", own, "-o", tmp_path / "own.yaml")
    assert result.exit_code == 0
    assert "\nvehicle: mine.yaml\n" in (tmp_path / "own.yaml").read_text()


def test_prior_of_suggested_map_is_at_values_of_named_vehicle(exported, tmp_path):
    log, own = exported / "dvl.csv", tmp_path / "own.yaml"
    own.write_text((shipped_configs() / "vehicles" / "vt690.yaml").read_text())
    assert auvid_import("--suggest", log, "--vehicle", own, "-o", tmp_path / "map.yaml").exit_code == 0
    identification = yaml.safe_load((tmp_path / "map.yaml").read_text())["identification"]
    assert identification == {"prior": {"mean": "vehicle"}, "tolerances": "usual"}
    assert auvid_import("--suggest", log, "-o", tmp_path / "asking.yaml").exit_code == 0
    assert yaml.safe_load((tmp_path / "asking.yaml").read_text())["identification"] == {"tolerances": "usual"}


@pytest.mark.parametrize(
    "arguments", [("--like", "submarine"), ("--vehicle", "nowhere.yaml"), ("--like", "vt690", "--vehicle", "x.yaml")]
)
def test_unknown_vehicle_is_refused(exported, arguments):
    result = auvid_import("--suggest", exported / "dvl.csv", *arguments)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
