"""Python interface of `auvid_cli`."""

import builtins
import doctest
import subprocess
import sys
from dataclasses import replace
from inspect import signature
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray

import auvid_cli as auvid
from auvid_cli.config.enums import FilterName, shipped_configs
from auvid_cli.data.estimate_file import write_estimate
from auvid_cli.errors import AuvidError, ConfigError, DataError, FileError
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS
from auvid_cli.vehicle.parameters import INPUTS, SENSORS

FUNCTIONS = [name for name in auvid.__all__ if name not in ("Dataset", "Estimate")]
pytestmark = pytest.mark.usefixtures("walked_here", "fewer_starts")

HEAVY = ("numba", "numpy", "scipy", "pandas", "h5py", "pydantic", "yaml")


@pytest.fixture(scope="module")
def estimate(short_estimates):
    return short_estimates[FilterName.TUKF]


@pytest.fixture(scope="module")
def other(simulated_with):
    """Another run than `short_run`."""
    return simulated_with("manoeuvre=manoeuvres/zigzag_20_20.yaml", "manoeuvre.duration=25 s", "seed=5")


@pytest.fixture(scope="module")
def files(short_run, estimate, tmp_path_factory):
    """A folder with a dataset, an estimate made from it, and a log with its map."""
    folder = tmp_path_factory.mktemp("files")
    dataset = auvid.write_dataset(folder / "dataset.h5", short_run)
    write_estimate(folder / "tukf.h5", replace(estimate, dataset_sha256=dataset.sha256))
    dvl, inputs = short_run.sensors["dvl"], short_run.inputs
    held = inputs.values[np.searchsorted(inputs.time, dvl.time, side="right") - 1]
    columns, names = np.column_stack([dvl.time, dvl.values, held]), [q.symbol for q in (*SENSORS["dvl"], *INPUTS)]
    np.savetxt(folder / "log.csv", columns, "%.9g", ",", header=",".join(["t", *names]), comments="")
    commands = ", ".join(f"{q.symbol}: {q.symbol}" for q in INPUTS)
    (folder / "map.yaml").write_text(
        f"name: dive\nvehicle: {shipped_configs()}/vehicles/vt690.yaml\nlogs: {{log: log.csv}}\ntime: t\nsensors:\n"
        "  dvl: {log: log, columns: {u: u, v: v, w: w}, standard_deviation: estimate}\n"
        f"inputs: {{log: log, {commands}}}\n",
        encoding="utf-8",
    )
    return folder


@pytest.fixture
def here(files, tmp_path, monkeypatch):
    """Copies of the files in the current folder."""
    for path in files.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_python(code):
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return found.stdout.split()


def test_import_loads_nothing_heavy_and_lists_public_names():
    code = f"import sys, auvid_cli; print(*(name for name in {HEAVY} if name in sys.modules)); print(*dir(auvid_cli))"
    loaded = set(run_python(code))
    assert set(auvid.__all__) <= loaded
    assert loaded.isdisjoint(HEAVY)


@pytest.mark.slow
def test_reading_files_and_drawing_load_no_compiled_code():
    names = "load_experiment, read_dataset, read_estimate, Dataset, Estimate"
    drawing = "import sys, auvid_cli.report.figures.server"
    assert run_python(f"{drawing}; from auvid_cli import {names}; print('numba' in sys.modules)") == ["False"]


def test_public_names_exist_and_others_raise_attribute_error():
    assert all(getattr(auvid, name).__name__ == name for name in auvid.__all__)
    with pytest.raises(AttributeError, match="no attribute 'identfy'"):
        auvid.identfy  # noqa: B018


@pytest.fixture(scope="module")
def seconds(simulated_with):
    """A run of which a few seconds are enough, where data are gone through hundreds of times."""
    return simulated_with("manoeuvre.duration=4 s")


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize("name", FUNCTIONS)
def test_docstring_is_complete_and_its_example_runs(name, here, short_run, seconds, estimate, other, capsys):
    function = getattr(auvid, name)
    for section in ("Parameters", "Returns", "Raises", "Examples"):
        assert f"\n    {section}\n    ---" in function.__doc__
    dataset = seconds if name == "tune" else short_run
    names = {"auvid": auvid, "dataset": dataset, "estimate": estimate, "other": other}
    (example,) = doctest.DocTestFinder(recurse=False).find(function, name, globs=names)
    result = doctest.DocTestRunner().run(example)
    assert result.attempted > 0
    assert result.failed == 0, capsys.readouterr().out


