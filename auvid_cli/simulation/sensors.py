"""Raw sensors: what each of them reports of the true motion, at its own times."""

from functools import partial
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from auvid_cli.angles import wrap
from auvid_cli.config.sensors import Dvl, SensorSettings, SensorSuite
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.simulation.motion import Truth, sample_motion
from auvid_cli.vehicle.kinematics import GRAVITY, earth_to_body

Array = NDArray[np.float64]

# So many samples of the whole motion at once, of which a sensor keeps its few components.
_BLOCK = 50_000


def measure(truth: Truth, suite: SensorSuite, current: Array, seed: int) -> dict[str, SensorRecord]:
    """Sample gyroscope, accelerometer, magnetometer and DVL, a direct attitude sensor and a depth sensor.

    Parameters
    ----------
    truth : Truth
    suite : SensorSuite
    current : ndarray, shape (3,)
        Velocity of the water, north, east, down, m/s.
    seed : int
        Each sensor and each of its imperfections draws from a stream of its own, derived from the
        seed and the sensor's name, so that changing one leaves the others' noise as it was.
    """
    measurements = {
        "gyroscope": _rates,
        "accelerometer": _specific_force,
        "magnetometer": _heading,
        "dvl": partial(_velocity_over_ground, current),
    }
    if suite.attitude.source == "direct":
        measurements["attitude"] = _attitude
    records = {}
    for name, measurement in measurements.items():
        settings: SensorSettings = getattr(suite, name)
        times = sample_times(settings, truth.time[-1])
        blocks = [times[first : first + _BLOCK] for first in range(0, max(times.size, 1), _BLOCK)]
        true = np.concatenate([measurement(*sample_motion(truth, block)) for block in blocks])
        if isinstance(settings, Dvl):
            true = true @ _seen_by(settings).T
        records[name] = corrupt(times, true, settings, name, seed)
    if suite.depth is not None:
        times = sample_times(suite.depth, truth.time[-1])
        depth = np.interp(times, truth.time, truth.position[:, 2])
        records["depth"] = corrupt(times, depth[:, None], suite.depth, "depth", seed)
    return records


def sample_times(settings: SensorSettings, duration: float) -> Array:
    """Return the ticks of a sensor's clock from its start to the end of the run, s."""
    count = int(np.floor((duration - settings.start) * settings.rate + 1e-9)) + 1
    return settings.start + np.arange(max(count, 0)) / settings.rate


def corrupt(times: Array, true: Array, settings: SensorSettings, name: str, seed: int) -> SensorRecord:
    """Add bias, drift, noise, outliers, quantisation and dropouts, in that order."""
    n, components = true.shape

    def stream(imperfection: str) -> np.random.Generator:
        return np.random.default_rng([seed, crc32(name.encode()), crc32(imperfection.encode())])

    values = true + np.array(settings.bias)
    values += np.array(settings.bias_spread) * stream("bias").standard_normal(components)
    drift = stream("drift").standard_normal((n, components))
    drift *= np.sqrt(np.diff(times, prepend=times[:1]))[:, None] * np.array(settings.drift)
    values += np.cumsum(drift, axis=0, out=drift)
    del drift
    values += np.array(settings.noise_standard_deviation()) * stream("noise").standard_normal((n, components))

    outliers = stream("outliers")
    wild = outliers.random(n) < settings.outlier_probability
    values[wild] += np.array(settings.outlier_size) * outliers.standard_normal((int(wild.sum()), components))

    step = np.broadcast_to(np.array(settings.quantisation), components)
    for component in np.flatnonzero(step > 0.0):
        values[:, component] = step[component] * np.round(values[:, component] / step[component])
    values[stream("dropouts").random(n) < settings.dropout_probability] = np.nan
    return SensorRecord(times, values, np.array(settings.stated_standard_deviation()))


def _rates(motion: Array, rate: Array) -> Array:
    return motion[:, 3:6]


def _velocity_over_ground(current: Array, motion: Array, rate: Array) -> Array:
    """Add the velocity through the water and that of the water, in body axes."""
    if not current.any():
        return motion[:, :3]
    return motion[:, :3] + earth_to_body(motion[:, 6:], np.broadcast_to(current, (len(motion), 3)))


def _seen_by(dvl: Dvl) -> Array:
    """Return the matrix from a velocity to what a DVL sees of it, which is mounted at a small yaw and has a scale."""
    sine, cosine = np.sin(dvl.mounting_yaw), np.cos(dvl.mounting_yaw)
    return (1.0 + dvl.scale_error) * np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _attitude(motion: Array, rate: Array) -> Array:
    wrapped = motion[:, 6:9].copy()
    wrapped[:, 2] = wrap(wrapped[:, 2])
    return wrapped


def _heading(motion: Array, rate: Array) -> Array:
    return wrap(motion[:, 8:9])


def _specific_force(motion: Array, rate: Array) -> Array:
    """Find the specific force that an accelerometer feels: acceleration of the origin less gravity, in body axes."""
    down = earth_to_body(motion[:, 6:], np.broadcast_to([0.0, 0.0, 1.0], (len(motion), 3)))
    return rate[:, :3] + np.cross(motion[:, 3:6], motion[:, :3]) - GRAVITY * down
