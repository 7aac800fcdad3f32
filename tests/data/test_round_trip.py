"""Written files are read back by auvid and by xarray."""

import hashlib
from dataclasses import fields, replace

import numpy as np
import pytest
import xarray

from auvid_cli import arrays
from auvid_cli._version import __version__
from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset_file import holds_data, read_dataset, write_dataset
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.data.faults import Fault, FaultTest
from auvid_cli.data.innovations import Innovations
from auvid_cli.errors import ConfigError
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import SENSORS


def assert_equal(a, b):
    """Field by field; arrays bit by bit, NaN where NaN was."""
    for field in fields(a):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if isinstance(one, np.ndarray):
            assert np.array_equal(one, other, equal_nan=True), field.name
        elif isinstance(one, dict) and any(hasattr(value, "time") for value in one.values()):
            assert set(one) == set(other)
            for name in one:
                assert_equal(one[name], other[name])
        elif hasattr(one, "time"):
            assert_equal(one, other)
        elif field.name != "sha256":
            assert one == other, field.name


def test_dataset_is_read_back(dataset, written):
    back = read_dataset(written["dataset"])
    assert_equal(dataset, back)


def test_dataset_in_temporary_files_gives_same_estimate(dataset, written, monkeypatch):
    whole = identify(read_dataset(written["dataset"]), FilterName.TUKF)
    monkeypatch.setattr(arrays, "MAX_IN_MEMORY", 0)
    back = read_dataset(written["dataset"])
    assert_equal(dataset, back)
    assert np.array_equal(identify(back, FilterName.TUKF).mean, whole.mean)
    assert np.isnan(back.sensors["dvl"].values).any()


@pytest.mark.slow
@pytest.mark.parametrize("known", ["position", "earth_field"])
def test_sensor_vectors_are_read_back(known, dataset, tmp_path):
    accelerometer = replace(dataset.sensors["accelerometer"], **{known: (0.4, -0.2, 0.1)})
    moved = replace(dataset, sensors=dataset.sensors | {"accelerometer": accelerometer})
    write_dataset(tmp_path / "moved.h5", moved)
    assert_equal(moved, read_dataset(tmp_path / "moved.h5"))
    with xarray.open_dataset(tmp_path / "moved.h5", group="sensors/accelerometer", engine="h5netcdf") as opened:
        own = moved.to_xarray()["sensors/accelerometer"].to_dataset()
        xarray.testing.assert_identical(own[known], opened[known])


def test_disturbance_is_read_back(dataset, tmp_path):
    force = np.arange(6.0) + dataset.truth.time[:, None]
    disturbed = replace(dataset, truth=replace(dataset.truth, disturbance=force))
    write_dataset(tmp_path / "disturbed.h5", disturbed)
    assert_equal(disturbed, read_dataset(tmp_path / "disturbed.h5"))
    assert holds_data(tmp_path / "disturbed.h5", disturbed)
    calmer = replace(dataset, truth=replace(dataset.truth, disturbance=0.9 * force))
    assert not holds_data(tmp_path / "disturbed.h5", calmer)


def test_dataset_without_truth_is_read_back(dataset, tmp_path):
    write_dataset(tmp_path / "logged.h5", dataset.without_truth())
    back = read_dataset(tmp_path / "logged.h5")
    assert back.truth is None
    assert_equal(dataset.without_truth(), back)


def test_missing_components_are_read_back(dataset, tmp_path):
    dvl = dataset.sensors["dvl"]
    values = dvl.values.copy()
    values[3, 1] = np.nan
    holed = replace(dataset, sensors=dataset.sensors | {"dvl": replace(dvl, values=values)})
    write_dataset(tmp_path / "holed.h5", holed)
    assert np.array_equal(read_dataset(tmp_path / "holed.h5").sensors["dvl"].values, values, equal_nan=True)


def test_dataset_has_the_digest_of_its_file(written):
    path = written["dataset"]
    assert read_dataset(path).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_settings_in_a_dataset_can_be_overridden(written):
    back = read_dataset(written["dataset"], ("identification.prior.factor=7",))
    assert back.experiment.identification.prior.factor == 7.0
    with pytest.raises(ConfigError):
        read_dataset(written["dataset"], ("identification.prior.factor=wide",))