@pytest.mark.slow
def test_nothing_is_printed_and_no_file_is_written_unless_asked(short_run, other, here, capfd):
    before = {path: path.stat().st_mtime_ns for path in here.rglob("*")}
    dataset = auvid.read_dataset("dataset.h5")
    estimate = auvid.identify(dataset, "ckf")
    auvid.inspect(dataset)
    auvid.evaluate(dataset, estimate)
    auvid.check(dataset, estimate)
    auvid.identifiability(dataset)
    auvid.validate(other, estimate)
    auvid.export_model(dataset, estimate, "json")
    auvid.import_logs("map.yaml")
    assert capfd.readouterr() == ("", "")
    assert {path: path.stat().st_mtime_ns for path in here.rglob("*")} == before


@pytest.mark.slow
def test_paths_may_be_path_objects(here):
    dataset = auvid.read_dataset(Path("dataset.h5"))
    assert auvid.write_dataset(Path("copy.h5"), dataset).sha256 == auvid.read_dataset("copy.h5").sha256
    assert auvid.identify(dataset, "tukf", Path("new.h5")).status == auvid.read_estimate(Path("new.h5")).status
    assert auvid.load_experiment(Path(shipped_configs() / "lauv.yaml")) == auvid.load_experiment("lauv")
    assert auvid.import_logs(Path("map.yaml")).sensors["dvl"].values.shape == dataset.sensors["dvl"].values.shape
    assert auvid.import_logs("map.yaml", Path("log.csv")).experiment.name == "dive"
    auvid.export_model(dataset, Path("tukf.h5"), "yaml", Path("model.yaml"))
    assert dataset.sha256 in Path("model.yaml").read_text(encoding="utf-8")


def test_filter_may_be_text_or_enum(short_run, estimate):
    for name in ("tukf", FilterName.TUKF):
        found = auvid.identify(short_run, name)
        assert np.array_equal(found.mean, estimate.mean)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (lambda run, e: auvid.identify(run, "tufk"), "unknown filter 'tufk'; auvid knows ekf"),
        (lambda run, e: auvid.export_model(run, e, "rust"), "unknown format of a model 'rust'; auvid knows yaml"),
        (lambda run, e: auvid.export_model(run, e, "matlab", "9.m"), "'9': not a valid name"),
        (lambda run, e: auvid.export_model(run, e, "mcap"), "mcap: is a format of runs"),
        (lambda run, e: auvid.load_experiment("spirale"), "'spirale' is neither a file nor an experiment"),
        (lambda run, e: auvid.load_experiment("spiral", "sed=3"), "sed"),
    ],
)
def test_unknown_name_is_one_error(wrong, complaint, short_run, estimate, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError) as caught:
        wrong(short_run, estimate)
    assert complaint in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", FUNCTIONS)
