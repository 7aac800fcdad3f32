"""Fins that follow their commands with a lag."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import InputRecord

Array = NDArray[np.float64]

# Rudder and elevator are the first of the inputs.
_FINS = 2
# Substeps in which a fin is held, per time constant: the mean over each is exact, its shape within is left out.
_SUBSTEPS = 4


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
    for fin in range(_FINS):
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