def test_estimate_is_read_back(estimate, written):
    back = read_estimate(written["estimate"])
    assert_equal(estimate, back)
    assert back.dataset_sha256 == "0123abcd" * 8
    assert len(back.held) == 19


def test_estimate_without_held_coefficients_is_read_back(dataset, write_estimate, tmp_path):
    changed = replace(identify(dataset, FilterName.EKF), status="diverged at t = 1.000 s: why")
    write_estimate(tmp_path / "estimate.h5", changed)
    back = read_estimate(tmp_path / "estimate.h5")
    assert (back.held, back.status, back.completed) == ({}, changed.status, False)


@pytest.mark.parametrize("sensor", [name for name in SENSORS if name not in ("depth", "magnetic_field")])
def test_xarray_opens_every_sensor_with_units_and_time(sensor, dataset, written):
    with xarray.open_dataset(written["dataset"], group=f"sensors/{sensor}", engine="h5netcdf") as opened:
        for column, quantity in enumerate(SENSORS[sensor]):
            variable = opened[quantity.symbol]
            assert variable.dims == ("time",)
            assert variable.attrs["units"] == quantity.unit
            assert variable.attrs["long_name"] == quantity.meaning
            assert np.array_equal(variable.values, dataset.sensors[sensor].values[:, column], equal_nan=True)
        assert np.array_equal(opened["time"].values, dataset.sensors[sensor].time)
        assert opened["valid"].dims == ("time", "component")
        assert opened["valid"].sum() == np.isfinite(dataset.sensors[sensor].values).sum()


def test_xarray_opens_inputs_and_truth(dataset, written):
    with xarray.open_dataset(written["dataset"], group="inputs", engine="h5netcdf") as inputs:
        assert np.array_equal(inputs["surge_force"].values, dataset.inputs.values[:, 2])
        assert inputs["rudder"].attrs["units"] == "rad"
    with xarray.open_dataset(written["dataset"], group="truth", engine="h5netcdf") as truth:
        assert np.array_equal(truth["down"].values, dataset.truth.position[:, 2])
        assert tuple(truth["coefficient"].values) == SYMBOLS
        named = truth["true_coefficient"].sel(coefficient="Y_url")
        assert float(named) == dataset.truth.coefficients["Y_url"]


def test_xarray_opens_an_estimate(estimate, written):
    with xarray.open_dataset(written["estimate"], engine="h5netcdf") as opened:
        assert np.array_equal(opened["mean"].sel(state="Z_uude").values, estimate.mean[:, 1])
        assert opened["covariance"].dims == ("state", "state_of_column")
        assert opened.attrs["filter"] == "tukf"
    with xarray.open_dataset(written["estimate"], group="innovations/dvl", engine="h5netcdf") as opened:
        assert opened["innovation"].attrs["units"] == "m/s"
        assert np.array_equal(opened["nis"].values, estimate.innovations["dvl"].nis)


def test_files_have_their_provenance(kind, written):
    with xarray.open_dataset(written[kind], engine="h5netcdf") as opened:
        assert opened.attrs["kind"] == f"auvid {kind}"
        assert opened.attrs["auvid_version"] == __version__
        assert opened.attrs["seed"] == 1
        assert "numpy" in opened.attrs["library_versions"]


def test_long_estimate_is_thinned_evenly_with_the_last_row(estimate, write_estimate, tmp_path):
    write_estimate(tmp_path / "estimate.h5", estimate)
    thin = read_estimate(tmp_path / "estimate.h5", max_rows=30)
    for got, whole in (
        (thin.time, estimate.time),
        (thin.mean, estimate.mean),
        (thin.innovations["gyroscope"].nis, estimate.innovations["gyroscope"].nis),
    ):
        every = 1 + len(whole) // 30
        assert every > 1
        assert np.array_equal(got, whole[::-1][::every][::-1])
    assert np.array_equal(thin.innovations["dvl"].time, estimate.innovations["dvl"].time)


