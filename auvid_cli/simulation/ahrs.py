"""Attitude and heading reference: roll, pitch and yaw from gyroscope, accelerometer and magnetometer.

A Kalman filter of the attitude error, expressed in the NED frame, where the measurement matrices are constant
(Crassidis, Markley and Cheng, "Survey of nonlinear attitude estimation methods", J. Guid. Control Dyn. 30(1), 2007).
Each sensor has its own rate, and the magnetometer measures only the heading; AHRS packages need three field components
at one common rate.

In a turn the accelerometer also measures omega x v (a tenth of g at 3.9 m/s), which is removed with the velocity of the
DVL and the rate of the gyroscope. Other accelerations of the vehicle are treated as noise; their density makes the
filter rely on the gyroscope during a turn.
"""

from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array, wrap, zeros
from auvid_cli.config.sensors import AhrsSensors
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.errors import SimulationError
from auvid_cli.numerics import compiled, types
from auvid_cli.vehicle.rigid_body import GRAVITY

# Order at equal times: the gyroscope first, which propagates the attitude, and the output last.
_GYROSCOPE = 0
_DVL = 1
_ACCELEROMETER = 2
_MAGNETOMETER = 3
_OUTPUT = 4
_INITIAL_TILT = np.deg2rad(3.0)  # standard deviation, rad


def attitude_reference(records: dict[str, SensorRecord], sensors: AhrsSensors, times: Array) -> SensorRecord:
    """Return estimated roll, pitch and yaw at some times, s.

    `records` holds gyroscope, accelerometer, magnetometer and dvl; `sensors` has their noise, not their biases.
    The result has the standard deviation of `sensors.attitude`. It must be larger than the scatter, because
    the errors of an AHRS are autocorrelated.
    """
    settings = sensors.attitude
    gyroscope, dvl, accelerometer, magnetometer = (
        records[name] for name in ("gyroscope", "dvl", "accelerometer", "magnetometer")
    )
    sources = (gyroscope, dvl, accelerometer, magnetometer)
    if any(np.isnan(source.values).all() for source in sources):
        raise SimulationError("the AHRS needs at least one sample of gyroscope, accelerometer, magnetometer and DVL")
    gyro_noise = np.array(sensors.gyroscope.noise_standard_deviation()) / np.sqrt(sensors.gyroscope.rate)
    force_variance = np.mean(np.square(sensors.accelerometer.noise_standard_deviation()))
    force_variance += settings.ahrs.manoeuvre_acceleration**2 * sensors.accelerometer.rate
    noise = _Noise(
        rate_density=float(np.mean(gyro_noise**2)),
        force_variance=float(force_variance / GRAVITY**2),
        heading_variance=sensors.magnetometer.noise_standard_deviation()[0] ** 2,
        gyro_bias=settings.ahrs.gyro_bias,
    )
    not_measured = np.full((2, 3), np.nan)
    values = zeros((times.size, 3))
    values.fill(np.nan)
    _run(
        (*(source.time for source in sources), times),
        (*(source.values for source in sources), values),
        noise,
        np.zeros(5, np.int64),
        _Ahrs(np.eye(3), np.zeros((6, 6)), np.zeros((6, 6)), *not_measured, *np.zeros((3, 3)), *np.zeros((3, 6))),
    )
    return SensorRecord(times, values, np.array(settings.stated_standard_deviation()))


class _Noise(NamedTuple):
    """Noise of the sensors: spectral density of the gyroscope, variances, and standard deviation of the gyro bias."""

    rate_density: float  # (rad/s)^2/Hz
    force_variance: float  # accelerometer and the vehicle's own acceleration, g^2
    heading_variance: float  # rad^2
    gyro_bias: float  # rad/s


class _Ahrs(NamedTuple):
    """State of the filter, and work arrays; vectors have shape (3,) unless noted."""

    rotation: Array  # body to NED, shape (3, 3)
    covariance: Array  # shape (6, 6); covariance of the errors of attitude (NED) and gyro bias
    moved: Array  # work array, shape (6, 6)
    rate: Array  # last measurement, NaN before the first
    velocity: Array  # last measurement, NaN before the first
    bias: Array  # estimate, rad/s
    body: Array  # work array, in the body frame
    turn: Array  # work array, in NED
    row: Array  # work array, shape (6,)
    error: Array  # work array, shape (6,)
    gain: Array  # work array, shape (6,)


