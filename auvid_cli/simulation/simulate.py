"""Simulation of a run: true motion, disturbances, then the samples of all sensors with their errors."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from zlib import crc32

import numpy as np

from auvid_cli.arrays import Array, release_memory, wrap, zeros
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.extra_states import Disturbance
from auvid_cli.config.manoeuvre import FinTrim, ManoeuvreSettings
from auvid_cli.config.sensors import Accelerometer, Attitude, Dvl, MagneticField, SensorSettings, SensorSuite
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord, TruthRecord, shared_clock
from auvid_cli.numerics import compiled, types
from auvid_cli.simulation.ahrs import attitude_reference
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import BLOCK, Truth, sample_motion, simulate_motion
from auvid_cli.vehicle.parameters import DISTURBANCE, INPUTS, MOTION_SYMBOLS, SENSORS, Quantity
from auvid_cli.vehicle.rigid_body import dvl_axes, earth_to_body, specific_force

_vector = types.float64[::1]


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


def record_inputs(time: Array, inputs: Array, settings: ManoeuvreSettings) -> InputRecord:
    """Return the record of inputs that are constant from each time to the next, with the errors of the settings."""
    if settings.recorded_rate is not None:
        ticks = np.arange(int(np.floor(time[-1] * settings.recorded_rate + 1e-9)) + 1) / settings.recorded_rate
        # The tolerance matches ticks of both clocks despite rounding.
        time, inputs = ticks, inputs[np.searchsorted(time, ticks + 1e-9, side="right") - 1]
    if settings.thrust_error:
        scale = [1.0 + settings.thrust_error if quantity.symbol == "surge_force" else 1.0 for quantity in INPUTS]
        inputs = inputs * scale
    return InputRecord(time - settings.input_delay if settings.input_delay else time, inputs)


def measure(truth: Truth, suite: SensorSuite, current: Array, seed: int) -> dict[str, SensorRecord]:
    """Return the records of all sensors of a suite, except an AHRS, which computes from the others.

    `current` is the velocity of the water: north, east, down, m/s. Each error of each sensor has its own random stream,
    so that a change of one does not change the others.
    """
    records: dict[str, SensorRecord] = {}
    for name, settings in suite.given().items():
        if isinstance(settings, Attitude) and settings.source == "ahrs":
            continue
        times = sample_times(settings, truth.time[-1])
        times = shared_clock(times, (truth.time, *(record.time for record in records.values())))
        measure_block = MEASUREMENT_MODELS.get(name) or partial(_motion_states, SENSORS[name])
        true = zeros((times.size, len(SENSORS[name])))
        for first in range(0, times.size, BLOCK):
            block = slice(first, first + BLOCK)
            true[block] = measure_block(_Sampled(truth, times[block], current, settings))
            release_memory()
        record = corrupt(times, true, settings, name, seed)
        records[name] = with_delay(record, settings, name, seed, truth.time[-1])
    return records


class _Sampled:
    """Truth at the times of a sensor."""

    def __init__(self, truth: Truth, times: Array, current: Array, settings: SensorSettings) -> None:
        self.truth, self.times, self.current, self.settings = truth, times, current, settings
        self.motion, self.rate = sample_motion(truth, times)


def sample_times(settings: SensorSettings, duration: float) -> Array:
    """Return the sample times of a sensor until the end of the run, s."""
    count = int(np.floor((duration - settings.start) * settings.rate + 1e-9)) + 1
    return settings.start + np.arange(max(count, 0)) / settings.rate


def _motion_states(quantities: Sequence[Quantity], sampled: _Sampled) -> Array:
    columns = [MOTION_SYMBOLS.index(quantity.symbol) for quantity in quantities]
    states = np.take(sampled.motion, columns, axis=1)
    headings = [k for k, quantity in enumerate(quantities) if quantity.symbol == "psi"]
    states[:, headings] = wrap(states[:, headings])
    return states


def _velocity_over_ground(sampled: _Sampled) -> Array:
    """Return the velocity over ground in the axes of the DVL, with its scale error."""
    motion, current, dvl = sampled.motion, sampled.current, sampled.settings
    assert isinstance(dvl, Dvl)
    velocity = motion[:, :3]
    if current.any():
        velocity = velocity + earth_to_body(motion[:, 6:], np.broadcast_to(current, (len(motion), 3)))
    if any(dvl.arm):
        velocity = velocity + np.cross(motion[:, 3:6], dvl.arm)
    return velocity @ dvl_axes(dvl.scale_error, dvl.mounting_yaw).T


def _heading(sampled: _Sampled) -> Array:
    return wrap(sampled.motion[:, 8:9])


def _magnetic_field(sampled: _Sampled) -> Array:
    settings = sampled.settings
    assert isinstance(settings, MagneticField)
    earth = np.broadcast_to(settings.earth_field, (len(sampled.motion), 3))
    return earth_to_body(sampled.motion[:, 6:], earth)


def _depth(sampled: _Sampled) -> Array:
    return np.interp(sampled.times, sampled.truth.time, sampled.truth.position[:, 2])[:, None]


def _specific_force(sampled: _Sampled) -> Array:
    """Return the specific force at the accelerometer, with its scale error."""
    accelerometer = sampled.settings
    assert isinstance(accelerometer, Accelerometer)
    force = specific_force(sampled.motion, sampled.rate, np.array(accelerometer.position))
    return (1.0 + accelerometer.scale_error) * force


# Sensors that do not measure motion states directly.
MEASUREMENT_MODELS: dict[str, Callable[[_Sampled], Array]] = {
    "accelerometer": _specific_force,
    "magnetometer": _heading,
    "magnetic_field": _magnetic_field,
    "dvl": _velocity_over_ground,
    "depth": _depth,
}


def simulate(experiment: Experiment) -> Dataset:
    """Return the dataset of a simulated experiment.

    Raises
    ------
    SimulationError
        If the vehicle leaves the range of the model.
    ConfigError
        If the vehicle's parameters are invalid or a recorded manoeuvre cannot be read.
    """
    manoeuvre = experiment.manoeuvre
    trim = draw_fin_trim(manoeuvre.fin_trim, experiment.seed)
    plan = make_plan(manoeuvre)
    # Steering and limits act on actual angles: recorded angles plus trim.
    if trim.any():
        plan.feedforward[:] += trim
    disturbance = draw_disturbance(manoeuvre.disturbance, plan.time, experiment.seed)
    truth = simulate_motion(experiment.vehicle, manoeuvre, plan, disturbance, trim=trim)
    del plan  # frees 170 MB for ten hours
    current = np.array([manoeuvre.current_north, manoeuvre.current_east, 0.0])
    records = measure(truth, experiment.sensors, current, experiment.seed)
    if ahrs := experiment.sensors.ahrs():
        duration = float(truth.time[-1])
        times = shared_clock(sample_times(ahrs.attitude, duration), (truth.time,))
        attitude = attitude_reference(records, ahrs, times)
        records["attitude"] = with_delay(attitude, ahrs.attitude, "attitude", experiment.seed, duration)
    return Dataset(
        inputs=record_inputs(truth.time, _without_trim(truth.commands, trim), manoeuvre),
        sensors=records,
        experiment=experiment,
        truth=TruthRecord(
            truth.time,
            truth.motion,
            truth.position + truth.time[:, None] * current if current.any() else truth.position,
            experiment.vehicle.all_coefficients(),
            disturbance if disturbance.any() else None,
        ),
    )


def _without_trim(commands: Array, trim: Array) -> Array:
    """Return the commands as recorded, without the unknown trim."""
    if not trim.any():
        return commands
    recorded = commands.copy()
    recorded[:, : trim.size] -= trim
    return recorded
