"""Simulation of a run: true motion, then the samples of all sensors."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from auvid_cli.angles import wrap
from auvid_cli.arrays import Array
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.sensors import Accelerometer, Attitude, Dvl, MagneticField, SensorSettings, SensorSuite
from auvid_cli.data.dataset import Dataset, SensorRecord, TruthRecord, shared_clock
from auvid_cli.simulation.ahrs import attitude_reference
from auvid_cli.simulation.imperfections import corrupt, draw_disturbance, draw_fin_trim, record_inputs, with_delay
from auvid_cli.simulation.manoeuvres import make_plan
from auvid_cli.simulation.motion import Truth, sample_motion, simulate_motion
from auvid_cli.vehicle.kinematics import dvl_axes, earth_to_body, specific_force
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS, SENSORS, Quantity

# Samples of the whole motion computed at once, to limit memory.
_BLOCK = 50_000


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
        true = np.empty((times.size, len(SENSORS[name])))
        for first in range(0, times.size, _BLOCK):
            block = slice(first, first + _BLOCK)
            true[block] = measure_block(_Sampled(truth, times[block], current, settings))
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
        inputs=record_inputs(truth.time, _without_trim(truth.commands, trim), manoeuvre.recorded_rate),
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
