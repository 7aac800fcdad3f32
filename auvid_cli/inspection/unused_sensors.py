"""What a sensor that no estimator listens to says against those that it does listen to."""

import numpy as np

from auvid_cli.data.check import Check
from auvid_cli.data.dataset import Dataset
from auvid_cli.inspection.clean_record import screened
from auvid_cli.inspection.grid import signals_of, span_of
from auvid_cli.inspection.kinematic_relations import measured_forces
from auvid_cli.inspection.velocity import against_force


def contradictions_of_unused(dataset: Dataset) -> list[Check]:
    """Judge the velocities by an accelerometer that is not used; only what fails.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at.
    """
    if "accelerometer" not in dataset.experiment.identification.unused_sensors:
        return []
    sensors = {
        name: screened(name, record).record
        for name, record in dataset.sensors.items()
        if np.isfinite(record.values).any()
    }
    signals = signals_of(dataset.inputs, sensors, span_of(dataset.inputs, sensors))
    checks = (against_force(signals, symbol, force) for symbol, force in measured_forces(signals).items())
    return [check for check in checks if check.passed is False]
