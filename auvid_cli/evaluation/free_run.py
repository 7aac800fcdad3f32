"""Free runs of an identified model, and their measurement errors."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import CURRENT, DVL_ARM, DVL_SCALE, DVL_YAW, ERROR_BLOCKS
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.process import N_PREDICTED, move_freely
from auvid_cli.numerics import LANES
from auvid_cli.vehicle.coefficients import COEFFICIENTS, CoefficientSet
from auvid_cli.vehicle.equations import N_WORK, factors, vehicle_constants
from auvid_cli.vehicle.parameters import (
    AS_STATED,
    MOTION,
    MOTION_AND_DEPTH_SYMBOLS,
    MOTION_SYMBOLS,
    N_MOTION,
    SENSORS,
    ActuatorErrors,
    state_of,
)
from auvid_cli.vehicle.rigid_body import current_in_body_axes, dvl_axes

# Motion state whose measurements an additive error shifts, by symbol of the error.
_ADDED = {
    quantity.symbol: state_of(measured)
    for block in ERROR_BLOCKS
    if block.additive and block.sensor is not None
    for quantity, measured in zip(block.quantities, SENSORS[block.sensor], strict=True)
}
# Symbols of the errors of a DVL that are not additive, and of the current.
VELOCITY_ERRORS = tuple(quantity.symbol for quantity in (DVL_SCALE, DVL_YAW, *CURRENT, *DVL_ARM))
# Largest number of samples of a free run that are kept for figures.
_MOST_KEPT = 100_000


class MeasurementErrors(NamedTuple):
    """Errors of the measurements of a motion; zero if they were not estimated."""

    offset: Array  # shape (10,); added to the measurements of motion states and depth, SI
    dvl: Array  # shape (7,); errors in the order of `VELOCITY_ERRORS`, SI


def estimated_errors(state: Sequence[str], values: Array) -> MeasurementErrors:
    """Return the estimated measurement errors of a state, shape (len(state),)."""
    by_symbol = dict(zip(state, values, strict=True))
    offset = {_ADDED[symbol]: value for symbol, value in by_symbol.items() if symbol in _ADDED}
    return MeasurementErrors(
        np.array([offset.get(symbol, 0.0) for symbol in MOTION_AND_DEPTH_SYMBOLS]),
        np.array([by_symbol.get(symbol, 0.0) for symbol in VELOCITY_ERRORS]),
    )


def measured_velocity(motion: Array, errors: Array) -> Array:
    """Return the velocities that a DVL measures, shape (..., 3), m/s.

    Parameters
    ----------
    motion : ndarray, shape (..., 9)
        With the velocity through the water, SI.
    errors : ndarray, shape (7,)
        In the order of `VELOCITY_ERRORS`, SI.
    """
    return (motion[..., :3] + _ground_velocity(motion, errors)) @ dvl_axes(*errors[:2]).T


def velocity_through_water(motion: Array, errors: Array) -> Array:
    """Return the velocity through the water of motions with measured velocities; the inverse of `measured_velocity`."""
    return motion[..., :3] @ np.linalg.inv(dvl_axes(*errors[:2])).T - _ground_velocity(motion, errors)


def _ground_velocity(motion: Array, errors: Array) -> Array:
    """Return the velocity of the DVL over ground minus that of the origin through the water."""
    _, _, north, east, *arm = errors
    return current_in_body_axes(motion[..., 6:9], north, east) + np.cross(motion[..., 3:6], arm)


def measured_motion(motion: Array, errors: MeasurementErrors) -> Array:
    """Return the noiseless measurements of a motion.

    Parameters
    ----------
    motion : ndarray, shape (..., 9) or (..., 10)
        With the velocity through the water, SI, and optionally with the depth; not finite after the model diverged.

    Returns
    -------
    ndarray, shape (..., 9) or (..., 10)
        With the velocity over ground, which the DVL measures.
    """
    read = motion + errors.offset[: motion.shape[-1]]
    with np.errstate(invalid="ignore", over="ignore"):
        read[..., :3] = measured_velocity(motion, errors.dvl) + errors.offset[:3]
    return read


def motion_behind(measurement: Array, errors: MeasurementErrors) -> Array:
    """Return the motion that leads to noiseless measurements; the inverse of `measured_motion`."""
    motion = measurement - errors.offset[: measurement.shape[-1]]
    motion[..., :3] = velocity_through_water(motion, errors.dvl)
    return motion


class VelocityError(NamedTuple):
    """A row of ``velocity_error.csv``; the error is None if not measured, or if the model diverged."""

    filter: str
    component: str
    unit: str
    mean_absolute_error: float | None


class Keeper:
    """Evenly spaced samples of a free run, as many as figures need.

    Parameters
    ----------
    measuring : dict of SensorRecord
        Sensors whose measurements are the events of the run.
    """

    def __init__(self, measuring: Mapping[str, SensorRecord]) -> None:
        self._every = 1 + sum(record.time.size for record in measuring.values()) // _MOST_KEPT
        self._chunks: list[FreeRun] = []
        self._n_events = 0

    def keep(self, time: Array, motion: Array) -> None:
        """Add the next chunk of the run."""
        kept = slice(-self._n_events % self._every, None, self._every)
        self._chunks.append(FreeRun(time[kept], motion[kept].copy()))
        self._n_events += time.size

    def interrupt(self) -> None:
        """Add a row of NaN after a segment, so that figures draw no line to the next one."""
        if self._chunks:
            self._chunks.append(FreeRun(self._chunks[-1].time[-1:], np.full((1, N_MOTION), np.nan)))

    def kept(self) -> FreeRun:
        """Return the kept samples."""
        return FreeRun(*(np.concatenate(rows) for rows in zip(*self._chunks, strict=True)))


def free_motion(
    timelines: Iterable[Timeline],
    motion: Array,
    parameters: Mapping[str, float],
    coefficients: Mapping[str, float],
    actuators: ActuatorErrors = AS_STATED,
    of_vehicle: CoefficientSet = COEFFICIENTS,
) -> Iterator[tuple[Timeline, Array]]:
    """Simulate a model with the inputs alone, without measurements, chunk by chunk.

    Parameters
    ----------
    timelines : iterable of Timeline
        In time order.
    motion : ndarray, shape (9,) or (10,)
        Motion at the first event, SI, optionally followed by the depth.
    parameters, coefficients : mapping
        Parameters and coefficients of the model, SI, by symbol.
    of_vehicle : CoefficientSet
        All coefficients of the vehicle.

    Yields
    ------
    timeline : Timeline
    motion : ndarray, shape (events, 9) or (events, 10)
        At the events of the timeline, SI; not finite after the model diverged.
    """
    constants = vehicle_constants(parameters, of_vehicle.terms)
    start = np.zeros(N_PREDICTED)
    start[: motion.size] = motion
    block, row = (np.repeat(each, LANES) for each in (start, factors(coefficients, actuators, of_vehicle)))
    work = np.zeros(N_WORK)
    for timeline in timelines:
        predicted = np.empty((timeline.time.size, N_PREDICTED))
        move_freely(block, row, constants, timeline, predicted, work)
        yield timeline, predicted[:, : motion.size]


def free_run(prepared: PreparedData, estimate: Estimate) -> tuple[FreeRun, list[VelocityError]]:
    """Simulate the model with final coefficients of an estimate from the start of each segment, without correction.

    Measurements are predicted with the final estimates of sensor errors and current.

    Returns
    -------
    run : FreeRun
        Motion as the sensors measure it: over ground if a current is estimated. Evenly spaced samples of a long run.
    errors : list of VelocityError
        Mean absolute difference from every measurement of a velocity or rate, as in the paper's Table V.
    """
    measuring = prepared.measuring
    parameters = estimate.final_ballast().added_to(prepared.experiment.vehicle.known_parameters())
    model = parameters, estimate.final_coefficients(), estimate.final_actuators(), estimate.coefficient_set
    sensor_errors = estimated_errors(estimate.state, estimate.mean[-1])
    sums, counts = np.zeros(N_MOTION), np.zeros(N_MOTION)
    keeper = Keeper(measuring)
    for segment in prepared.segments:
        keeper.interrupt()
        for timeline, predicted in free_motion(segment.timelines, motion_behind(segment.motion, sensor_errors), *model):
            read = measured_motion(predicted, sensor_errors)
            keeper.keep(timeline.time, read)
            event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
            for sensor, name in enumerate(measuring):
                by_sensor = timeline.measurement_sensor == sensor
                for component, quantity in enumerate(SENSORS[name]):
                    if quantity.symbol not in MOTION_SYMBOLS:
                        continue
                    column = MOTION_SYMBOLS.index(quantity.symbol)
                    finite = by_sensor & ~np.isnan(timeline.measurement[:, component])
                    sums[column] += np.abs(read[event[finite], column] - timeline.measurement[finite, component]).sum()
                    counts[column] += np.count_nonzero(finite)
    errors = []
    for column, quantity in enumerate(MOTION[:6]):
        comparable = counts[column] and isfinite(sums[column])
        error = float(sums[column] / counts[column]) if comparable else None
        errors.append(VelocityError(estimate.filter, quantity.symbol, quantity.unit, error))
    return keeper.kept(), errors
