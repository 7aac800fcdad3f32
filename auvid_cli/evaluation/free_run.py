"""The identified model left to itself: predicted against measured velocities."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.blocks import LANES
from auvid_cli.compilation import compiled
from auvid_cli.data.dataset import SENSORS, Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.motion import FreeRun
from auvid_cli.filters.problem import Timeline
from auvid_cli.identification.timeline import build_timeline, initial_motion, measuring_sensors
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.dynamics import (
    N_BLOCK,
    N_COEFFICIENT_BLOCK,
    N_WORK,
    runge_kutta_step,
    vehicle_constants,
)
from auvid_cli.vehicle.parameters import MOTION, N_MOTION

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]


class VelocityError(NamedTuple):
    """A row of ``velocity_error.csv``; the error is None if not measured, or if the model blew up."""

    filter: str
    component: str
    unit: str
    mean_absolute_error: float | None


@compiled(types.void(_vector, _vector, _vector, _indices, _vector, _indices, _matrix, _matrix))
def _run(motion, coefficients, constants, piece_offset, piece_duration, piece_input, inputs, predicted):
    block, work = np.zeros(N_BLOCK), np.empty(N_WORK)
    coefficient_block = np.zeros(N_COEFFICIENT_BLOCK)
    coefficient_block[::LANES] = coefficients
    block[::LANES] = motion
    for event in range(piece_offset.size - 1):
        for piece in range(piece_offset[event], piece_offset[event + 1]):
            held = inputs[piece_input[piece]]
            runge_kutta_step(block, coefficient_block, held, constants, 1, piece_duration[piece], work)
        predicted[event] = block[::LANES]


def free_runs(dataset: Dataset, estimates: Sequence[Estimate]) -> Iterator[FreeRun]:
    """Run the model with each estimate's final coefficients from where the filter started, without any correction."""
    settings = dataset.experiment.identification
    measuring = measuring_sensors(dataset)
    start, motion = initial_motion(dataset, measuring)
    timeline = build_timeline(dataset, measuring, start, settings.integration_step)
    for estimate in estimates:
        yield FreeRun(timeline.time, _predict(dataset, estimate, timeline, motion))


def _predict(dataset: Dataset, estimate: Estimate, timeline: Timeline, motion: Array) -> Array:
    coefficients = estimate.final_coefficients()
    predicted = np.empty((timeline.time.size, N_MOTION))
    _run(
        motion,
        np.array([coefficients[symbol] for symbol in SYMBOLS]),
        vehicle_constants(dataset.experiment.vehicle.known_parameters()),
        timeline.piece_offset,
        timeline.piece_duration,
        timeline.piece_input,
        timeline.inputs,
        predicted,
    )
    return predicted


def velocity_errors(dataset: Dataset, estimate: Estimate, run: FreeRun) -> list[VelocityError]:
    """Mean absolute difference of the free run from the measured velocities, as in the paper's Table V."""
    errors = []
    for row, quantity in enumerate(MOTION[:6]):
        error = None
        for name, record in dataset.sensors.items():
            symbols = [q.symbol for q in SENSORS[name]]
            if quantity.symbol in symbols:
                column = symbols.index(quantity.symbol)
                used = np.isfinite(record.values[:, column]) & (record.time >= run.time[0] - 1e-9)
                event = np.searchsorted(run.time, record.time[used] - 1e-9)
                difference = np.abs(run.motion[event, row] - record.values[used, column])
                mean = float(difference.mean()) if difference.size else np.nan
                error = mean if np.isfinite(mean) else None
        errors.append(VelocityError(estimate.filter, quantity.symbol, quantity.unit, error))
    return errors
