"""Transform measurements from sensor axes and positions to body axes and the vehicle's origin."""

from dataclasses import replace

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.log_map import AttitudeMap, DvlMap, InBody, MagnetometerMap, SensorMap
from auvid_cli.config.source_positions import KeyPath
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import gap_limit
from auvid_cli.logs.measurements import MeasuredRows
from auvid_cli.logs.requests import MapMismatchError
from auvid_cli.vehicle.parameters import SENSORS
from auvid_cli.vehicle.rigid_body import body_rates, body_to_earth, earth_to_body

# Quaternions of half turns: about x, and about the line between east and north.
FLU_TO_FRD = np.array([0.0, 1.0, 0.0, 0.0])
ENU_TO_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
_CHUNK = 100_000  # rows converted at a time
_DEPTH_RATE_WINDOW = 1.0  # s


def quaternion_of_euler(angles: Array) -> Array:
    """Return quaternions, shape (n, 4), of Euler angles, rad, shape (n, 3)."""
    cosine, sine = np.cos(0.5 * angles).T, np.sin(0.5 * angles).T
    (cr, cp, cy), (sr, sp, sy) = cosine, sine
    return np.column_stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
    )


def euler_of_quaternion(quaternion: Array) -> Array:
    """Return Euler angles, rad, shape (n, 3), of quaternions of any length, shape (n, 4); NaN for length 0."""
    length = np.sqrt(np.einsum("ij,ij->i", quaternion, quaternion))
    length[length == 0.0] = np.nan
    w, x, y, z = (quaternion / length[:, None]).T
    # The sine of the pitch alone is inaccurate near +-90 degrees.
    sine, forward_north, forward_east = 2.0 * (w * y - x * z), 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
    return np.column_stack(
        (
            np.arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
            np.arctan2(sine, np.hypot(forward_north, forward_east)),
            np.arctan2(forward_east, forward_north),
        )
    )


def product(left: Array, right: Array) -> Array:
    """Return products of quaternions; each side is one quaternion or n of them."""
    a, b, c, d = left.T
    w, x, y, z = right.T
    return np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=-1,
    )


def conjugate(quaternion: Array) -> Array:
    """Return the quaternions of the inverse rotations."""
    return quaternion * np.array([1.0, -1.0, -1.0, -1.0])