def test_thinned_innovations_keep_sums_over_all(estimate, write_estimate, tmp_path):
    write_estimate(tmp_path / "estimate.h5", estimate)
    thin = read_estimate(tmp_path / "estimate.h5", max_rows=7)
    assert thin.innovations["gyroscope"].time.size < estimate.innovations["gyroscope"].time.size
    for name, innovations in estimate.innovations.items():
        got, expected = thin.innovations[name].sums(), innovations.sums()
        assert (got.measurements, got.rejected, got.start) == (expected.measurements, expected.rejected, expected.start)
        assert np.allclose(got.squares, expected.squares, rtol=1e-12)
        assert np.array_equal(got.components, expected.components)


def test_thinned_innovations_keep_autocorrelation_of_all(estimate, write_estimate, tmp_path, rng):
    n = 4000
    noise = rng.standard_normal((n + 1, 3))
    coloured = noise[1:] + 0.5 * noise[:-1]
    one = np.ones((n, 3))
    long = Innovations(np.arange(n) / 100.0, coloured, one, (coloured**2).sum(axis=1), np.ones(3))
    innovations = estimate.innovations | {"gyroscope": long}
    write_estimate(tmp_path / "estimate.h5", replace(estimate, innovations=innovations))
    got, expected = (
        read_estimate(tmp_path / "estimate.h5", max_rows=500).innovations["gyroscope"].autocorrelation,
        long.autocorrelation,
    )
    assert np.array_equal(got.samples, expected.samples)
    # But for those at the edges of the blocks that are read.
    assert np.allclose(got.correlation, expected.correlation, atol=0.01)
    assert np.allclose(got.correlation[:, 0], 0.4, atol=0.05)


def test_faults_are_read_back(estimate, write_estimate, tmp_path):
    faults = (
        FaultTest(Fault.parse("bias of r"), "rad/s", 1e-4, 2e-5, "N_url", 0.5),
        FaultTest(
            *(Fault.parse("Y_|v|r"), "kg/rad", -3.0, 1.0, "Y_url", 2.25),
            rank=1,
            alternatives=(Fault.parse("delay of the DVL"), Fault.parse("scale of r")),
            moved=("Y_url", "N_|v|r"),
        ),
    )
    write_estimate(tmp_path / "estimate.h5", replace(estimate, faults=faults))
    back = read_estimate(tmp_path / "estimate.h5")
    assert back.faults == faults
    assert [fault.z for fault in back.faults] == pytest.approx([5.0, -3.0])


def test_corrected_deviations_are_read_back(estimate, write_estimate, tmp_path):
    corrected = {"X_u|u|": 1.5 * float(estimate.standard_deviation[-1, 0])}
    write_estimate(tmp_path / "estimate.h5", replace(estimate, corrected=corrected))
    assert read_estimate(tmp_path / "estimate.h5").corrected == corrected


def test_statistics_of_explained_innovations_are_read_back(estimate, write_estimate, tmp_path):
    statistics = estimate.innovations["gyroscope"].statistics()
    assert statistics.sums.squares.sum() > 0.0
    write_estimate(tmp_path / "estimate.h5", replace(estimate, explained={"gyroscope": statistics}))
    back = read_estimate(tmp_path / "estimate.h5")
    for found, written in zip(back.statistics("gyroscope"), statistics, strict=True):
        for one, other in zip(found, written, strict=True):
            assert np.array_equal(one, other)
    assert back.statistics("dvl").sums.measurements == estimate.innovations["dvl"].sums().measurements


def test_estimate_without_corrected_deviations_is_read_back(estimate, written):
    back = read_estimate(written["estimate"])
    assert estimate.corrected == back.corrected == {}
    assert list(back.final_deviations().values()) == estimate.standard_deviation[-1].tolist()
    assert np.array_equal(back.final_covariance(), estimate.covariance)


def test_estimate_without_faults_is_read_back(estimate, written):
    assert estimate.faults == read_estimate(written["estimate"]).faults == ()