_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_AHRS = types.NamedTuple((*[_matrix] * 3, *[_vector] * 8), _Ahrs)
_NOISE = types.NamedUniTuple(types.float64, 4, _Noise)

_wrap = compiled(inline=True)(wrap)


@compiled()
def _missing(values):
    return np.isnan(values[0] + values[1] + values[2])


@compiled()
def _correct(ahrs, residual, variance):
    """Kalman update of error and covariance with a scalar measurement of `row` times the error."""
    row, error, gain, covariance = ahrs.row, ahrs.error, ahrs.gain, ahrs.covariance
    total, predicted = variance, 0.0
    for i in range(6):
        gain[i] = 0.0
        for j in range(6):
            gain[i] += covariance[i, j] * row[j]
    for i in range(6):
        total += row[i] * gain[i]
        predicted += row[i] * error[i]
    if total <= 0.0:
        return  # The predicted value and the measurement are both exact.
    for i in range(6):
        error[i] += gain[i] * (residual - predicted) / total
    for i in range(6):
        for j in range(6):
            covariance[i, j] -= gain[i] * gain[j] / total


@compiled()
def _turn_on_the_left(rotation, angle):
    """Replace a rotation by exp(angle x) rotation, Rodrigues' formula."""
    norm = np.sqrt(angle[0] ** 2 + angle[1] ** 2 + angle[2] ** 2)
    a = np.sin(norm) / norm if norm > 1e-12 else 1.0
    b = (1.0 - np.cos(norm)) / norm**2 if norm > 1e-12 else 0.5
    for column in range(3):
        x, y, z = rotation[0, column], rotation[1, column], rotation[2, column]
        cx, cy, cz = angle[1] * z - angle[2] * y, angle[2] * x - angle[0] * z, angle[0] * y - angle[1] * x
        rotation[0, column] = x + a * cx + b * (angle[1] * cz - angle[2] * cy)
        rotation[1, column] = y + a * cy + b * (angle[2] * cx - angle[0] * cz)
        rotation[2, column] = z + a * cz + b * (angle[0] * cy - angle[1] * cx)


@compiled()
def _apply(ahrs):
    """Correct attitude and bias by the estimated error, and reset the error to 0."""
    _turn_on_the_left(ahrs.rotation, ahrs.error)
    for i in range(3):
        ahrs.bias[i] += ahrs.error[3 + i]
    for i in range(6):
        ahrs.error[i] = 0.0


@compiled()
def _to_navigation(ahrs):
    """Rotate the vector `body` to NED, into `turn`."""
    rotation, body = ahrs.rotation, ahrs.body
    for i in range(3):
        ahrs.turn[i] = rotation[i, 0] * body[0] + rotation[i, 1] * body[1] + rotation[i, 2] * body[2]


@compiled()
def _propagate(ahrs, rate, interval, rate_density):
    """Propagate attitude and covariance with the mean of the last rate and this one."""
    rotation, covariance, moved = ahrs.rotation, ahrs.covariance, ahrs.moved
    for i in range(3):
        ahrs.body[i] = (0.5 * (ahrs.rate[i] + rate[i]) - ahrs.bias[i]) * interval
    _to_navigation(ahrs)
    # error' = [I, -R dt; 0, I] error, since the bias is subtracted from the rate.
    for i in range(6):
        for j in range(6):
            total = covariance[i, j]
            if i < 3:
                for k in range(3):
                    total -= interval * rotation[i, k] * covariance[3 + k, j]
            moved[i, j] = total
    for i in range(6):
        for j in range(6):
            total = moved[i, j]
            if j < 3:
                for k in range(3):
                    total -= interval * rotation[j, k] * moved[i, 3 + k]
            covariance[i, j] = total
    for i in range(3):
        covariance[i, i] += rate_density * interval
    _turn_on_the_left(rotation, ahrs.turn)


@compiled()
def _remove_turn(ahrs, force):
    """Store the specific force without its part omega x v in `body`."""
    rate, bias, velocity = ahrs.rate, ahrs.bias, ahrs.velocity
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        ahrs.body[i] = force[i] - (rate[j] - bias[j]) * velocity[k] + (rate[k] - bias[k]) * velocity[j]


