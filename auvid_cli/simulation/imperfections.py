"""Random errors of sensors, disturbances of the motion, and fin trims."""

from dataclasses import replace
from functools import partial
from zlib import crc32

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import Disturbance
from auvid_cli.config.manoeuvre import FinTrim
from auvid_cli.config.sensors import Accelerometer, MagneticField, SensorSettings
from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.numerics import compiled, types
from auvid_cli.vehicle.parameters import DISTURBANCE

_vector = types.float64[::1]
# Samples of noise drawn at once; all samples of ten hours at 100 Hz would take 86 MB.
BLOCK = 50_000


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return a random generator that depends only on the seed and the names of its purpose."""
    return np.random.default_rng([seed, *(crc32(name.encode()) for name in names)])


def gauss_markov(time: Array, time_constant: float, numbers: np.random.Generator) -> Array:
    """Draw a stationary first-order Gauss-Markov process of variance 1 at increasing times, s.

    Its autocorrelation over a lag is exactly ``exp(-lag / time_constant)``.
    """
    values = numbers.standard_normal(time.size)
    lag = np.diff(time) / time_constant
    values[1:] *= np.sqrt(-np.expm1(-2.0 * lag))
    _add_decayed(np.exp(-lag), values)
    return values


@compiled(types.void(_vector, _vector))
def _add_decayed(decay, values):
    """Add to each value its predecessor times the decay between them."""
    for k in range(decay.size):
        values[k + 1] += decay[k] * values[k]


def corrupt(times: Array, true: Array, settings: SensorSettings, name: str, seed: int) -> SensorRecord:
    """Add bias, drift, noise, vibration, outliers, quantisation and dropouts, in that order; `true` is overwritten."""
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
    for first in range(0, n, BLOCK):
        block = values[first : first + BLOCK]
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
    is_outlier = outliers.random(n) < settings.outlier_probability
    errors = outliers.standard_normal((int(is_outlier.sum()), components))
    values[is_outlier] += np.array(settings.outlier_size) * errors

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


def with_delay(record: SensorRecord, settings: SensorSettings, name: str, seed: int, duration: float) -> SensorRecord:
    """Return the record with the delay added to its time stamps, cut to the run from 0 to `duration`, s."""
    delay = settings.delay + settings.delay_spread * float(stream(seed, name, "delay").standard_normal())
    # Without a delay nothing is cut: the last time stamp may exceed the duration by rounding.
    return replace(record, time=record.time + delay).between(0.0, duration) if delay else record


def draw_disturbance(settings: Disturbance, time: Array, seed: int) -> Array:
    """Draw disturbing force, N, and moment, N m, shape (n, 6); each component has its own random stream."""
    drawn = np.zeros((time.size, len(DISTURBANCE)))
    for column, (quantity, (size, time_constant)) in enumerate(zip(DISTURBANCE, settings.per_axis(), strict=True)):
        if size > 0.0:
            drawn[:, column] = size * gauss_markov(time, time_constant, stream(seed, "manoeuvre", quantity.symbol))
    return drawn


def draw_fin_trim(settings: FinTrim, seed: int) -> Array:
    """Return the offsets between actual and recorded inputs, SI, shape (4,)."""
    rudder, elevator = settings.spread * stream(seed, "manoeuvre", "fin_trim").standard_normal(2)
    return np.array([settings.rudder + rudder, settings.elevator + elevator, 0.0, 0.0])


def record_inputs(time: Array, inputs: Array, rate: float | None) -> InputRecord:
    """Return the record of inputs that are constant from each time to the next; `rate`, Hz, selects a slower clock."""
    if rate is None:
        return InputRecord(time, inputs)
    ticks = np.arange(int(np.floor(time[-1] * rate + 1e-9)) + 1) / rate
    # The tolerance matches ticks of both clocks despite rounding.
    return InputRecord(ticks, inputs[np.searchsorted(time, ticks + 1e-9, side="right") - 1])
