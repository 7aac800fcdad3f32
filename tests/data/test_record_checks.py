"""Files with impossible values are refused."""

import copy
import pickle
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.config.extra_states import AugmentedStates, BiasName
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.dataset_file import read_dataset, write_dataset
from auvid_cli.data.estimate import STATES
from auvid_cli.data.estimate_file import read_estimate
from auvid_cli.data.faults import Fault, FaultTest
from auvid_cli.errors import AuvidError, FileError, InvalidDataError
from auvid_cli.identification.run import identify

pytestmark = pytest.mark.usefixtures("walked_here")


def refused(read, path):
    with pytest.raises(AuvidError) as caught:
        read(path)
    message = str(caught.value)
    # Errors in settings show the position in further lines.
    assert message.isprintable() or "(settings)" in message
    assert str(path) in message


@pytest.fixture
def estimate_with(written, tmp_path):
    """Function: an estimate file with an attribute, or with an array changed."""

    def change(name, value):
        path = shutil.copy(written["estimate"], tmp_path / "estimate.h5")
        with h5py.File(path, "a") as file:
            if callable(value):
                values = value(file[name][...])
                del file[name]
                file[name] = values
            else:
                file.attrs[name] = value
        return path

    return change


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("filter", value) for value in ("../../../x", "EKF", "", np.arange(3.0), b"\xff", 3)),
        *(
            ("status", value)
            for value in ("done", "completed\x1b[2J", "diverged at t = 1 s: a\nb", "unconverged: é", 1)
        ),
        *(("steps", value) for value in (-1, np.nan, "many", np.zeros(3))),
        *((f"{clock}_time_s", value) for clock in ("cpu", "wall") for value in (-1.0, np.nan, np.inf, "long", 1j)),
        *(("dataset_sha256", value) for value in ("abc", "../x", "g" * 64, 7)),
        *(("schema_version", value) for value in (-1, 0, np.nan, "new", np.ones(2))),
        *(("settings", value) for value in (b"\xff\xfe", np.zeros(3), 5, "", "[", "a: &a [*a]")),
    ],
)
def test_invalid_attribute_of_estimate_is_refused(name, value, estimate_with):
    refused(read_estimate, estimate_with(name, value))


def with_(place, value):
    def change(values):
        values[place] = value
        return values

    return change


TIME, TABLE = "time", ("mean", "standard_deviation")
WRONG = [
    *((TIME, change) for change in (np.negative, lambda time: time[::-1], lambda time: time[:, None], np.sum)),
    *((TIME, change) for change in (with_(3, np.nan), with_(-1, 1e300), lambda time: time + 1j, lambda time: time[:0])),
    *((name, with_((3, 1), value)) for name in TABLE for value in (np.nan, np.inf, -np.inf)),
    *((name, change) for name in TABLE for change in (lambda table: table[:-1], lambda table: table[:, 1:], np.ravel)),
    ("standard_deviation", np.negative),
    *(("covariance", change) for change in (np.negative, np.triu, np.diagonal, lambda c: c[1:], lambda c: c[1:, 1:])),
    *(("covariance", with_((0, 0), value)) for value in (np.nan, np.inf, -1.0, 0.0)),
    *(("state", change) for change in (with_(0, b"p"), with_(0, b""), with_(0, b"$\\frac$"), lambda names: names[1:])),
    ("state", lambda names: np.arange(names.size)),
    ("unit", with_(0, b"furlong")),
    ("held", with_(0, b"X_u|u|")),
    ("held", lambda names: names[1:]),
    ("held_value", with_(0, np.nan)),
    *((f"innovations/dvl/{name}", with_(1, np.inf)) for name in ("innovation", "variance", "nis")),
    *((f"innovations/dvl/{name}", with_(1, -1.0)) for name in ("variance", "nis")),
    ("innovations/dvl/variance", with_(1, 0.0)),
    ("innovations/dvl/variance", lambda rows: rows * np.nan),
    ("innovations/dvl/standard_deviation", with_(1, 1e300)),
    *((f"innovations/dvl/{name}", lambda rows: rows[1:]) for name in ("innovation", "nis", "standard_deviation")),
    ("innovations/dvl/time", np.negative),
    ("innovations/dvl/standard_deviation", np.negative),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "change"), WRONG, ids=[f"{name}-{i}" for i, (name, _) in enumerate(WRONG)])
def test_invalid_array_of_estimate_is_refused(name, change, estimate_with):
    refused(read_estimate, estimate_with(name, change))


