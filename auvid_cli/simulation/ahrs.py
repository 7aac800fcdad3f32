"""Attitude and heading reference: roll, pitch and yaw from gyroscope, accelerometer and magnetometer.

A Kalman filter on the attitude error, with the error expressed in the NED frame, where gravity and
north stand still and the measurement matrices are constant (Crassidis, Markley and Cheng, "Survey of
nonlinear attitude estimation methods", J. Guid. Control Dyn. 30(1), 2007, gives the family). Each
sensor comes at its own rate, and the magnetometer gives a heading only, which is why the AHRS
packages that want three field components at one common rate do not serve.

In a turn the accelerometer feels omega x v, a tenth of g at 3.9 m/s; it is removed with the DVL's
velocity and the gyro's rate. What remains of the vehicle's own acceleration has no mean, and its
stated density makes the filter trust the gyro over the length of a turn.
"""

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.config.sensors import SensorSuite
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.errors import SimulationError
from auvid_cli.simulation.sensors import GRAVITY, sample_times

Array = NDArray[np.float64]

# Order of treatment at equal times: the gyro carries the attitude there, the output comes last.
_GYROSCOPE, _DVL, _ACCELEROMETER, _MAGNETOMETER, _OUTPUT = range(5)
_INITIAL_TILT = np.deg2rad(3.0)


def attitude_reference(records: dict[str, SensorRecord], suite: SensorSuite, duration: float) -> SensorRecord:
    """Roll, pitch, yaw at the rate of `suite.attitude`.

    Parameters
    ----------
    records : dict of SensorRecord
        gyroscope, accelerometer, magnetometer and dvl.
    suite : SensorSuite
        Noise levels as stated; nothing here knows the true biases.
    duration : float
        Length of the run, s.

    Returns
    -------
    SensorRecord
        Its standard deviation is the stated one of `suite.attitude`, which must be larger than the
        scatter, because the errors of an AHRS are correlated in time.
    """
    settings = suite.attitude
    output = sample_times(settings, duration)
    gyroscope, dvl, accelerometer, magnetometer = (
        records[name] for name in ("gyroscope", "dvl", "accelerometer", "magnetometer")
    )
    sources = (gyroscope, dvl, accelerometer, magnetometer)
    if any(np.isnan(source.values).all() for source in sources):
        raise SimulationError("the AHRS needs at least one sample of gyroscope, accelerometer, magnetometer and DVL")
    gyro_noise = np.array(suite.gyroscope.noise_standard_deviation()) / np.sqrt(suite.gyroscope.rate)
    force_variance = np.mean(np.square(suite.accelerometer.noise_standard_deviation()))
    force_variance += settings.ahrs.manoeuvre_acceleration**2 * suite.accelerometer.rate
    heading_variance = suite.magnetometer.noise_standard_deviation()[0] ** 2
    values = np.full((output.size, 3), np.nan)
    _run(
        (*(source.time for source in sources), output),
        gyroscope.values,
        dvl.values,
        accelerometer.values,
        magnetometer.values,
        np.array([np.mean(gyro_noise**2), force_variance, heading_variance, settings.ahrs.gyro_bias]),
        values,
    )
    return SensorRecord(output, values, np.array(settings.stated_standard_deviation()))


_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.void(_vector, types.float64, _vector, _matrix))
def _correct(row, residual, error, covariance_and_variance):
    """Kalman update of error state and covariance by one scalar; its variance rides in the last row."""
    covariance = covariance_and_variance[:6]
    variance = covariance_and_variance[6, 0]
    gain = np.zeros(6)
    for i in range(6):
        for j in range(6):
            gain[i] += covariance[i, j] * row[j]
    total, predicted = variance, 0.0
    for i in range(6):
        total += row[i] * gain[i]
        predicted += row[i] * error[i]
    if total <= 0.0:
        return  # A perfect sensor has nothing to say about what is known exactly.
    for i in range(6):
        error[i] += gain[i] * (residual - predicted) / total
    for i in range(6):
        for j in range(6):
            covariance[i, j] -= gain[i] * gain[j] / total


@compiled(types.void(_matrix, _vector))
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


@compiled(types.void(_vector, types.float64, _matrix))
def _level(force, heading, rotation):
    """Body-to-NED rotation from a specific force taken for gravity, and a heading."""
    phi = np.arctan2(-force[1], -force[2])
    theta = np.arctan2(force[0], np.hypot(force[1], force[2]))
    s1, c1, s2, c2, s3, c3 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta), np.sin(heading), np.cos(heading)
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = c2 * c3, s1 * s2 * c3 - c1 * s3, c1 * s2 * c3 + s1 * s3
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = c2 * s3, s1 * s2 * s3 + c1 * c3, c1 * s2 * s3 - s1 * c3
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = -s2, s1 * c2, c1 * c2