def rotation(quaternion: Array) -> Array:
    """Return the rotation matrix of a quaternion; rounding errors next to 0 and 1 are removed."""
    w, x, y, z = quaternion
    matrix = np.array(
        [
            [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    whole = np.rint(matrix)
    return np.where(np.abs(matrix - whole) < 1e-15, whole + 0.0, matrix)


def rotate(matrix: Array, vectors: Array) -> Array:
    """Rotate rows of vectors; a missing component affects only components that depend on it."""
    turned = np.zeros_like(vectors)
    for i, j in zip(*np.nonzero(matrix), strict=True):
        turned[:, i] += matrix[i, j] * vectors[:, j]
    return turned


def interpolate(time: Array, values: Array, at: Array, is_angle: bool = False) -> Array:
    """Interpolate values, shape (n, c), linearly at times; NaN outside and in gaps, see `gap_limit`.

    Missing values of a component are skipped. Angles may jump by whole turns.
    """
    return np.column_stack([_interpolated(time, column, at, is_angle) for column in values.T])


def _interpolated(time: Array, values: Array, at: Array, is_angle: bool) -> Array:
    finite = np.isfinite(values)
    time, values = time[finite], values[finite]
    if not time.size:
        return np.full(at.size, np.nan)
    interpolated = np.interp(at, time, np.unwrap(values) if is_angle else values, np.nan, np.nan)
    after = np.clip(np.searchsorted(time, at), 1, max(time.size - 1, 1))
    if time.size > 1:
        between = time[after] - time[after - 1]
        interpolated[(between > gap_limit(np.diff(time))) & ~np.isin(at, time)] = np.nan
    return interpolated


def velocity_at_origin(velocity: Array, rates: Array, position: Array) -> Array:
    """Return the velocity of the vehicle's origin from that of a sensor: v - omega x r, in body axes."""
    return velocity - np.cross(rates, position)


def depth_at_origin(down: Array, roll: Array, pitch: Array, position: Array) -> Array:
    """Return the depth of the vehicle's origin from that of a sensor: down - (R position)_z.

    The last row of R (body to north-east-down) does not contain the heading (Fossen 2011, eq. (2.18)).
    """
    angles = np.column_stack((roll, pitch, np.zeros(down.size)))
    return down - body_to_earth(angles, np.broadcast_to(position, angles.shape))[:, 2]


def in_forward_axes(quaternion: Array) -> Array:
    """Return the attitude of the body, from north, by a sensor with axes to starboard, ahead and up, from east."""
    mounted = quaternion_of_euler(np.array([[np.pi, 0.0, 0.5 * np.pi]]))[0]
    return product(product(ENU_TO_NED, quaternion), conjugate(mounted))


def in_vehicle_axes(sensor: SensorMap, rows: MeasuredRows, path: KeyPath) -> Array:
    """Return components in body axes, or over ground in north-east-down axes, without steps that need an attitude.

    Raises
    ------
    MapMismatchError
        If an attitude lacks an angle that the transformation needs.
    """
    symbols = [quantity.symbol for quantity in SENSORS[sensor.sensor]]
    if isinstance(sensor, AttitudeMap):
        return _attitude(sensor, rows, path)
    missing = np.full(rows.time.size, np.nan)
    values = np.column_stack([rows.values.get(symbol, missing) for symbol in symbols])
    if isinstance(sensor, MagnetometerMap):
        return 0.5 * np.pi - values if sensor.reference == "ENU" else values
    if isinstance(sensor, InBody | DvlMap):
        turn = rotation(product(_mounted(sensor), FLU_TO_FRD if sensor.frame == "FLU" else _IDENTITY))
        values = values if np.array_equal(turn, np.eye(3)) else rotate(turn, values)
    if isinstance(sensor, DvlMap) and sensor.frame == "ENU":
        values = rotate(rotation(ENU_TO_NED), values)
    return values


def turned_by_attitude(sensor: DvlMap, records: dict[str, SensorRecord]) -> str:
    """Return the part of a DVL's transformation that needs an attitude; empty if none does."""
    if sensor.frame in ("NED", "ENU"):
        return "velocities over ground"
    return "the lever arm" if sensor.position is not None and _complete_record(records, "gyroscope") is None else ""


def level_where_roll_is_unknown(records: dict[str, SensorRecord]) -> dict[str, SensorRecord]:
    """Return the records, with a roll of 0 for an attitude without roll."""
    attitude = records.get("attitude")
    if attitude is None or np.isfinite(attitude.values[:, 0]).any():
        return records
    level = attitude.values.copy()
    level[:, 0] = 0.0
    return records | {"attitude": replace(attitude, values=level)}


def complete_velocity(sensor: DvlMap, record: SensorRecord, others: dict[str, SensorRecord], path: KeyPath) -> Array:
    """Return the velocity of the vehicle's origin in body axes, with attitude and rates of other sensors.

    Raises
    ------
    MapMismatchError
        If a necessary sensor is missing.
    """
    values = record.values
    attitude, gyroscope = (_complete_record(others, name) for name in ("attitude", "gyroscope"))
    if sensor.frame in ("NED", "ENU"):
        if attitude is None:
            raise MapMismatchError(
                (*path, "frame"), f"{sensor.frame} velocities need an `attitude` of pitch and heading"
            )
        measured = np.asarray(np.isfinite(values).any(axis=0))
        if not measured[:2].all():
            raise MapMismatchError((*path, "columns"), f"{sensor.frame} velocities need both of `u` and `v`")
        if not measured[2]:
            values = np.column_stack((values[:, :2], _depth_rate(record.time, others, (*path, "columns"))))
        values = earth_to_body(interpolate(attitude.time, attitude.values, record.time, is_angle=True), values)
        # A component from the depth would count the depth twice.
        values = np.where(measured | [True, True, False], values, np.nan)
    if sensor.position is not None:
        if gyroscope is not None:
            rates = interpolate(gyroscope.time, gyroscope.values, record.time)
        elif attitude is not None:
            angles = interpolate(attitude.time, attitude.values, attitude.time, is_angle=True)
            complete = np.isfinite(angles).all(axis=1)
            time = attitude.time[complete]
            rates = interpolate(time, body_rates(time, angles[complete]), record.time)
        else:
            raise MapMismatchError(
                (*path, "position"), "a lever arm needs a `gyroscope` or an `attitude` of pitch and heading"
            )
        values = velocity_at_origin(values, rates, np.array(sensor.position))
    return values


def _depth_rate(time: Array, others: dict[str, SensorRecord], path: KeyPath) -> Array:
    """Return the rate of the depth, m/s, for a DVL that measures no vertical velocity."""
    depth = others.get("depth")
    if depth is None:
        raise MapMismatchError(path, "velocities over ground need `w` as well, or a `depth`")
    before, after = (
        interpolate(depth.time, depth.values, time + side * _DEPTH_RATE_WINDOW)[:, 0] for side in (-0.5, 0.5)
    )
    return (after - before) / _DEPTH_RATE_WINDOW


def _complete_record(records: dict[str, SensorRecord], name: str) -> SensorRecord | None:
    """Return a sensor's record if it has measured all of its components."""
    record = records.get(name)
    return record if record is not None and np.isfinite(record.values).any(axis=0).all() else None


def _mounted(sensor: InBody | DvlMap) -> Array:
    """Return the quaternion from the sensor's axes to the body's."""
    return _IDENTITY if sensor.mount is None else quaternion_of_euler(np.array([sensor.mount.angles()]))[0]


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
        raise MapMismatchError((*path, "columns"), "a mount, or these axes, need all three angles")
    if not np.isfinite(np.column_stack([rows.values[symbol] for symbol in symbols])).all(axis=1).any():
        raise MapMismatchError((*path, "columns"), "a mount, or these axes, need all three angles at one time")
    earth = ENU_TO_NED if sensor.reference == "ENU" else _IDENTITY
    body = product(FLU_TO_FRD if sensor.frame == "FLU" else _IDENTITY, conjugate(_mounted(sensor)))
    angles = np.empty((rows.time.size, 3))
    for begin in range(0, rows.time.size, _CHUNK):
        part = np.column_stack([rows.values[symbol][begin : begin + _CHUNK] for symbol in symbols])
        measured = quaternion_of_euler(part) if sensor.quaternion is None else part
        angles[begin : begin + _CHUNK] = euler_of_quaternion(product(product(earth, measured), body))
    return angles
