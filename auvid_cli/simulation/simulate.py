"""A whole simulated run: plan, true motion, raw sensors, attitude."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import Experiment
from auvid_cli.data.dataset import Dataset, TruthRecord, shared_clock
from auvid_cli.simulation.ahrs import attitude_reference
from auvid_cli.simulation.imperfections import stamped
from auvid_cli.simulation.manoeuvre_plan import make_plan
from auvid_cli.simulation.sensors import measure, sample_times
from auvid_cli.simulation.true_motion import simulate_motion
from auvid_cli.simulation.unrecorded import draw_disturbance, draw_fin_trim, record_inputs

Array = NDArray[np.float64]


def simulate(experiment: Experiment) -> Dataset:
    """Simulate an experiment.

    Raises
    ------
    SimulationError
        If the vehicle leaves the model's validity.
    ConfigError
        If the vehicle's parameters are impossible or a recorded manoeuvre cannot be read.
    """
    manoeuvre = experiment.manoeuvre
    trim = draw_fin_trim(manoeuvre.fin_trim, experiment.seed)
    plan = make_plan(manoeuvre)
    # Fins are steered, and limited, as if they were where they are recorded to be and the trim were commanded.
    if trim.any():
        plan.feedforward[:] += trim
    disturbance = draw_disturbance(manoeuvre.disturbance, plan.time, experiment.seed)
    truth = simulate_motion(experiment.vehicle, manoeuvre, plan, disturbance, trim=trim)
    del plan  # Of ten hours 170 MB, which nothing reads any more.
    current = np.array([manoeuvre.current_north, manoeuvre.current_east, 0.0])
    records = measure(truth, experiment.sensors, current, experiment.seed)
    if ahrs := experiment.sensors.ahrs():
        duration = float(truth.time[-1])
        times = shared_clock(sample_times(ahrs.attitude, duration), (truth.time,))
        attitude = attitude_reference(records, ahrs, times)
        records["attitude"] = stamped(attitude, ahrs.attitude, "attitude", experiment.seed, duration)
    return Dataset(
        inputs=record_inputs(truth.time, _recorded(truth.commands, trim), manoeuvre.recorded_rate),
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


def _recorded(commands: Array, trim: Array) -> Array:
    """Return commands as they are written down: without what of them nobody knows."""
    if not trim.any():
        return commands
    recorded = commands.copy()
    recorded[:, : trim.size] -= trim
    return recorded