@compiled()
def _begin(ahrs, heading, noise):
    """Initialise roll and pitch from the measured force, and yaw from a heading."""
    body, rotation, covariance = ahrs.body, ahrs.rotation, ahrs.covariance
    phi = np.arctan2(-body[1], -body[2])
    theta = np.arctan2(body[0], np.hypot(body[1], body[2]))
    s1, c1, s2, c2, s3, c3 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta), np.sin(heading), np.cos(heading)
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = c2 * c3, s1 * s2 * c3 - c1 * s3, c1 * s2 * c3 + s1 * s3
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = c2 * s3, s1 * s2 * s3 + c1 * c3, c1 * s2 * s3 - s1 * c3
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = -s2, s1 * c2, c1 * c2
    for i in range(3):
        covariance[i, i] = _INITIAL_TILT**2 if i < 2 else noise.heading_variance
        covariance[3 + i, 3 + i] = noise.gyro_bias**2


@compiled()
def _level(ahrs, variance):
    """Correct roll and pitch by the specific force in `body`; variance in g^2."""
    _to_navigation(ahrs)
    for axis in range(2):
        for i in range(6):
            ahrs.row[i] = 1.0 if i == axis else 0.0
        _correct(ahrs, -ahrs.turn[1] / GRAVITY if axis == 0 else ahrs.turn[0] / GRAVITY, variance)
    _apply(ahrs)


@compiled()
def _align(ahrs, heading, variance):
    """Correct the attitude by a measured heading."""
    rotation, row = ahrs.rotation, ahrs.row
    psi = np.arctan2(rotation[1, 0], rotation[0, 0])
    tangent = -rotation[2, 0] / np.hypot(rotation[2, 1], rotation[2, 2])
    for i in range(6):
        row[i] = 0.0
    row[0], row[1], row[2] = tangent * np.cos(psi), tangent * np.sin(psi), 1.0
    _correct(ahrs, _wrap(heading - psi), variance)
    _apply(ahrs)


@compiled()
def _write_attitude(rotation, attitude):
    attitude[0] = np.arctan2(rotation[2, 1], rotation[2, 2])
    attitude[1] = np.arctan2(-rotation[2, 0], np.hypot(rotation[2, 1], rotation[2, 2]))
    attitude[2] = np.arctan2(rotation[1, 0], rotation[0, 0])


@compiled()
def _copy(source, target):
    for i in range(3):
        target[i] = source[i]


@compiled()
def _earliest(times, processed):
    """Return the source of the earliest sample that is not yet processed; -1 if none is left."""
    source, earliest = -1, np.inf
    for i in range(5):
        if processed[i] < times[i].size and times[i][processed[i]] < earliest:
            source, earliest = i, times[i][processed[i]]
    return source


@compiled(
    types.void(types.UniTuple(_vector, 5), types.UniTuple(_matrix, 5), _NOISE, types.int64[::1], _AHRS),
)
def _run(times, values, noise, processed, ahrs):
    """Process all samples in the order of their times, and fill in the output.

    The filter starts at the first force after the first rate, velocity and heading.
    """
    heading, now, running = np.nan, 0.0, False
    while True:
        source = _earliest(times, processed)
        if source < 0:
            break
        time, sample = times[source][processed[source]], values[source][processed[source]]
        processed[source] += 1
        if running and time > now:
            is_new_rate = source == _GYROSCOPE and not _missing(sample)
            _propagate(ahrs, sample if is_new_rate else ahrs.rate, time - now, noise.rate_density)
        now = time
        if source == _OUTPUT:
            if running:
                _write_attitude(ahrs.rotation, sample)
        elif source == _MAGNETOMETER:
            if not np.isnan(sample[0]):
                heading = sample[0]
                if running:
                    _align(ahrs, heading, noise.heading_variance)
        elif _missing(sample):
            continue
        elif source == _GYROSCOPE:
            _copy(sample, ahrs.rate)
        elif source == _DVL:
            _copy(sample, ahrs.velocity)
        elif not (_missing(ahrs.rate) or _missing(ahrs.velocity)):
            _remove_turn(ahrs, sample)
            if running:
                _level(ahrs, noise.force_variance)
            elif not np.isnan(heading):
                _begin(ahrs, heading, noise)
                running = True