@compiled(types.void(types.UniTuple(_vector, 5), _matrix, _matrix, _matrix, _matrix, _vector, _matrix))
def _run(times, gyroscope, dvl, accelerometer, magnetometer, noise, output):
    rotation, turn, force, nav = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
    rate, bias, velocity, row, error = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(6), np.zeros(6)
    covariance = np.zeros((7, 6))
    moved = np.zeros((6, 6))
    have_rate, have_velocity, have_heading, running = False, False, False, False
    heading, now = 0.0, 0.0
    treated = np.zeros(5, np.int64)
    while True:
        what, then = -1, np.inf
        for i in range(5):
            if treated[i] < times[i].size and times[i][treated[i]] < then:
                what, then = i, times[i][treated[i]]
        if what < 0:
            break
        sample = treated[what]
        treated[what] += 1
        interval = then - now
        now = then
        if running and interval > 0.0:
            fresh = what == _GYROSCOPE and not np.isnan(gyroscope[sample].sum())
            for i in range(3):
                body = 0.5 * (rate[i] + gyroscope[sample, i]) if fresh else rate[i]
                force[i] = (body - bias[i]) * interval
            for i in range(3):
                turn[i] = rotation[i, 0] * force[0] + rotation[i, 1] * force[1] + rotation[i, 2] * force[2]
            # error' = [I, -R dt; 0, I] error: the gyro's bias turns the attitude the other way.
            moved[:] = covariance[:6]
            for i in range(3):
                for j in range(6):
                    for k in range(3):
                        moved[i, j] -= interval * rotation[i, k] * covariance[3 + k, j]
            covariance[:6] = moved
            for i in range(6):
                for j in range(3):
                    for k in range(3):
                        covariance[i, j] -= interval * rotation[j, k] * moved[i, 3 + k]
            for i in range(3):
                covariance[i, i] += noise[0] * interval
            _turn_on_the_left(rotation, turn)
        if what == _GYROSCOPE and not np.isnan(gyroscope[sample].sum()):
            rate[:] = gyroscope[sample]
            have_rate = True
        elif what == _DVL and not np.isnan(dvl[sample].sum()):
            velocity[:] = dvl[sample]
            have_velocity = True
        elif what == _ACCELEROMETER and not np.isnan(accelerometer[sample].sum()) and have_rate and have_velocity:
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                cross = (rate[j] - bias[j]) * velocity[k] - (rate[k] - bias[k]) * velocity[j]
                force[i] = accelerometer[sample, i] - cross
            if running:
                for i in range(3):
                    nav[i] = rotation[i, 0] * force[0] + rotation[i, 1] * force[1] + rotation[i, 2] * force[2]
                covariance[6, 0] = noise[1] / GRAVITY**2
                error[:] = 0.0
                for axis in range(2):
                    row[:] = 0.0
                    row[axis] = 1.0
                    _correct(row, -nav[1] / GRAVITY if axis == 0 else nav[0] / GRAVITY, error, covariance)
                _turn_on_the_left(rotation, error[:3].copy())
                bias += error[3:]
            elif have_heading:
                _level(force, heading, rotation)
                for i in range(3):
                    covariance[i, i] = _INITIAL_TILT**2 if i < 2 else noise[2]
                    covariance[3 + i, 3 + i] = noise[3] ** 2
                running = True
        elif what == _MAGNETOMETER and not np.isnan(magnetometer[sample, 0]):
            heading = magnetometer[sample, 0]
            have_heading = True
            if running:
                psi = np.arctan2(rotation[1, 0], rotation[0, 0])
                tangent = -rotation[2, 0] / np.hypot(rotation[2, 1], rotation[2, 2])
                row[:] = 0.0
                row[0], row[1], row[2] = tangent * np.cos(psi), tangent * np.sin(psi), 1.0
                residual = heading - psi
                residual -= 2.0 * np.pi * np.floor(residual / (2.0 * np.pi) + 0.5)
                covariance[6, 0] = noise[2]
                error[:] = 0.0
                _correct(row, residual, error, covariance)
                _turn_on_the_left(rotation, error[:3].copy())
                bias += error[3:]
        elif what == _OUTPUT and running:
            output[sample, 0] = np.arctan2(rotation[2, 1], rotation[2, 2])
            output[sample, 1] = np.arctan2(-rotation[2, 0], np.hypot(rotation[2, 1], rotation[2, 2]))
            output[sample, 2] = np.arctan2(rotation[1, 0], rotation[0, 0])