def test_wrong_type_is_one_error(name):
    function = getattr(auvid, name)
    needed = [
        p for p in signature(function).parameters.values() if p.default is p.empty and p.kind is not p.VAR_POSITIONAL
    ]
    given = [object() for _ in needed] or [object()]
    with pytest.raises(TypeError, match=rf"^{name}: \w+: .*must be .*; got object$"):
        function(*given)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda dataset: auvid.simulate("spiral"), ("simulate: experiment: ", "'spiral', see load_experiment")),
        (lambda dataset: auvid.check(dataset, "tukf.h5"), ("check: estimates: ", "'tukf.h5', see read_estimate")),
        (lambda dataset: auvid.identify(dataset, 3), ("identify: filter_name: ", "string", "int")),
        (lambda dataset: auvid.tune(dataset, sensors="yes"), ("tune: sensors: ", "boolean", "str")),
        (lambda dataset: auvid.inspect(dataset, use=(0.0,)), ("inspect: use: ", "tuple")),
        (lambda dataset: auvid.inspect(dataset, use=("0", "80")), ("inspect: use: ", "number")),
        (lambda dataset: auvid.identifiability(dataset, {"X_u|u|": "5"}), ("identifiability: at: ", "number")),
        (lambda dataset: auvid.validate([dataset, 3], 3), ("validate: data: ", "Dataset")),
        (lambda dataset: auvid.read_dataset("dataset.h5", 7), ("read_dataset: overrides: ", "string", "int")),
        (lambda dataset: auvid.check(), ("check: dataset: ",)),
    ],
)
def test_wrong_type_names_argument_and_expected_type(call, words, short_run):
    with pytest.raises(TypeError) as caught:
        call(short_run)
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in words)


def test_setting_instead_of_experiment_gives_advice():
    with pytest.raises(ConfigError, match="--set seed=7"):
        auvid.load_experiment("seed=7")
    with pytest.raises(ConfigError) as caught:
        auvid.load_experiment("lake")
    assert "--set" not in str(caught.value)


def test_override_of_recorded_data_is_refused(here):
    with pytest.raises(ConfigError, match=r"seed=3: .*expected vehicle"):
        auvid.read_dataset("dataset.h5", "seed=3")


@pytest.mark.slow
@pytest.mark.parametrize("function", [auvid.evaluate, auvid.check])
def test_estimate_of_other_dataset_is_refused(function, here, other):
    estimate = auvid.read_estimate("tukf.h5")
    stranger = auvid.write_dataset("other.h5", other)
    with pytest.raises(DataError, match=r"tukf: .*another dataset"):
        function(stranger, estimate)
    with pytest.raises(DataError, match="another dataset"):
        auvid.export_model(stranger, "tukf.h5", "json")


def test_own_dataset_is_refused_for_validation(short_run, estimate):
    with pytest.raises(AuvidError, match="new to the model"):
        auvid.validate(short_run, estimate, training=short_run)


def test_model_of_estimate_in_memory_names_its_source(short_run, estimate):
    assert "from an estimate in memory,\n# made from a dataset in memory\n" in auvid.export_model(
        short_run, estimate, "python"
    )


def test_dataset_file_is_never_overwritten(here, short_run):
    dataset = auvid.write_dataset("mine.h5", short_run)
    content = Path("mine.h5").read_bytes()
    estimate = auvid.identify(dataset, "ckf")
    for write in (
        lambda: auvid.identify(dataset, "ckf", "mine.h5"),
        lambda: auvid.export_model(dataset, estimate, "json", "mine.h5"),
    ):
        with pytest.raises(FileError, match="is the dataset itself"):
            write()
    assert Path("mine.h5").read_bytes() == content


@pytest.mark.slow
def test_dataset_to_xarray_equals_file(files):
    tree = auvid.read_dataset(files / "dataset.h5").to_xarray()
    with xarray.open_datatree(files / "dataset.h5", engine="h5netcdf") as opened:
        leaves = [node.path for node in tree.leaves]
        assert leaves == [node.path for node in opened.leaves]
        for path in leaves:
            there = opened[path].to_dataset().drop_vars("valid", errors="ignore").reset_coords()
            xarray.testing.assert_identical(tree[path].to_dataset().reset_coords(), there)


@pytest.mark.slow
def test_estimate_to_xarray_equals_file(files):
    tree = auvid.read_estimate(files / "tukf.h5").to_xarray()
    for group, path in (("", "state"), ("innovations/dvl", "innovations/dvl")):
        with xarray.open_dataset(files / "tukf.h5", group=group, engine="h5netcdf") as opened:
            own = tree[path].to_dataset().reset_coords()
            for name, variable in own.variables.items():
                assert variable.dims == opened[name].dims
                assert variable.attrs.get("units") == opened[name].attrs.get("units")
                assert pd.Series(variable.values.ravel()).equals(pd.Series(opened[name].values.ravel()))
    last = tree["state"].to_dataset()["mean"].sel(state="N_uudr")[-1]
    assert float(last) == auvid.read_estimate(files / "tukf.h5").final_coefficients()["N_uudr"]


