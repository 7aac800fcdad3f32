"""Inputs as they act: late, changing between their samples, and of fins that follow their commands with a lag."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import INPUTS_DELAY, Identification
from auvid_cli.data.dataset import InputRecord

Array = NDArray[np.float64]

# Rudder and elevator are the first of the inputs.
FINS = 2
# Substeps in which a fin is held, per time constant: the mean over each is exact, its shape within is left out.
_SUBSTEPS = 4


def as_acting(inputs: InputRecord, settings: Identification) -> InputRecord:
    """Find the inputs that settings take to have acted, from those that were recorded.

    Parameters
    ----------
    inputs : InputRecord
    settings : Identification
        How inputs change between samples, how late they act, and how fins lag.

    Returns
    -------
    InputRecord
        Each row holds until the next.
    """
    if settings.inputs.between == "linear":
        inputs = _linear(inputs, settings.integration_step)
    if delay := settings.delays.get(INPUTS_DELAY, 0.0):
        # What comes first is taken to have been there before.
        time, values = inputs.time + delay, inputs.values
        early = delay > 0.0
        inputs = InputRecord(np.append(inputs.time[:early], time), np.vstack([values[:early], values]))
    return lagged(inputs, settings.fin_time_constant, settings.integration_step)


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


def lagged(commands: InputRecord, time_constant: float, step: float) -> InputRecord:
    """Find where fins are that follow ``time_constant d(delta)/dt = command - delta``, at rest in the first command.

    Parameters
    ----------
    commands : InputRecord
    time_constant : float
        s; with 0 the commands come back as they are.
    step : float
        s; substeps of the integration are no longer.

    Returns
    -------
    InputRecord
        Constant over short substeps, over each of which it is the exact mean of the fin.
    """
    if time_constant == 0.0:
        return commands
    longest = min(step, time_constant / _SUBSTEPS)
    # Long after a command changed the fin has arrived: substeps are needed only for so long.
    settling = 40.0 * time_constant
    lengths = np.diff(commands.time, append=commands.time[-1] + settling)
    counts = np.maximum(np.ceil(np.minimum(lengths, settling) / longest).astype(np.int64), 1)
    row = np.repeat(np.arange(lengths.size), counts)
    within = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
    spacing = np.minimum(lengths, settling) / counts
    time = commands.time[row] + within * spacing[row]
    duration = np.append(np.diff(time), spacing[-1])
    values = commands.values[row]
    decay = np.exp(-duration / time_constant)
    kept = -np.expm1(-duration / time_constant) * time_constant / duration
    for fin in range(FINS):
        command = values[:, fin].copy()
        at_begin = _response(command, decay)
        values[:, fin] = command + (at_begin - command) * kept
    return InputRecord(time, values)


def _response(command: Array, decay: Array) -> Array:
    """Find the fin at the beginning of each substep."""
    fin, before = np.empty(command.size), command[0]
    for k, (wanted, share) in enumerate(zip(command.tolist(), decay.tolist(), strict=True)):
        fin[k] = before
        before = wanted + (before - wanted) * share
    return fin
