"""A whole simulated run: plan, true motion, raw sensors, attitude."""

import numpy as np

from auvid_cli.config.experiment import Experiment
from auvid_cli.data.dataset import Dataset, InputRecord, TruthRecord
from auvid_cli.simulation.ahrs import attitude_reference
from auvid_cli.simulation.manoeuvre_plan import make_plan
from auvid_cli.simulation.sensors import measure
from auvid_cli.simulation.true_motion import simulate_motion


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
    truth = simulate_motion(experiment.vehicle, manoeuvre, make_plan(manoeuvre))
    current = np.array([manoeuvre.current_north, manoeuvre.current_east, 0.0])
    records = measure(truth, experiment.sensors, current, experiment.seed)
    if experiment.sensors.attitude.source == "ahrs":
        records["attitude"] = attitude_reference(records, experiment.sensors, float(truth.time[-1]))
    return Dataset(
        inputs=InputRecord(truth.time, truth.inputs),
        sensors=records,
        experiment=experiment,
        truth=TruthRecord(
            truth.time,
            truth.motion,
            truth.position + truth.time[:, None] * current,
            experiment.vehicle.all_coefficients(),
        ),
    )
