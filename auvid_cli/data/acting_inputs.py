"""Inputs as they act: late, changing between their samples, and of actuators that follow their commands."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import INPUTS_DELAY
from auvid_cli.data.dataset import InputRecord
from auvid_cli.vehicle.actuator_motion import follow_commands
from auvid_cli.vehicle.actuators import IDEAL, N_ACTUATORS, Actuators

Array = NDArray[np.float64]

# Substeps in which an actuator is held, per time constant: the mean over each is exact, its shape within is left out.
_SUBSTEPS = 4
# Time constants after which what lags has arrived.
_ARRIVED = 40.0


def as_acting(inputs: InputRecord, experiment: RunSettings) -> InputRecord:
    """Find the inputs that settings take to have acted, from those that were recorded.

    Parameters
    ----------
    inputs : InputRecord
    experiment : RunSettings
        How inputs change between samples, how late they act, and how the vehicle's actuators follow them.

    Returns
    -------
    InputRecord
        Each row holds until the next.
    """
    settings = experiment.identification
    if settings.inputs.between == "linear":
        inputs = _linear(inputs, settings.integration_step)
    if delay := settings.delays.get(INPUTS_DELAY, 0.0):
        # What comes first is taken to have been there before.
        time, values = inputs.time + delay, inputs.values
        early = delay > 0.0
        inputs = InputRecord(np.append(inputs.time[:early], time), np.vstack([values[:early], values]))
    return with_actuator_dynamics(inputs, experiment.vehicle.actuators.actuators(), settings.integration_step)


def _linear(inputs: InputRecord, step: float) -> InputRecord:
    """Cut straight lines between samples into steps of their means."""
    lengths = np.diff(inputs.time)
    counts = np.maximum(np.ceil(lengths / step - 1e-9).astype(np.int64), 1)
    row = np.repeat(np.arange(lengths.size), counts)
    within = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
    time = inputs.time[row] + within * (lengths / counts)[row]
    share = ((within + 0.5) / counts[row])[:, None]
    values = (1.0 - share) * inputs.values[row] + share * inputs.values[row + 1]
    return InputRecord(np.append(time, inputs.time[-1]), np.vstack([values, inputs.values[-1:]]))


def with_actuator_dynamics(commands: InputRecord, actuators: Actuators, step: float) -> InputRecord:
    """Find what fins and propeller did that follow their commands, at rest in the first.

    Parameters
    ----------
    commands : InputRecord
    actuators : Actuators
    step : float
        s; substeps of the integration are no longer.

    Returns
    -------
    InputRecord
        Constant over short substeps, over each of which it is the exact mean of what moves; with ideal actuators the
        commands as they are.
    """
    if all(actuator == IDEAL for actuator in actuators):
        return commands
    longest = min([step, *(a.time_constant / _SUBSTEPS for a in actuators if a.time_constant > 0.0)])
    # Long after a command changed all have arrived: substeps are needed only for so long.
    reach = np.ptp(commands.values[:, :N_ACTUATORS], axis=0).tolist()
    settling = max(
        way / actuator.rate_limit + _ARRIVED * actuator.time_constant
        for way, actuator in zip(reach, actuators, strict=True)
    )
    lengths = np.diff(commands.time, append=commands.time[-1] + max(settling, step))
    counts = np.maximum(np.ceil(np.minimum(lengths, settling) / longest).astype(np.int64), 1)
    row = np.repeat(np.arange(lengths.size), counts)
    within = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
    spacing = np.minimum(lengths, settling or step) / counts
    time = commands.time[row] + within * spacing[row]
    duration = np.append(np.diff(time), spacing[-1])
    values = commands.values[row]
    for column, actuator in enumerate(actuators):
        if actuator != IDEAL:
            acting = np.empty(row.size)
            follow_commands(actuator, np.ascontiguousarray(values[:, column]), duration, acting)
            values[:, column] = acting
    return InputRecord(time, values)
