"""The identified model left to itself: predicted against measured velocities."""

from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.blocks import LANES
from auvid_cli.data.dataset import SENSORS, Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.motion import FreeRun
from auvid_cli.identification.free_motion import move_freely
from auvid_cli.identification.segments import stretches
from auvid_cli.identification.timeline import measuring_sensors
from auvid_cli.vehicle.dynamics import N_WORK, factors, vehicle_constants
from auvid_cli.vehicle.parameters import MOTION, MOTION_SYMBOLS, N_MOTION

Array = NDArray[np.float64]

# Samples of a free run that are kept to be drawn.
_MOST_KEPT = 100_000


class VelocityError(NamedTuple):
    """A row of ``velocity_error.csv``; the error is None if not measured, or if the model blew up."""

    filter: str
    component: str
    unit: str
    mean_absolute_error: float | None


def free_run(dataset: Dataset, estimate: Estimate) -> tuple[FreeRun, list[VelocityError]]:
    """Run the model with an estimate's final coefficients from where the filter started, without any correction.

    Returns
    -------
    run : FreeRun
        Of a long run evenly spaced samples, no more than are drawn.
    errors : list of VelocityError
        Mean absolute difference from every reading of a velocity or rate, as in the paper's Table V.
    """
    measuring = measuring_sensors(dataset)
    constants = vehicle_constants(dataset.experiment.vehicle.known_parameters())
    final = factors(estimate.final_coefficients(), estimate.final_thrust())
    coefficients, work = np.repeat(final, LANES), np.zeros(N_WORK)
    every = 1 + sum(record.time.size for record in measuring.values()) // _MOST_KEPT
    sums, counts = np.zeros(N_MOTION), np.zeros(N_MOTION)
    runs, n_events = [], 0
    for stretch in stretches(dataset):
        block = np.repeat(stretch.motion, LANES)
        if runs:
            # A line that is drawn through is broken between two stretches.
            runs.append(FreeRun(runs[-1].time[-1:], np.full((1, N_MOTION), np.nan)))
        for timeline in stretch.timelines:
            predicted = np.empty((timeline.time.size, N_MOTION))
            move_freely(block, coefficients, constants, timeline, predicted, work)
            kept = slice(-n_events % every, None, every)
            runs.append(FreeRun(timeline.time[kept], predicted[kept].copy()))
            n_events += timeline.time.size
            event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.reading_offset))
            for sensor, name in enumerate(measuring):
                own = timeline.reading_sensor == sensor
                for component, quantity in enumerate(SENSORS[name]):
                    if quantity.symbol not in MOTION_SYMBOLS:
                        continue
                    column = MOTION_SYMBOLS.index(quantity.symbol)
                    said = own & ~np.isnan(timeline.reading[:, component])
                    sums[column] += np.abs(predicted[event[said], column] - timeline.reading[said, component]).sum()
                    counts[column] += np.count_nonzero(said)
    errors = []
    for column, quantity in enumerate(MOTION[:6]):
        known = counts[column] and isfinite(sums[column])
        error = float(sums[column] / counts[column]) if known else None
        errors.append(VelocityError(estimate.filter, quantity.symbol, quantity.unit, error))
    return FreeRun(*(np.concatenate(rows) for rows in zip(*runs, strict=True))), errors