def test_tables_over_time_have_a_column_for_each_quantity_with_its_unit(short_run):
    tables = short_run.to_pandas()
    assert list(tables) == ["inputs", *(f"sensors/{name}" for name in short_run.sensors), "truth"]
    dvl = tables["sensors/dvl"]
    assert dvl.shape == short_run.sensors["dvl"].values.shape
    assert dvl.attrs["units"] == {"u": "m/s", "v": "m/s", "w": "m/s"}
    assert (dvl.index.name, dvl.index[-1]) == ("time", short_run.sensors["dvl"].time[-1])
    assert tables["truth"].shape == (short_run.truth.time.size, 12)
    assert "truth" not in short_run.without_truth().to_pandas()


def test_tables_of_an_estimate_have_its_coefficients_and_its_state_over_time(short_run, with_settings):
    dataset = with_settings(short_run, "identification.coefficients=[X_u|u|, N_uudr]")
    estimate = auvid.identify(dataset, "tukf")
    tables = estimate.to_pandas()
    coefficients = tables["coefficients"]
    assert tuple(coefficients.index) == SYMBOLS
    assert list(coefficients.index[coefficients["estimated"]]) == ["X_u|u|", "N_uudr"]
    assert coefficients["value"].to_dict() == estimate.final_coefficients()
    assert coefficients["standard_deviation"].notna().equals(coefficients["estimated"])
    for name in ("mean", "standard_deviation"):
        assert tables[name].shape == getattr(estimate, name).shape
        assert tables[name].attrs["units"]["N_uudr"] == "kg/rad"


def test_verdict_tables_have_missing_values_for_notes(short_run, estimate):
    for verdicts, columns in ((auvid.check(short_run, estimate), 7), (auvid.inspect(short_run, (0.0, 30.0)), 6)):
        table = verdicts.to_pandas()
        assert table.shape[1] == columns
        assert table["passed"].dtype == "boolean"
        assert table["passed"].any()


@pytest.mark.slow
def test_evaluation_and_bounds_are_tables_of_all_coefficients(short_run, short_estimates):
    tables = auvid.evaluate(
        short_run, *(short_estimates[name] for name in (FilterName.CKF, FilterName.TUKF))
    ).to_pandas()
    assert len(tables["coefficients"]) == 2 * len(SYMBOLS)
    assert list(tables["summary"]["filter"]) == ["ckf", "tukf"]
    found = auvid.identifiability(short_run)
    assert list(found.to_pandas()["identifiability"]["coefficient"]) == list(SYMBOLS)
    labelled = found.to_xarray()
    assert labelled["correlation"].shape == (N_COEFFICIENTS, N_COEFFICIENTS)
    assert labelled["share"].sum("sensor").values == pytest.approx(1.0)
    last = labelled["bound"].sel(coefficient="N_uudr").values[-1]
    (stated,) = (one.percent for one in found.bounds if one.coefficient == "N_uudr")
    assert last == pytest.approx(stated)


def test_a_validation_has_tables_and_a_free_run(other, estimate):
    found = auvid.validate(other, estimate)
    tables = found.to_pandas()
    assert list(tables) == ["validation", "manoeuvres", "validation_checks"]
    assert {"u", "psi"} <= set(tables["validation"]["signal"])
    assert found.run.to_xarray()["psi"].attrs["units"] == "rad"
    pd.testing.assert_index_equal(found.run.to_pandas().index, pd.Index(found.run.time, name="time"))


def test_to_xarray_without_xarray_is_one_error(short_run, estimate, monkeypatch):
    whole = builtins.__import__

    def without_xarray(name, *arguments):
        if name == "xarray":
            raise ModuleNotFoundError(name)
        return whole(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", without_xarray)
    for result in (short_run, estimate):
        with pytest.raises(DataError, match=r"pip install '\.\[xarray\]'"):
            result.to_xarray()