def test_innovations_of_unknown_sensor_are_refused(written, tmp_path):
    path = shutil.copy(written["estimate"], tmp_path / "estimate.h5")
    with h5py.File(path, "a") as file:
        file.move("innovations/dvl", "innovations/$x$")
    refused(read_estimate, path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("inputs/time", lambda time: time[:, None]),
        ("inputs/time", np.sum),
        ("inputs/time", with_(-1, 1e300)),
        ("inputs/time", lambda time: time + 1j),
        ("inputs/rudder", lambda values: values[:, None]),
        ("inputs/surge_force", with_(3, 1e200)),
        ("sensors/dvl/u", with_(3, 1e200)),
        ("sensors/dvl/valid", np.ravel),
        ("sensors/dvl/valid", lambda flags: flags[:, 0]),
        *(("sensors/dvl/standard_deviation", with_(0, value)) for value in (-1.0, np.nan, np.inf)),
        *((f"truth/{name}", with_(1, np.nan)) for name in ("time", "u", "down", "true_coefficient")),
        ("truth/time", np.negative),
        ("truth/u", lambda values: values[:-1]),
        ("truth/coefficient", with_(0, b"X_q")),
    ],
)
def test_invalid_array_of_dataset_is_refused(name, change, written, tmp_path):
    path = shutil.copy(written["dataset"], tmp_path / "dataset.h5")
    with h5py.File(path, "a") as file:
        values = change(file[name][...])
        del file[name]
        file[name] = values
    refused(read_dataset, path)


@pytest.mark.parametrize("position", [[0.4], [0.4, 0.0, np.nan], [0.4, 0.0, 1e9]])
def test_invalid_sensor_position_is_refused(position, written, tmp_path):
    path = shutil.copy(written["dataset"], tmp_path / "dataset.h5")
    with h5py.File(path, "a") as file:
        file["sensors/accelerometer/position"] = position
    refused(read_dataset, path)


def test_infinite_measurement_is_missing(written, tmp_path):
    path = shutil.copy(written["dataset"], tmp_path / "dataset.h5")
    with h5py.File(path, "a") as file:
        file["sensors/gyroscope/p"][3] = np.inf
    assert np.isnan(read_dataset(path).sensors["gyroscope"].values[3]).tolist() == [True, False, False]


@pytest.mark.slow
def test_estimate_with_few_settings_is_read_back(dataset, filter_name, write_estimate, with_settings, tmp_path):
    settings = (
        "identification.coefficients=[X_u|u|]",
        "identification.keep_every=7",
        "identification.estimate.biases=[gyro, attitude, dvl, current, thrust]",
        "identification.use.spans=[[0, 0.9], [0.9, 2]]",
        "identification.use.shortest=0.1 s",
        "identification.output_error.max_evaluations=2",
    )
    estimate = identify(with_settings(dataset, *settings), filter_name)
    write_estimate(tmp_path / "estimate.h5", estimate)
    assert read_estimate(tmp_path / "estimate.h5").status == estimate.status


def test_diverged_estimate_is_read_back(dataset, kalman_filter, write_estimate, with_settings, tmp_path):
    wild = replace(dataset, sensors=dataset.sensors | {"dvl": replace(dataset.sensors["dvl"])})
    wild.sensors["dvl"] = replace(wild.sensors["dvl"], values=wild.sensors["dvl"].values * 1e5)
    estimate = identify(wild, kalman_filter)
    assert not estimate.completed
    write_estimate(tmp_path / "estimate.h5", estimate)
    assert read_estimate(tmp_path / "estimate.h5").status == estimate.status


def test_infinite_deviations_are_only_for_output_error(dataset, estimate, write_estimate, tmp_path):
    deviation, covariance = estimate.standard_deviation.copy(), estimate.covariance.copy()
    deviation[:, 0], covariance[0, 0], covariance[0, 1], covariance[1, 0] = np.inf, np.inf, -np.inf, -np.inf
    fit = FilterName.OUTPUT_ERROR.value
    blind = replace(estimate, filter=fit, standard_deviation=deviation, covariance=covariance)
    write_estimate(tmp_path / "fit.h5", blind)
    assert np.isinf(read_estimate(tmp_path / "fit.h5").standard_deviation[:, 0]).all()
    with pytest.raises(InvalidDataError, match="/standard_deviation"):
        replace(blind, filter=FilterName.EKF.value).validate()


