"""Imperfections of sensors and disturbances that no model explains, from random processes."""

from dataclasses import replace
from functools import partial
from zlib import crc32

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.config.extra_states import Disturbance
from auvid_cli.config.manoeuvre import FinTrim
from auvid_cli.config.sensors import Accelerometer, MagneticField, SensorSettings
from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.vehicle.parameters import DISTURBANCE

Array = NDArray[np.float64]
_vector = types.float64[::1]
# So many samples have their noise drawn at once: of ten hours at 100 Hz it would be 86 MB.
_BLOCK = 50_000


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the random numbers of one cause, by its names, which leave those of all others as they are."""
    return np.random.default_rng([seed, *(crc32(name.encode()) for name in names)])


def gauss_markov(time: Array, time_constant: float, numbers: np.random.Generator) -> Array:
    """Draw a stationary first-order Gauss-Markov process of variance 1.

    Its autocorrelation over a lag is ``exp(-lag / time_constant)``, exactly and at any times.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, increasing.
    time_constant : float
        s.
    numbers : numpy.random.Generator

    Returns
    -------
    ndarray, shape (n,)
    """
    values = numbers.standard_normal(time.size)
    lag = np.diff(time) / time_constant
    values[1:] *= np.sqrt(-np.expm1(-2.0 * lag))
    _carry_on(np.exp(-lag), values)
    return values


@compiled(types.void(_vector, _vector))
def _carry_on(left, values):
    for k in range(left.size):
        values[k + 1] += left[k] * values[k]


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


def with_delay(record: SensorRecord, settings: SensorSettings, name: str, seed: int, duration: float) -> SensorRecord:
    """Return the record as it is logged: with the delay on its time stamps, those from 0 to the end of the run, s."""
    delay = settings.delay + settings.delay_spread * float(stream(seed, name, "delay").standard_normal())
    # Of a clock without fault the last tick may round to beyond the end.
    return replace(record, time=record.time + delay).between(0.0, duration) if delay else record


def draw_disturbance(settings: Disturbance, time: Array, seed: int) -> Array:
    """Return force and moment from each time to the next, N and N m, shape (n, 6); each has a stream of its own."""
    drawn = np.zeros((time.size, len(DISTURBANCE)))
    for column, (quantity, (size, time_constant)) in enumerate(zip(DISTURBANCE, settings.per_axis(), strict=True)):
        if size > 0.0:
            drawn[:, column] = size * gauss_markov(time, time_constant, stream(seed, "manoeuvre", quantity.symbol))
    return drawn


def draw_fin_trim(settings: FinTrim, seed: int) -> Array:
    """Return how far the inputs of a vehicle are off from what is recorded of them, shape (4,)."""
    rudder, elevator = settings.spread * stream(seed, "manoeuvre", "fin_trim").standard_normal(2)
    return np.array([settings.rudder + rudder, settings.elevator + elevator, 0.0, 0.0])


def record_inputs(time: Array, inputs: Array, rate: float | None) -> InputRecord:
    """Write down inputs, each of which holds from its time to the next: all, or those of a slower clock, Hz."""
    if rate is None:
        return InputRecord(time, inputs)
    ticks = np.arange(int(np.floor(time[-1] * rate + 1e-9)) + 1) / rate
    # A tick of both clocks is one, however either rounds it.
    return InputRecord(ticks, inputs[np.searchsorted(time, ticks + 1e-9, side="right") - 1])
