"""Acting inputs: recorded inputs after delay, interpolation and actuator dynamics."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import INPUTS_DELAY
from auvid_cli.data.dataset import InputRecord
from auvid_cli.vehicle.actuator_motion import follow_commands
from auvid_cli.vehicle.parameters import IDEAL, N_ACTUATORS, Actuators

# Steps of constant actuator position per time constant; the mean over each is exact.
_SUBSTEPS = 4
_SETTLED = 40.0  # time constants after which the response of a lag is constant


def as_acting(inputs: InputRecord, experiment: RunSettings) -> InputRecord:
    """Return the acting inputs of an experiment; each row holds until the next."""
    settings = experiment.identification
    if settings.inputs.between == "linear":
        inputs = _linear(inputs, settings.integration_step)
    if delay := settings.delays.get(INPUTS_DELAY, 0.0):
        # The first input is assumed to hold before its time.
        time, values = inputs.time + delay, inputs.values
        early = delay > 0.0
        inputs = InputRecord(np.append(inputs.time[:early], time), np.vstack([values[:early], values]))
    return with_actuator_dynamics(inputs, experiment.vehicle.actuators.actuators(), settings.integration_step)


def _linear(inputs: InputRecord, step: float) -> InputRecord:
    """Return piecewise constant inputs, the means of lines between the samples."""
    lengths = np.diff(inputs.time)
    counts = np.maximum(np.ceil(lengths / step - 1e-9).astype(np.int64), 1)
    row, number = _substeps(counts)
    time = inputs.time[row] + number * (lengths / counts)[row]
    share = ((number + 0.5) / counts[row])[:, None]
    values = (1.0 - share) * inputs.values[row] + share * inputs.values[row + 1]
    return InputRecord(np.append(time, inputs.time[-1]), np.vstack([values, inputs.values[-1:]]))


def _substeps(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the row of each substep, and its number within the row."""
    row = np.repeat(np.arange(counts.size), counts)
    return row, np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)


def with_actuator_dynamics(commands: InputRecord, actuators: Actuators, step: float) -> InputRecord:
    """Return the positions of fins and propeller that follow commands; they start at rest at the first command.

    Parameters
    ----------
    commands : InputRecord
    actuators : Actuators
    step : float
        s; longest step of the result.

    Returns
    -------
    InputRecord
        Exact mean position over each short step; the commands if all actuators are ideal.
    """
    if all(actuator == IDEAL for actuator in actuators):
        return commands
    longest = min([step, *(a.time_constant / _SUBSTEPS for a in actuators if a.time_constant > 0.0)])
    # Short steps are needed only until all actuators have settled.
    ranges = np.ptp(commands.values[:, :N_ACTUATORS], axis=0).tolist()
    settling = max(
        distance / actuator.rate_limit + _SETTLED * actuator.time_constant
        for distance, actuator in zip(ranges, actuators, strict=True)
    )
    lengths = np.diff(commands.time, append=commands.time[-1] + max(settling, step))
    counts = np.maximum(np.ceil(np.minimum(lengths, settling) / longest).astype(np.int64), 1)
    row, number = _substeps(counts)
    spacing = np.minimum(lengths, settling or step) / counts
    time = commands.time[row] + number * spacing[row]
    duration = np.append(np.diff(time), spacing[-1])
    values = commands.values[row]
    for column, actuator in enumerate(actuators):
        if actuator != IDEAL:
            acting = np.empty(row.size)
            follow_commands(actuator, np.ascontiguousarray(values[:, column]), duration, acting)
            values[:, column] = acting
    return InputRecord(time, values)