def test_every_state_has_a_unit():
    blocks = AugmentedStates(biases=tuple(BiasName)).blocks()
    assert {each.symbol: each.unit for block in blocks for each in block.quantities}.items() <= STATES.items()


@pytest.mark.parametrize("unit", ["furlong", "deg/s", "km/s", "", 3.0])
def test_other_units_are_refused(unit, written, tmp_path):
    path = shutil.copy(written["dataset"], tmp_path / "dataset.h5")
    with h5py.File(path, "a") as file:
        file["sensors/dvl/u"].attrs["units"] = unit
    with pytest.raises(FileError, match=r"/sensors/dvl/u is in .*; expected m/s"):
        read_dataset(path)


@pytest.mark.parametrize("unit", ["m/s", "m / s", "meter/second", None])
def test_equivalent_and_missing_units_are_read(unit, written, tmp_path):
    path = shutil.copy(written["dataset"], tmp_path / "dataset.h5")
    with h5py.File(path, "a") as file:
        del file["sensors/dvl/u"].attrs["units"]
        if unit is not None:
            file["sensors/dvl/u"].attrs["units"] = unit
    assert read_dataset(path).sensors["dvl"].time.size


FAULTS = (
    FaultTest(Fault.parse("bias of r"), "rad/s", 1e-4, 2e-5, "N_url", 0.5),
    FaultTest(Fault.parse("scale of the DVL"), "1", -2e-3, 1e-3, "X_u|u|", 0.0),
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change"),
    [
        *((name, lambda column: column[:-1]) for name in ("unit", "size", "standard_deviation", "coefficient")),
        ("fault", lambda column: column[:-1]),
        *((name, with_(1, np.nan)) for name in ("size", "standard_deviation", "susceptibility")),
        *((name, with_(0, np.inf)) for name in ("size", "standard_deviation", "susceptibility")),
        *(("standard_deviation", with_(0, value)) for value in (-1e-5, 0.0)),
        ("susceptibility", with_(0, -0.1)),
        *(("coefficient", with_(0, value)) for value in (b"", b"Y_nothing", b"u")),
        ("coefficient", lambda column: np.arange(column.size)),
    ],
)
def test_invalid_faults_are_refused(name, change, estimate, write_estimate, tmp_path):
    path = tmp_path / "estimate.h5"
    write_estimate(path, replace(estimate, faults=FAULTS))
    with h5py.File(path, "a") as file:
        values = change(file["faults"][name][...])
        del file["faults"][name]
        file["faults"][name] = values
    refused(read_estimate, path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("standard_deviation", lambda column: column[:-1]),
        *(("standard_deviation", with_(0, value)) for value in (np.nan, np.inf, 0.0, -1.0)),
        ("constant_state", with_(0, b"Y_nothing")),
    ],
)
def test_invalid_corrected_deviations_are_refused(name, change, estimate, write_estimate, tmp_path):
    path, nominal = tmp_path / "estimate.h5", estimate.standard_deviation[-1, :2].tolist()
    write_estimate(path, replace(estimate, corrected=dict(zip(estimate.state, nominal, strict=False))))
    with h5py.File(path, "a") as file:
        values = change(file["corrected"][name][...])
        del file["corrected"][name]
        file["corrected"][name] = values
    refused(read_estimate, path)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("components", lambda column: column[:-1]),
        ("correlation", lambda rows: rows[:, :-1]),
        ("squares", with_(0, np.nan)),
        ("value", lambda column: column[:-1]),
        ("value", with_(1, np.inf)),
    ],
)
def test_invalid_statistics_of_innovations_are_refused(name, change, estimate, write_estimate, tmp_path):
    path, statistics = tmp_path / "estimate.h5", estimate.innovations["gyroscope"].statistics()
    write_estimate(path, replace(estimate, explained={"gyroscope": statistics}))
    with h5py.File(path, "a") as file:
        values = change(file["explained/gyroscope"][name][...])
        del file["explained/gyroscope"][name]
        file["explained/gyroscope"][name] = values
    refused(read_estimate, path)


def test_statistics_of_a_sensor_without_innovations_are_refused(estimate, write_estimate, tmp_path):
    path, statistics = tmp_path / "estimate.h5", estimate.innovations["gyroscope"].statistics()
    write_estimate(path, replace(estimate, explained={"gyroscope": statistics}))
    with h5py.File(path, "a") as file:
        file.move("explained/gyroscope", "explained/sonar")
    refused(read_estimate, path)


