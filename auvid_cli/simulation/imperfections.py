"""What is wrong with samples of a sensor, each with a random stream of its own, and with their time stamps."""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.sensors import Accelerometer, MagneticField, SensorSettings
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.simulation.random_processes import gauss_markov, stream

Array = NDArray[np.float64]

# So many samples have their noise drawn at once: of ten hours at 100 Hz it would be 86 MB.
_BLOCK = 50_000


def corrupt(times: Array, true: Array, settings: SensorSettings, name: str, seed: int) -> SensorRecord:
    """Add bias, drift, noise, vibration, outliers, quantisation and dropouts, in that order, to `true` itself."""
    n, components = true.shape
    numbers = partial(stream, seed, name)
    values = true
    values += np.array(settings.bias)
    values += np.array(settings.bias_spread) * numbers("bias").standard_normal(components)
    if any(settings.drift):
        drift = numbers("drift").standard_normal((n, components))
        drift *= np.sqrt(np.diff(times, prepend=times[:1]))[:, None] * np.array(settings.drift)
        values += np.cumsum(drift, axis=0, out=drift)
        del drift
    noise = np.array(settings.noise_standard_deviation())
    white, size = numbers("noise"), np.sqrt(1.0 - settings.coloured_share) * noise
    for first in range(0, n, _BLOCK):
        block = values[first : first + _BLOCK]
        block += white.standard_normal(block.shape) * size
    if settings.coloured_share > 0.0:
        coloured = numbers("coloured")
        for size, component in zip(np.sqrt(settings.coloured_share) * noise, values.T, strict=True):
            component += size * gauss_markov(times, settings.coloured_time_constant, coloured)
    if any(settings.vibration):
        phases = 2.0 * np.pi * numbers("vibration").random(components)
        turns = 2.0 * np.pi * settings.vibration_frequency * times
        values += np.array(settings.vibration) * np.sin(turns[:, None] + phases)

    outliers = numbers("outliers")
    wild = outliers.random(n) < settings.outlier_probability
    values[wild] += np.array(settings.outlier_size) * outliers.standard_normal((int(wild.sum()), components))

    step = np.broadcast_to(np.array(settings.quantisation), components)
    for component in np.flatnonzero(step > 0.0):
        values[:, component] = step[component] * np.round(values[:, component] / step[component])
    values[numbers("dropouts").random(n) < settings.dropout_probability] = np.nan
    record = SensorRecord(times, values, np.array(settings.stated_standard_deviation()))
    match settings:
        case Accelerometer():
            return replace(record, position=settings.position)
        case MagneticField():
            return replace(record, earth_field=settings.earth_field)
    return record


def stamped(record: SensorRecord, settings: SensorSettings, name: str, seed: int, duration: float) -> SensorRecord:
    """Return the record as it is logged: with the delay on its time stamps, those from 0 to the end of the run, s."""
    delay = settings.delay + settings.delay_spread * float(stream(seed, name, "delay").standard_normal())
    # Of a clock without fault the last tick may round to beyond the end.
    return replace(record, time=record.time + delay).between(0.0, duration) if delay else record
