"""From the axes of a sensor to those of the vehicle."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.log_sensors import AttitudeMap, DvlMap, InBody, MagnetometerMap, SensorMap
from auvid_cli.config.position import KeyPath
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.logs.frames import (
    ENU_TO_NED,
    FLU_TO_FRD,
    conjugate,
    euler_of_quaternion,
    product,
    quaternion_of_euler,
    rotate,
    rotation,
)
from auvid_cli.logs.measurements import MeasuredRows
from auvid_cli.logs.refusals import RefusedError
from auvid_cli.logs.sensor_motion import interpolate, velocity_at_origin
from auvid_cli.vehicle.kinematics import body_rates, earth_to_body
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]

_UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])
_CHUNK = 100_000
# s, over which depth tells how fast the vehicle sinks.
_SINKING = 1.0


def in_vehicle_axes(sensor: SensorMap, rows: MeasuredRows, path: KeyPath) -> Array:
    """Turn components to the body's axes, or about the earth's, north-east-down, as far as that needs no attitude.

    Raises
    ------
    RefusedError
        If an attitude lacks an angle that its axes call for.
    """
    symbols = [quantity.symbol for quantity in SENSORS[sensor.sensor]]
    if isinstance(sensor, AttitudeMap):
        return _attitude(sensor, rows, path)
    missing = np.full(rows.time.size, np.nan)
    values = np.column_stack([rows.values.get(symbol, missing) for symbol in symbols])
    if isinstance(sensor, MagnetometerMap):
        return 0.5 * np.pi - values if sensor.reference == "ENU" else values
    if isinstance(sensor, InBody | DvlMap):
        turn = rotation(product(_mounted(sensor), FLU_TO_FRD if sensor.frame == "FLU" else _UNTURNED))
        values = values if np.array_equal(turn, np.eye(3)) else rotate(turn, values)
    if isinstance(sensor, DvlMap) and sensor.frame == "ENU":
        values = rotate(rotation(ENU_TO_NED), values)
    return values


def turned_by_attitude(sensor: DvlMap, records: dict[str, SensorRecord]) -> str:
    """Name what of a DVL's velocity an attitude is needed for; empty if nothing is."""
    if sensor.frame in ("NED", "ENU"):
        return "velocities over ground"
    return "the lever arm" if sensor.position is not None and _whole(records, "gyroscope") is None else ""


def level_where_roll_is_unknown(records: dict[str, SensorRecord]) -> dict[str, SensorRecord]:
    """Return sensors with a roll of zero where an attitude never measures one."""
    attitude = records.get("attitude")
    if attitude is None or np.isfinite(attitude.values[:, 0]).any():
        return records
    level = attitude.values.copy()
    level[:, 0] = 0.0
    return records | {"attitude": replace(attitude, values=level)}


def complete_velocity(sensor: DvlMap, record: SensorRecord, others: dict[str, SensorRecord], path: KeyPath) -> Array:
    """Find the velocity of the vehicle's origin in body axes, with attitude and rates of other sensors at its times.

    Raises
    ------
    RefusedError
        If there is no such sensor.
    """
    values, attitude, gyroscope = record.values, _whole(others, "attitude"), _whole(others, "gyroscope")
    if sensor.frame in ("NED", "ENU"):
        if attitude is None:
            raise RefusedError((*path, "frame"), f"{sensor.frame} velocities need an `attitude` of pitch and heading")
        measured = np.asarray(np.isfinite(values).any(axis=0))
        if not measured[:2].all():
            raise RefusedError((*path, "columns"), f"{sensor.frame} velocities need both of `u` and `v`")
        if not measured[2]:
            values = np.column_stack((values[:, :2], _sinking(record.time, others, (*path, "columns"))))
        values = earth_to_body(interpolate(attitude.time, attitude.values, record.time, is_angle=True), values)
        # What depth says is not said twice.
        values = np.where(measured | [True, True, False], values, np.nan)
    if sensor.position is not None:
        if gyroscope is not None:
            rates = interpolate(gyroscope.time, gyroscope.values, record.time)
        elif attitude is not None:
            angles = interpolate(attitude.time, attitude.values, attitude.time, is_angle=True)
            known = np.isfinite(angles).all(axis=1)
            time = attitude.time[known]
            rates = interpolate(time, body_rates(time, angles[known]), record.time)
        else:
            raise RefusedError(
                (*path, "position"), "a lever arm needs a `gyroscope` or an `attitude` of pitch and heading"
            )
        values = velocity_at_origin(values, rates, np.array(sensor.position))
    return values


def _sinking(time: Array, others: dict[str, SensorRecord], path: KeyPath) -> Array:
    """Return the velocity downward by the depth, for what measures none; it hardly counts for a level vehicle."""
    depth = others.get("depth")
    if depth is None:
        raise RefusedError(path, "velocities over ground need `w` as well, or a `depth` that says how fast it sinks")
    before, after = (interpolate(depth.time, depth.values, time + side * _SINKING)[:, 0] for side in (-0.5, 0.5))
    return (after - before) / _SINKING


def _whole(records: dict[str, SensorRecord], name: str) -> SensorRecord | None:
    """Return a sensor's record if it ever measured all of its components."""
    record = records.get(name)
    return record if record is not None and np.isfinite(record.values).any(axis=0).all() else None


def _mounted(sensor: InBody | DvlMap) -> Array:
    """Return the quaternion from the sensor's axes to the body's."""
    return _UNTURNED if sensor.mount is None else quaternion_of_euler(np.array([sensor.mount.angles()]))[0]


def _attitude(sensor: AttitudeMap, rows: MeasuredRows, path: KeyPath) -> Array:
    """Return roll, pitch and yaw of the body, from north."""
    frames = (sensor.reference, sensor.frame)
    if sensor.quaternion is None and sensor.mount is None and frames in (("NED", "FRD"), ("ENU", "FLU")):
        missing = np.full(rows.time.size, np.nan)
        roll, pitch, yaw = (rows.values.get(symbol, missing) for symbol in ("phi", "theta", "psi"))
        turned = frames == ("ENU", "FLU")
        return np.column_stack((roll, -pitch, 0.5 * np.pi - yaw) if turned else (roll, pitch, yaw))
    symbols = ("phi", "theta", "psi") if sensor.quaternion is None else tuple("wxyz")
    if any(symbol not in rows.values for symbol in symbols):
        raise RefusedError(
            (*path, "columns"), "a mount, or these axes, can only be accounted for with all three angles"
        )
    if not np.isfinite(np.column_stack([rows.values[symbol] for symbol in symbols])).all(axis=1).any():
        raise RefusedError((*path, "columns"), "a mount, or these axes, need all three angles at one time")
    earth = ENU_TO_NED if sensor.reference == "ENU" else _UNTURNED
    body = product(FLU_TO_FRD if sensor.frame == "FLU" else _UNTURNED, conjugate(_mounted(sensor)))
    angles = np.empty((rows.time.size, 3))
    for begin in range(0, rows.time.size, _CHUNK):
        part = np.column_stack([rows.values[symbol][begin : begin + _CHUNK] for symbol in symbols])
        measured = quaternion_of_euler(part) if sensor.quaternion is None else part
        angles[begin : begin + _CHUNK] = euler_of_quaternion(product(product(earth, measured), body))
    return angles