def with_times(change):
    return lambda dataset: replace(dataset, inputs=replace(dataset.inputs, time=change(dataset.inputs.time)))


def with_dvl(**changes):
    def change(dataset):
        dvl = dataset.sensors["dvl"]
        new = {name: value(getattr(dvl, name)) for name, value in changes.items()}
        return replace(dataset, sensors=dataset.sensors | {"dvl": replace(dvl, **new)})

    return change


@pytest.mark.parametrize(
    "change",
    [
        with_times(lambda time: time[::-1]),
        with_times(lambda time: 0.0 * time),
        with_times(lambda time: time + 1e9),
        with_times(lambda time: np.where(time == time[-1], 0.0, time)),
        with_times(lambda time: time[1:]),
        with_times(lambda time: None),
        with_times(lambda time: time[:, None]),
        with_dvl(values=lambda values: np.ma.masked_invalid(values)),
        with_dvl(values=lambda values: values + 0j),
        with_dvl(values=lambda values: values[:, :2]),
        with_dvl(values=lambda values: [[1.0], [1.0, 2.0]]),
        with_dvl(values=lambda values: values * 1e9),
        *(with_dvl(standard_deviation=lambda d, size=size: 0.0 * d + size) for size in (1e300, 5e-324, -1.0, np.nan)),
        with_dvl(position=lambda position: (0.0, 0.0)),
        lambda dataset: replace(dataset, inputs=replace(dataset.inputs, values=dataset.inputs.values * np.nan)),
        lambda dataset: replace(dataset, inputs=replace(dataset.inputs, values=dataset.inputs.values[:, :3])),
        lambda dataset: replace(dataset, sensors={"sonar": next(iter(dataset.sensors.values()))}),
        lambda dataset: replace(dataset, sensors=[*dataset.sensors.values()]),
        lambda dataset: replace(dataset, inputs=None),
        lambda dataset: replace(dataset, truth=replace(dataset.truth, coefficients={"X_q": 1.0})),
    ],
)
def test_invalid_dataset_is_not_made(change, dataset):
    with pytest.raises(InvalidDataError) as caught:
        change(dataset)
    assert "\n" not in str(caught.value)


def test_lists_are_accepted_as_arrays():
    record = SensorRecord([0, 1], [[1, 2, 3], [4, 5, 6]], [1, 1, 1], [0, 0, 1])
    assert record.values.dtype == np.float64
    assert record.position == (0.0, 0.0, 1.0)


def test_dataset_that_was_changed_in_place_is_not_written(dataset, tmp_path):
    inputs = replace(dataset.inputs, time=dataset.inputs.time.copy())
    changed = replace(dataset, inputs=inputs)
    inputs.time[-1] = 0.0
    with pytest.raises(FileError, match=r"dataset\.h5: not written: "):
        write_dataset(tmp_path / "dataset.h5", changed)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "change",
    [
        {"mean": None},
        {"time": lambda time: time[::-1]},
        {"state": lambda state: state[1:]},
        {"filter": "kf"},
        {"innovations": {"dvl": None}},
        {"mean": lambda mean: mean + np.where(np.arange(mean.shape[1]) == 0, 1e300, 0.0)},
        {"standard_deviation": lambda deviation: deviation * 1e-320},
        {"held": lambda held: held | {next(iter(held)): 1e30}},
        {"faults": (1,)},
    ],
)
def test_invalid_estimate_is_refused(change, estimate):
    new = {name: value(getattr(estimate, name)) if callable(value) else value for name, value in change.items()}
    with pytest.raises(InvalidDataError):
        replace(estimate, **new).validate()


def test_estimate_that_was_changed_in_place_is_not_written(estimate, write_estimate, tmp_path):
    changed = replace(estimate, mean=estimate.mean.copy())
    changed.mean[3] = np.nan
    with pytest.raises(FileError, match=r"estimate\.h5: not written: /mean"):
        write_estimate(tmp_path / "estimate.h5", changed)
    assert not list(tmp_path.iterdir())


def test_dataset_and_estimate_are_pickled(dataset, estimate):
    for thing in (dataset, estimate):
        for made in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing), copy.copy(thing)):
            assert made.experiment == thing.experiment


def test_what_innovations_computed_is_not_pickled(estimate):
    # A thread that pickled it meanwhile would stop: the dictionary changed its size.
    innovations = next(iter(estimate.innovations.values()))
    before = pickle.dumps(innovations)
    assert innovations.autocorrelation.samples.any()
    assert pickle.dumps(innovations) == before
