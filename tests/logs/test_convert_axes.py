"""Axes by a map: frames, mountings, lever arms, and velocity over ground."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.rigid_body import body_rates
from tests.logs.memory_log import (
    ATTITUDE,
    DEPTH,
    DVL,
    FLU,
    GYROSCOPE,
    INPUTS,
    NED_OF_ENU,
    TIME,
    MemoryLog,
    dvl,
    imu,
    motion,
    rotations,
)


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


@pytest.mark.slow
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
