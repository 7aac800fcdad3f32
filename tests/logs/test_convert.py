"""Conversion by a map, from tables in memory to records."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from auvid_cli.config.log_map import load_map
from auvid_cli.config.shipped import shipped_configs
from auvid_cli.errors import ConfigError
from auvid_cli.logs.convert import convert
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.vehicle.kinematics import body_rates

TIME = np.arange(40) * 0.05
FLU = np.diag([1.0, -1.0, -1.0])
NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
VEHICLE = shipped_configs() / "vehicles" / "vt690.yaml"


class MemoryLog(Log):
    """Tables of columns, each an array or an array with a unit."""

    def __init__(self, **tables):
        super().__init__(Path("memory"))
        self._tables = {
            table: {name: held if isinstance(held, tuple) else (held, "") for name, held in columns.items()}
            for table, columns in tables.items()
        }

    def tables(self):
        return {
            table: tuple(LogColumn(name, unit, values.dtype.kind == "U") for name, (values, unit) in columns.items())
            for table, columns in self._tables.items()
        }

    def read(self, table, columns):
        return {name: self._tables[table][name][0] for name in columns}


def motion(seed=1):
    """Velocity, rates and attitude of a body that turns about all axes, smooth and never near the vertical."""
    rng = np.random.default_rng(seed)
    phase, size = rng.uniform(0, 6, 9), rng.uniform(0.1, 0.5, 9)
    wave = size * np.sin(TIME[:, None] + phase)
    return wave[:, :3] + [2.0, 0.0, 0.0], wave[:, 3:6], wave[:, 6:]


def rotations(angles):
    return Rotation.from_euler("ZYX", angles[:, ::-1])


def imu(rates, angles, time=TIME):
    return {
        **{"t": time, "p": rates[:, 0], "q": rates[:, 1], "r": rates[:, 2]},
        **{"roll": angles[:, 0], "pitch": angles[:, 1], "yaw": angles[:, 2]},
    }


def dvl(velocity, time=TIME):
    return {"t": time, "u": velocity[:, 0], "v": velocity[:, 1], "w": velocity[:, 2]}


INPUTS = {"t": TIME, "dr": 0.1 * np.sin(TIME), "de": 0.1 * np.cos(TIME), "force": np.full(TIME.size, 5.0)}
GYROSCOPE = "gyroscope: {table: imu, columns: {p: p, q: q, r: r}, standard_deviation: 0.01%s}"
DVL = "dvl: {table: dvl, columns: {u: u, v: v, w: w}, standard_deviation: 0.01%s}"
ATTITUDE = "attitude: {table: imu, columns: {phi: roll, theta: pitch, psi: yaw}, standard_deviation: 0.01%s}"
DEPTH = "depth: {table: depth, columns: {down: {column: z%s}}, standard_deviation: 0.01%s}"
INPUT_MAP = "{table: in, rudder: dr, elevator: de, surge_force: force}"


@pytest.fixture(scope="session")
def converted(tmp_path_factory):
    """Function: what a map makes of a log; sensors are lines of it, `inputs` and `more` too."""
    path = tmp_path_factory.mktemp("map") / "map.yaml"

    def run(log, *sensors, inputs=INPUT_MAP, more=""):
        lines = "".join(f"  {sensor}\n" for sensor in sensors)
        path.write_text(
            f"name: run\nvehicle: {VEHICLE}\nlogs: {{log: x}}\ntime: t\n{more}\nsensors:\n{lines}inputs: {inputs}\n"
        )
        return convert(*load_map(path), {"log": log})

    return run


def test_revolutions_and_voltage_follow_other_inputs(converted):
    _, rates, angles = motion()
    turns = {"rpm": 60.0 * np.cos(TIME), "u": 24.0 - 0.1 * TIME}
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS | turns})
    inputs = "{table: in, rudder: dr, revolutions: {column: rpm, unit: rpm}, voltage: u}"
    found = converted(log, GYROSCOPE % "", inputs=inputs)
    assert [quantity.symbol for quantity in found.inputs.quantities][4:] == ["revolutions", "voltage"]
    assert_allclose(found.inputs.values[:, 4], np.cos(TIME))
    assert_allclose(found.inputs.values[:, 5], turns["u"])
    assert np.array_equal(found.inputs.values[:, 0], INPUTS["dr"])


def test_revolutions_without_unit_raise_config_error(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS | {"n": np.cos(TIME)}})
    with pytest.raises(ConfigError, match="rpm or turn/s"):
        converted(log, GYROSCOPE % "", inputs="{table: in, revolutions: n}")


def test_si_numbers_are_unchanged(converted):
    velocity, rates, angles = motion()
    velocity[3] = np.nan
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(velocity), "in": INPUTS})
    found = converted(log, GYROSCOPE % "", DVL % "", ATTITUDE % "")
    assert np.array_equal(found.sensors["gyroscope"].values, rates)
    assert np.array_equal(found.sensors["dvl"].values, velocity, equal_nan=True)
    assert np.array_equal(found.sensors["attitude"].values, angles)
    assert np.array_equal(found.sensors["dvl"].time, TIME)
    assert found.sensors["dvl"].standard_deviation.tolist() == [0.01] * 3
    assert found.inputs.values[:, 3].tolist() == [0.0] * TIME.size
    assert np.array_equal(found.inputs.values[:, 0], INPUTS["dr"])
    assert next(own for own in found.summaries if own.name == "dvl").missing == 1


def test_needed_columns_of_each_table_are_read_once(converted):
    velocity, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(velocity), "in": INPUTS, "other": INPUTS})
    reads = []
    read_all = log.read
    log.read = lambda table, columns: reads.append((table, sorted(columns))) or read_all(table, columns)
    converted(log, GYROSCOPE % "", (DVL % "").replace(", w: w", ""), (ATTITUDE % "").replace("phi: roll, ", ""))
    assert reads == [
        ("imu", ["p", "pitch", "q", "r", "t", "yaw"]),
        ("dvl", ["t", "u", "v"]),
        ("in", ["de", "dr", "force", "t"]),
    ]


def test_components_from_several_tables_are_merged(converted):
    velocity, rates, angles = motion()
    pitch = {"t": TIME[1:-1:3] + 0.01, "pitch": np.degrees(angles[1:-1:3, 1])}
    heading = {"stamp": 1e3 * TIME, "yaw": angles[:, 2]}
    log = MemoryLog(
        **{"imu": imu(rates, angles), "ahrs": pitch, "compass": heading, "dvl": dvl(velocity), "in": INPUTS}
    )
    places = (
        "theta: {column: pitch, table: ahrs, unit: deg}, "
        "psi: {column: yaw, table: compass, time: {column: stamp, unit: ms}}"
    )
    apart = (ATTITUDE % "").replace("theta: pitch, psi: yaw", places)
    found = converted(log, apart, DVL % ", position: [0.3, 0, 0]").sensors
    attitude = found["attitude"]
    assert_allclose(attitude.time, np.union1d(TIME, pitch["t"]), atol=1e-12)
    for component, of in enumerate((TIME, pitch["t"], TIME)):
        measured = np.isfinite(attitude.values[:, component])
        assert_allclose(attitude.time[measured], of, atol=1e-12)
    assert_allclose(attitude.values[np.isin(attitude.time, pitch["t"]), 1], angles[1:-1:3, 1], atol=1e-12)
    # Its own motion, by angles that are never measured at once, is taken off as by those that are.
    whole = converted(log, ATTITUDE % "", DVL % ", position: [0.3, 0, 0]").sensors["dvl"].values
    inside = np.isfinite(found["dvl"].values).all(axis=1)
    assert inside.sum() > 30
    assert_allclose(found["dvl"].values[inside], whole[inside], atol=0.02)


def test_mount_needs_simultaneous_angles(converted):
    velocity, rates, angles = motion()
    other = {"t": TIME + 0.01, "pitch": angles[:, 1]}
    log = MemoryLog(**{"imu": imu(rates, angles), "ahrs": other, "dvl": dvl(velocity), "in": INPUTS})
    apart = (ATTITUDE % ", mount: upside down").replace("theta: pitch", "theta: {column: pitch, table: ahrs}")
    with pytest.raises(ConfigError, match="need all three angles at one time"):
        converted(log, apart)


def test_vertical_velocity_over_ground_comes_from_depth(converted):
    velocity, rates, angles = motion()
    ground = rotations(angles).apply(velocity)
    time = 0.05 * np.arange(-20, TIME.size + 20)
    sinking = np.interp(time, TIME, ground[:, 2])
    depth = {"t": time, "z": 20.0 + np.concatenate(([0.0], np.cumsum(0.025 * (sinking[1:] + sinking[:-1]))))}
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(ground), "depth": depth, "in": INPUTS})
    lateral = (DVL % ", frame: NED").replace(", w: w", "")
    found = converted(log, lateral, ATTITUDE % "", DEPTH % ("", "")).sensors["dvl"].values
    assert_allclose(found[10:-10, :2], velocity[10:-10, :2], atol=0.03)
    assert np.isnan(found[:, 2]).all()
    with pytest.raises(ConfigError, match="need `w` as well, or a `depth`"):
        converted(log, lateral, ATTITUDE % "")


@pytest.mark.parametrize("named", [False, True])
def test_id_separates_rows_of_servos(converted, named):
    velocity, *_ = motion()
    ids = np.tile([0.0, 1.0, 2.0], TIME.size)
    written = np.array(["Top", "right ", "left"])[ids.astype(int)] if named else ids
    servo = {"t": np.repeat(TIME, 3), "id": written, "value": np.repeat(0.1 * np.sin(TIME), 3) + 0.01 * ids}
    top, right = ("top", "Right") if named else (0, 1)
    fin = "{column: value, rows: {column: id, values: [%s]}}"
    found = converted(
        MemoryLog(dvl=dvl(velocity), servo=servo),
        DVL % "",
        inputs=f"{{table: servo, rudder: {fin % top}, elevator: {fin % right}}}",
    )
    assert_allclose(found.inputs.values[:, 0], 0.1 * np.sin(TIME))
    assert_allclose(found.inputs.values[:, 1], 0.1 * np.sin(TIME) + 0.01)
    assert not any("without a time" in remark for summary in found.summaries for remark in summary.remarks)


def test_unknown_id_raises_config_error(converted):
    velocity, *_ = motion()
    log = MemoryLog(**{"dvl": dvl(velocity), "in": {**INPUTS, "id": np.arange(TIME.size) % 3}})
    with pytest.raises(ConfigError, match=r"inputs\.rudder: no row with such a 'id'.*0, 1, 2"):
        converted(log, DVL % "", inputs="{table: in, rudder: dr, rows: {column: id, values: [7]}}")


@given(st.integers(0, 10_000), st.floats(0, 2e9), st.sampled_from(["", "upside down", "backward"]))
def test_axes_units_and_epochs_are_converted(converted, seed, epoch, mount):
    velocity, rates, angles = motion(seed)
    mounted = {"": np.eye(3), "upside down": FLU, "backward": np.diag([-1.0, -1.0, 1.0])}[mount]
    # A sensor with this mount, forward-left-up axes, and an attitude from east-north-up.
    to_sensor = FLU @ mounted.T
    attitude = Rotation.from_matrix(NED_OF_ENU.T @ rotations(angles).as_matrix() @ to_sensor.T)
    w, x, y, z = attitude.as_quat(scalar_first=True).T
    turned = np.degrees(rates @ to_sensor.T)
    log = MemoryLog(
        **{
            "imu": {
                **imu(turned, angles, TIME + epoch),
                **{"q.w": w, "q.x": x, "q.y": y, "q.z": z},
            },
            "dvl": dvl(velocity @ to_sensor.T / 0.514444444444444444, TIME + epoch),
            "in": INPUTS | {"t": TIME + epoch},
        }
    )
    axes = f", frame: FLU{f', mount: {mount}' if mount else ''}"
    found = converted(
        log,
        GYROSCOPE % f", unit: deg/s{axes}",
        DVL % f", unit: knot{axes}",
        f"attitude: {{table: imu, quaternion: q, reference: ENU, standard_deviation: 1 deg{axes}}}",
    )
    assert found.sensors["gyroscope"].values == pytest.approx(rates, abs=1e-12)
    assert found.sensors["dvl"].values == pytest.approx(velocity, abs=1e-12)
    assert found.sensors["attitude"].values == pytest.approx(angles, abs=1e-12)
    resolution = np.spacing(epoch)
    assert found.origin == pytest.approx(epoch, abs=resolution)
    assert found.sensors["dvl"].time == pytest.approx(TIME, abs=2 * resolution + 1e-12)


def test_euler_angles_of_east_north_up(converted):
    _, rates, angles = motion()
    yaw, pitch, roll = (
        Rotation.from_matrix(NED_OF_ENU.T @ rotations(angles).as_matrix() @ FLU).as_euler("ZYX").T  # FLU is its inverse
    )
    log = MemoryLog(**{"imu": imu(rates, np.column_stack((roll, pitch, yaw))), "in": INPUTS})
    found = converted(log, ATTITUDE % ", frame: FLU, reference: ENU")
    assert found.sensors["attitude"].values == pytest.approx(angles, abs=1e-12)


def test_mount_by_its_angles(converted):
    velocity, rates, angles = motion()
    mount = Rotation.from_euler("ZYX", [40.0, -20.0, 170.0], degrees=True)  # yaw, pitch, roll of the sensor in the body
    yaw, pitch, roll = (rotations(angles) * mount).as_euler("ZYX").T
    log = MemoryLog(
        **{
            "imu": imu(mount.inv().apply(rates), np.column_stack((roll, pitch, yaw))),
            "dvl": dvl(mount.inv().apply(velocity)),
            "in": INPUTS,
        }
    )
    axes = ", mount: {roll: 170 deg, pitch: -20 deg, yaw: 40 deg}"
    found = converted(log, GYROSCOPE % axes, DVL % axes, ATTITUDE % axes)
    assert found.sensors["gyroscope"].values == pytest.approx(rates, abs=1e-12)
    assert found.sensors["dvl"].values == pytest.approx(velocity, abs=1e-12)
    assert found.sensors["attitude"].values == pytest.approx(angles, abs=1e-12)


def test_heading_of_a_compass_that_counts_from_east(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, np.degrees(0.5 * np.pi - angles)), "in": INPUTS})
    compass = "magnetometer: {table: imu, columns: {heading: {column: yaw, unit: deg, offset: -7 deg}}, "
    found = converted(log, compass + "reference: ENU, standard_deviation: 1 deg}")
    assert found.sensors["magnetometer"].values[:, 0] == pytest.approx(angles[:, 2] + np.radians(7.0), abs=1e-12)


@pytest.mark.parametrize(("unit", "said"), [("", True), (", unit: deg", False)])
def test_probable_heading_in_degrees_is_reported(converted, unit, said):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles) | {"yaw": 180.0 + 100.0 * angles[:, 2]}, "in": INPUTS})
    found = converted(log, f"attitude: {{table: imu, columns: {{psi: yaw}}, standard_deviation: 1 deg{unit}}}")
    assert any("or degrees without a unit?" in remark for remark in found.summaries[0].remarks) == said


def test_pressure_gives_the_depth(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "depth": {"t": TIME, "z": 101325.0 + 9.81e3 * TIME}, "in": INPUTS})
    found = converted(log, GYROSCOPE % "", DEPTH % (f", centre: 101325, scale: {1 / 9.81e3!r}", ""))
    assert found.sensors["depth"].values[:, 0] == pytest.approx(TIME, abs=1e-9)


def test_times_from_another_table_row_by_row(converted):
    _, rates, angles = motion()
    stamps = {"stamp": 5.0 + 2.0 * TIME}
    log = MemoryLog(**{"imu": imu(rates, angles, 0 * TIME), "status": stamps, "in": INPUTS | {"t": 5.0 + 2.0 * TIME}})
    found = converted(log, GYROSCOPE % ", time: {table: status, column: stamp}")
    assert found.sensors["gyroscope"].time == pytest.approx(2.0 * TIME)
    log = MemoryLog(**{"imu": imu(rates, angles), "status": {"stamp": TIME[:-1]}, "in": INPUTS})
    with pytest.raises(ConfigError, match=r"status has 39 rows.*40 rows"):
        converted(log, GYROSCOPE % ", time: {table: status, column: stamp}")


@pytest.mark.parametrize("frame", ["NED", "ENU"])
def test_velocity_over_ground_is_turned_into_the_body(converted, frame):
    velocity, rates, angles = motion()
    ned = rotations(angles).apply(velocity)
    stated = ned if frame == "NED" else ned @ NED_OF_ENU
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(stated), "in": INPUTS})
    found = converted(log, ATTITUDE % "", DVL % f", frame: {frame}")
    assert found.sensors["dvl"].values == pytest.approx(velocity, abs=1e-12)


@pytest.mark.parametrize("ground", [True, False])
def test_missing_roll_is_assumed_zero_and_reported(converted, ground):
    velocity, _, angles = motion()
    angles[:, 0] = 0.0
    lever = np.array([0.6, 0.0, 0.0])
    rates = body_rates(TIME, angles)
    stated = rotations(angles).apply(velocity) if ground else velocity + np.cross(rates, lever)
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(stated), "in": INPUTS})
    how = ", frame: NED" if ground else ", position: [60 cm, 0, 0]"
    found = converted(log, (ATTITUDE % "").replace("phi: roll, ", ""), DVL % how)
    assert found.sensors["dvl"].values == pytest.approx(velocity, abs=1e-9)
    assert np.isnan(found.sensors["attitude"].values[:, 0]).all()
    remarks = next(own for own in found.summaries if own.name == "dvl").remarks
    assert any(text.startswith("no measured roll: ") for text in remarks)


def test_depth_ahead_of_origin_needs_no_roll(converted):
    _, rates, angles = motion()
    depth = {"t": TIME, "z": 20.0 - np.sin(angles[:, 1])}
    log = MemoryLog(**{"imu": imu(rates, angles), "depth": depth, "in": INPUTS})
    found = converted(log, (ATTITUDE % "").replace("phi: roll, ", ""), DEPTH % ("", ", position: [1, 0, 0]"))
    assert found.sensors["depth"].values[:, 0] == pytest.approx(20.0)
    assert any(
        "the lever arm transformed with a roll of 0" in own.remarks[0] for own in found.summaries if own.name == "depth"
    )


def test_lever_arm_is_taken_off_by_the_gyroscope(converted):
    velocity, rates, angles = motion()
    lever = np.array([0.6, 0.05, -0.1])
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(velocity + np.cross(rates, lever)), "in": INPUTS})
    found = converted(log, GYROSCOPE % "", DVL % ", position: [60 cm, 5 cm, -10 cm]")
    assert found.sensors["dvl"].values == pytest.approx(velocity, abs=1e-12)


def test_where_an_accelerometer_sits_is_kept_for_estimators(converted):
    felt, rates, angles = motion()
    named = dict(zip(("t", "x", "y", "z"), (TIME, *felt.T), strict=True))
    log = MemoryLog(**{"imu": imu(rates, angles), "felt": named, "in": INPUTS})
    accelerometer = "accelerometer: {table: felt, columns: {fx: x, fy: y, fz: z}, standard_deviation: 0.01%s}"
    compass = "magnetometer: {table: imu, columns: {heading: yaw}, standard_deviation: 1 deg}"
    found = converted(log, accelerometer % ", position: [40 cm, 0, -10 cm]", compass).sensors
    assert found["accelerometer"].position == (0.4, 0.0, -0.1)
    assert np.array_equal(found["accelerometer"].values, felt)
    assert np.array_equal(found["magnetometer"].values[:, 0], angles[:, 2])
    assert converted(log, accelerometer % "", compass).sensors["accelerometer"].position == (0.0, 0.0, 0.0)


def test_the_field_of_the_earth_that_a_map_states_is_kept_for_estimators(converted):
    _, rates, angles = motion()
    field = 1e-6 * np.array([20.0, -3.0, 40.0]) + 1e-7 * rates
    named = dict(zip(("t", "x", "y", "z"), (TIME, *(1e6 * field * [1.0, -1.0, -1.0]).T), strict=True))
    log = MemoryLog(**{"imu": imu(rates, angles), "mag": named, "in": INPUTS})
    magnetometer = (
        "magnetic_field: {table: mag, columns: {mx: x, my: y, mz: z}, unit: uT, frame: FLU, "
        "standard_deviation: 0.2 uT, strength: 50 uT, declination: -4 deg, dip: 66 deg}"
    )
    record = converted(log, GYROSCOPE % "", magnetometer).sensors["magnetic_field"]
    assert_allclose(record.values, field, rtol=1e-12)
    level = 50e-6 * np.cos(np.deg2rad(66.0))
    expected = [level * np.cos(np.deg2rad(4.0)), -level * np.sin(np.deg2rad(4.0)), 50e-6 * np.sin(np.deg2rad(66.0))]
    assert_allclose(record.earth_field, expected, rtol=1e-12)


def test_lever_arm_without_gyroscope_follows_the_attitude(converted):
    angles = np.column_stack((0.0 * TIME, 0.0 * TIME, 0.4 * TIME))
    velocity = np.tile([2.0, 0.4 * 0.6, 0.0], (TIME.size, 1))
    log = MemoryLog(**{"imu": imu(angles, angles), "dvl": dvl(velocity), "in": INPUTS})
    found = converted(log, ATTITUDE % "", DVL % ", position: [0.6, 0, 0]")
    assert found.sensors["dvl"].values == pytest.approx(np.tile([2.0, 0.0, 0.0], (TIME.size, 1)), abs=1e-12)


def test_depth_of_the_origin_by_the_attitude(converted):
    _, rates, angles = motion()
    lever, origin = np.array([1.5, -0.2, 0.4]), 10.0 + np.sin(TIME)
    measured = origin + rotations(angles).apply(lever)[:, 2]
    angles[20] = np.nan
    # The depth is measured between two attitudes, where their mean is used.
    half = slice(0, None, 2)
    log = MemoryLog(
        **{"imu": imu(rates[half], angles[half], TIME[half]), "depth": {"t": TIME, "z": measured}, "in": INPUTS}
    )
    sensors = ATTITUDE % "", DEPTH % ("", ", position: [150 cm, -20 cm, 40 cm]")
    found = converted(log, *sensors).sensors["depth"].values[:, 0]
    assert found[[0, 2, 38]] == pytest.approx(origin[[0, 2, 38]], abs=1e-12)
    assert found[:-1] == pytest.approx(origin[:-1], abs=3e-3)
    assert np.isnan(found[-1])


def test_nose_up_a_depth_sensor_in_the_nose_is_above_the_origin(converted):
    angles = np.tile([0.0, np.radians(30.0), 0.0], (TIME.size, 1))
    log = MemoryLog(**{"imu": imu(angles, angles), "depth": {"t": TIME, "z": np.full(TIME.size, 9.0)}, "in": INPUTS})
    attitude = (ATTITUDE % "").replace(", psi: yaw", "")
    found = converted(log, attitude, DEPTH % ("", ", position: [2 m, 0 m, 0 m]"))
    assert found.sensors["depth"].values[:, 0] == pytest.approx(np.full(TIME.size, 10.0), abs=1e-12)


def test_noise_below_resolution_is_reported(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, np.round(angles, 1)), "in": INPUTS})
    found = converted(log, (ATTITUDE % "").replace("0.01", "estimate"))
    assert found.sensors["attitude"].standard_deviation == pytest.approx([0.0288675] * 3, rel=1e-5)
    said = "noise smaller than the resolution, assumed to be step / sqrt(12): phi 0.1, theta 0.1, psi 0.1 rad"
    assert said in found.summaries[0].remarks


def test_one_clock_for_logs_that_begin_apart(converted):
    velocity, rates, angles = motion()
    log = MemoryLog(
        **{"imu": imu(rates, angles, TIME + 100.3), "dvl": dvl(velocity, 1e3 * (TIME + 99.0)), "in": INPUTS}
    )
    found = converted(
        log,
        GYROSCOPE % "",
        DVL % ", time: {column: t, unit: ms, offset: 1 s}",
        inputs="{table: in, time: {column: t, offset: 99.5 s}, rudder: dr}",
    )
    assert found.origin == pytest.approx(100.0)
    assert found.sensors["gyroscope"].time[0] == pytest.approx(0.3)
    assert found.sensors["dvl"].time[0] == pytest.approx(0.0)
    # The inputs begin half a second before, and what they hold then they hold at t = 0.
    assert found.inputs.time[0] == 0.0
    assert found.inputs.values[0, 0] == pytest.approx(0.1 * np.sin(0.5))


def test_disorder_is_sorted_and_reported(converted):
    _, rates, angles = motion()
    time, order = TIME.copy(), np.arange(TIME.size)
    order[[4, 5]] = 5, 4
    doubled = np.append(order, 7)
    log = MemoryLog(**{"imu": imu(rates[doubled], angles[doubled], time[doubled]), "in": INPUTS})
    found = converted(log, GYROSCOPE % "")
    assert np.array_equal(found.sensors["gyroscope"].values, rates)
    summary = found.summaries[0]
    assert summary.duplicates == 1
    assert "time went back in 2 rows, by up to 1.6 s: sorted" in summary.remarks


def test_validity_limits_and_spans(converted):
    velocity, rates, angles = motion()
    velocity[10, 1] = 9.0
    flags = np.where(np.arange(TIME.size) == 20, "False", "True")
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(velocity) | {"ok": flags}, "in": INPUTS})
    sensor = (
        "dvl: {table: dvl, columns: {u: u, v: {column: v, limits: [-5, 5 m/s]}, w: w}, standard_deviation: 0.01, "
        "valid: {column: ok}, exclude: [1.5 s, 1.6 s]}"
    )
    found = converted(log, sensor, GYROSCOPE % "", more="use: [[0.2, 1.0], [1.2, 3.0]]\nexclude: [0.3, 0.4]")
    values = dict(zip(np.round(found.sensors["dvl"].time, 3), found.sensors["dvl"].values, strict=True))
    assert min(values) == 0.2
    assert 1.1 not in values
    assert np.isnan(values[0.5]).tolist() == [False, True, False]
    assert np.isnan(values[1.0]).all()
    assert [time for time, row in values.items() if np.isnan(row).all()] == [0.3, 0.35, 0.4, 1.0, 1.5, 1.55, 1.6]
    assert found.sensors["gyroscope"].time[[0, -1]] == pytest.approx([0.2, 1.95])


def test_repeats_of_a_slower_sensor_are_dropped(converted):
    velocity, rates, angles = motion()
    held = velocity[(np.arange(TIME.size) // 4) * 4]
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(held), "in": INPUTS})
    found = converted(log, DVL % ", repeats: drop")
    assert found.sensors["dvl"].time == pytest.approx(TIME[::4])
    assert np.array_equal(found.sensors["dvl"].values, velocity[::4])


def test_unit_of_map_overrides_header(converted):
    _, rates, angles = motion()
    table = imu(np.degrees(rates), angles)
    stated = table | {name: (table[name], "Deg/s") for name in "pqr"} | {"t": (1e3 * TIME, "ms")}
    found = converted(MemoryLog(**{"imu": stated, "in": INPUTS}), GYROSCOPE % "")
    assert found.sensors["gyroscope"].values == pytest.approx(rates, abs=1e-14)
    assert found.sensors["gyroscope"].time == pytest.approx(TIME)


def test_counts_of_fins_and_percent_of_a_thruster(converted):
    _, rates, angles = motion()
    table = {"t": TIME, "top": 128 - 2 * TIME, "right": 140 + 0 * TIME, "left": 116 + 0 * TIME, "cmd": 50 + 0 * TIME}
    fin = "{column: %s, centre: 128, scale: 0.5 deg, sign: %d}"
    fins = f"{{top: {fin % ('top', -1)}, right: {fin % ('right', 1)}, left: {fin % ('left', -1)}}}"
    log = MemoryLog(**{"imu": imu(rates, angles), "in": table})
    inputs = f"{{table: in, fins: {fins}, thrust: {{share: cmd, full: 8 N}}, roll_moment: propeller}}"
    found = converted(log, GYROSCOPE % "", inputs=inputs)
    assert found.inputs.values[:, 0] == pytest.approx(np.radians(TIME), abs=1e-14)
    assert found.inputs.values[:, 1] == pytest.approx(np.full(TIME.size, np.radians(6.0)))
    assert found.inputs.values[:, 2] == pytest.approx(np.full(TIME.size, 2.0))


@pytest.mark.parametrize("share", ["{column: cmd, unit: '1'}", "{column: cmd, unit: 1}", "fraction"])
def test_share_of_a_thruster_as_a_fraction(converted, share):
    """Half of the command is a quarter of the force."""
    _, rates, angles = motion()
    table = {"t": TIME, "cmd": np.full(TIME.size, 0.5), "fraction": (np.full(TIME.size, 0.5), "1")}
    log = MemoryLog(**{"imu": imu(rates, angles), "in": table})
    found = converted(log, GYROSCOPE % "", inputs=f"{{table: in, thrust: {{share: {share}, full: 8 N}}}}")
    assert found.inputs.values[:, 2] == pytest.approx(np.full(TIME.size, 2.0))


@pytest.mark.parametrize(
    ("largest", "share", "refused"), [(1.5, "cmd", True), (1.5, "stated", False), (0, "cmd", False)]
)
def test_thruster_share_without_unit_must_look_like_percent(converted, largest, share, refused):
    _, rates, angles = motion()
    wave = largest * np.cos(np.linspace(0, 3, TIME.size))
    log = MemoryLog(**{"imu": imu(rates, angles), "in": {"t": TIME, "cmd": wave, "stated": (wave, "%")}})
    inputs = f"{{table: in, thrust: {{share: {share}, full: 8 N}}}}"
    if refused:
        with pytest.raises(
            ConfigError, match=r"inputs\.thrust\.share: reaches only 1\.5 and has no unit: state `unit: '1'`"
        ):
            converted(log, GYROSCOPE % "", inputs=inputs)
    else:
        found = converted(log, GYROSCOPE % "", inputs=inputs)
        assert np.abs(found.inputs.values[:, 2]).max() == pytest.approx(8.0 * (0.01 * largest) ** 2)


@pytest.mark.parametrize(("time", "said"), [("'@log_time'", True), ("'@header_stamp'", False)])
def test_worse_clock_is_reported(converted, rng, time, said):
    _, rates, angles = motion()
    clocks = {"@log_time": 1e9 + TIME + rng.uniform(0, 0.045, TIME.size), "@header_stamp": 1e9 + TIME}
    log = MemoryLog(**{"imu": imu(rates, angles) | clocks, "in": INPUTS | clocks})
    inputs = f"{{table: in, rudder: dr, time: {time}}}"
    found = converted(log, GYROSCOPE % f", time: {time}", inputs=inputs)
    for summary in found.summaries:
        remarks = [text for text in summary.remarks if "drifts from" in text]
        assert len(remarks) == said
        assert all(text.endswith("`time: '@header_stamp'` would be better") for text in remarks)


def test_gap_of_sensor_is_reported(converted):
    velocity, rates, angles = motion()
    time = np.where(TIME < 1.0, TIME, TIME + 4.0)
    log = MemoryLog(**{"imu": imu(rates, angles, time), "dvl": dvl(velocity, 0.15 * TIME / TIME[1]), "in": INPUTS})
    found = converted(log, GYROSCOPE % "", DVL % "")
    remarks = {summary.name: [text for text in summary.remarks if "gap" in text] for summary in found.summaries}
    assert remarks["gyroscope"][0].startswith("1 gap, the longest of 4.05 s from t = 0.95 s: ")
    assert remarks["dvl"] == []


@pytest.mark.parametrize(
    ("column", "unit", "refused"),
    [("n", "", True), ("n", ", unit: rpm", False), ("stated", "", False), ("n", ", scale: 1 rpm", False)],
)
def test_revolutions_of_a_propeller_need_a_unit(converted, column, unit, refused):
    velocity, _, _ = motion()
    turns = np.full(TIME.size, 600.0)
    log = MemoryLog(**{"dvl": dvl(velocity), "in": {"t": TIME, "n": turns, "stated": (turns, "rpm")}})
    law = f"{{table: in, thrust: {{revolutions: {{column: {column}{unit}}}, a: 0.05 N*s^2}}}}"
    if refused:
        with pytest.raises(ConfigError, match=r":\d+:\d+: inputs\.thrust\.revolutions: has no unit.*rpm"):
            converted(log, DVL % "", inputs=law)
    else:
        assert converted(log, DVL % "", inputs=law).inputs.values[:, 2] == pytest.approx(np.full(TIME.size, 5.0))


def test_propeller_that_loses_thrust_with_speed(converted):
    velocity, _, _ = motion()
    log = MemoryLog(**{"dvl": dvl(velocity), "in": {"t": TIME, "n": np.full(TIME.size, 600.0)}})
    law = "{table: in, thrust: {revolutions: {column: n, unit: rpm}, a: 0.05 N*s^2, b: -0.1 N*s^2/m}}"
    found = converted(log, DVL % "", inputs=law)
    assert found.inputs.values[:, 2] == pytest.approx(0.05 * 100.0 - 0.1 * 10.0 * velocity[:, 0])


@pytest.mark.parametrize(
    ("sensors", "inputs", "message"),
    [
        ([DVL % ", frame: NED"], INPUT_MAP, "sensors.dvl.frame: NED velocities need an `attitude`"),
        ([DVL % ", position: [1, 0, 0]"], INPUT_MAP, "sensors.dvl.position: a lever arm needs a `gyroscope` or"),
        ([DEPTH % ("", ", position: [1, 0, 0]")], INPUT_MAP, "sensors.depth.position: a lever arm needs an `attitude`"),
        (
            [(ATTITUDE % "").replace("theta: pitch, ", ""), DEPTH % ("", ", position: [1, 0, 0]")],
            INPUT_MAP,
            "sensors.depth.position: a lever arm needs an `attitude` with pitch",
        ),
        ([DEPTH % ("", ", position: [1, 0]")], INPUT_MAP, "expected [forward, starboard, down]"),
        (
            [(GYROSCOPE % "").replace("p: p, ", ""), DVL % ", position: [1, 0, 0]"],
            INPUT_MAP,
            "sensors.dvl.position: a lever arm needs a `gyroscope` or an `attitude` of pitch and heading",
        ),
        (
            [(GYROSCOPE % "").replace("p: p", "p: pp")],
            INPUT_MAP,
            "columns.p: memory: no column in imu named 'pp'",
        ),
        (
            [(GYROSCOPE % "").replace("imu", "imo")],
            INPUT_MAP,
            "table: memory: no table named 'imo'; expected 'imu'",
        ),
        ([(GYROSCOPE % "").replace("p: p", "p: flag")], INPUT_MAP, "has text; expected numbers"),
        ([(GYROSCOPE % ", log: b")], INPUT_MAP, "sensors.gyroscope.log: no log named 'b'"),
        ([GYROSCOPE % ", time: zero"], INPUT_MAP, "sensors.gyroscope.time: 'zero' never changes"),
        ([GYROSCOPE % ", time: flag"], INPUT_MAP, "sensors.gyroscope.time: 'x' is not a time"),
        ([GYROSCOPE % ", time: {column: t, offset: 1 h}", DVL % ""], INPUT_MAP, "no time in common: gyroscope is from"),
        ([GYROSCOPE % ", exclude: [0, 1 h]"], INPUT_MAP, "no valid samples"),
        ([GYROSCOPE % ", unit: turn/ms"], INPUT_MAP, "sensors.gyroscope: reaches"),
        ([(ATTITUDE % ", mount: backward").replace("phi: roll, ", "")], INPUT_MAP, "all three angles"),
        ([(GYROSCOPE % "").replace("0.01", "estimate").replace("p: p", "p: zero")], INPUT_MAP, "repeat the one before"),
        ([(GYROSCOPE % "").replace("p: p", "p: inches")], INPUT_MAP, "the log states the unit 'inch' of 'inches'"),
        ([GYROSCOPE % ""], "{table: in, rudder: {column: dr, scale: 100}}", "inputs.rudder: deflects"),
        (
            [GYROSCOPE % ""],
            "{table: in, rudder: {column: dr, time: {column: t, offset: 1 h}}}",
            "no time in common with",
        ),
        (
            [GYROSCOPE % ""],
            "{rudder: dr}",
            "inputs.rudder: missing key 'table': one of those in memory: imu, dvl, depth, in",
        ),
        (
            [GYROSCOPE % ""],
            "{table: in, thrust: {revolutions: {column: dr, unit: rpm}, a: 1, b: -1}}",
            "needs the speed",
        ),
    ],
)
def test_map_that_does_not_fit_log_raises_config_error(converted, sensors, inputs, message):
    velocity, rates, angles = motion()
    table = imu(rates, angles) | {"zero": 0 * TIME, "flag": np.full(TIME.size, "x"), "inches": (TIME, "inch")}
    log = MemoryLog(**{"imu": table, "dvl": dvl(velocity), "depth": {"t": TIME, "z": TIME}, "in": INPUTS})
    with pytest.raises(ConfigError) as caught:
        converted(log, *sensors, inputs=inputs)
    assert message in str(caught.value)


def test_same_error_is_reported_once(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS})
    with pytest.raises(ConfigError) as caught:
        converted(log, GYROSCOPE % "", inputs=INPUT_MAP.replace("table: in", "table: in, time: tt"))
    assert str(caught.value).count("no column in in named 'tt'") == 1


def test_log_without_rows_is_reported_once(converted):
    empty = {name: values[:0] for name, values in (imu(TIME[:, None] * np.ones(3), TIME[:, None] * np.ones(3))).items()}
    with pytest.raises(ConfigError) as caught:
        converted(MemoryLog(**{"imu": empty, "in": INPUTS}), GYROSCOPE % "", ATTITUDE % "")
    assert str(caught.value).count("logs.log: imu has no rows") == 1


def test_zero_inputs_are_distinguished_from_unmapped(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS | {"none": 0 * TIME}})
    found = converted(log, GYROSCOPE % "", inputs="{table: in, fins: {right: none}, surge_force: none}")
    assert found.remarks == ("elevator, surge_force: zero all the time", "rudder, roll_moment: not in the map, so zero")


def test_all_errors_are_reported_with_positions(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS})
    with pytest.raises(ConfigError) as caught:
        converted(log, (GYROSCOPE % "").replace("q: q", "q: qq"), (ATTITUDE % "").replace("pitch", "pich"), DVL % "")
    message = str(caught.value)
    assert "map.yaml:7:46: sensors.gyroscope.columns.q: memory: no column in imu named 'qq'" in message
    assert "no column in imu named 'pich'; expected 'pitch'" in message
    assert "sensors.dvl.table: memory: no table named 'dvl'" in message


def test_input_may_be_constant(converted):
    velocity, *_ = motion()
    log = MemoryLog(**{"dvl": dvl(velocity), "in": INPUTS})
    found = converted(log, DVL % "", inputs="{table: in, rudder: dr, elevator: 0, surge_force: {constant: 10.9 N}}")
    assert_allclose(found.inputs.values[:, 0], INPUTS["dr"])
    assert found.inputs.values[:, 1:3].tolist() == [[0.0, 10.9]] * TIME.size
    alone = converted(log, DVL % "", inputs="{surge_force: {constant: 10.9 N}, rudder: {constant: 2 deg}}").inputs
    assert_allclose(alone.values, [[np.radians(2.0), 0.0, 10.9, 0.0]] * 2)
    # They hold as long as the sensors measure, and estimators take them to.
    assert_allclose(alone.time, [0.0, np.ptp(TIME)])
    assert not alone.ends_before(float(alone.time[-1]))
    with pytest.raises(ConfigError, match="'column' or 'constant'"):
        converted(log, DVL % "", inputs="{table: in, rudder: {column: dr, constant: 0 deg}}")


@pytest.mark.parametrize(("silent", "said"), [(0.5, False), (1.5, True)])
def test_fins_that_end_early_are_reported(converted, silent, said):
    velocity, *_ = motion()
    fins = {"t": TIME - silent, "dr": INPUTS["dr"]}
    remarks = converted(
        MemoryLog(**{"dvl": dvl(velocity), "in": fins}), DVL % "", inputs="{table: in, rudder: dr}"
    ).remarks
    assert any("rudder ends at t = 0.45 s, 1.5 s before the sensors" in remark for remark in remarks) == said
