"""What acts on a simulated vehicle and no record shows, and what of its inputs is recorded."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.disturbance import Disturbance
from auvid_cli.config.manoeuvre import FinTrim
from auvid_cli.data.dataset import InputRecord
from auvid_cli.simulation.random_processes import gauss_markov, stream
from auvid_cli.vehicle.parameters import DISTURBANCE

Array = NDArray[np.float64]


def draw_disturbance(settings: Disturbance, time: Array, seed: int) -> Array:
    """Return force and moment from each time to the next, N and N m, shape (n, 6); each has a stream of its own."""
    drawn = np.zeros((time.size, len(DISTURBANCE)))
    for column, (quantity, (size, time_constant)) in enumerate(zip(DISTURBANCE, settings.per_axis(), strict=True)):
        if size > 0.0:
            drawn[:, column] = size * gauss_markov(time, time_constant, stream(seed, "manoeuvre", quantity.symbol))
    return drawn


def draw_fin_trim(settings: FinTrim, seed: int) -> Array:
    """Return how far the inputs of a vehicle are off from what is recorded of them, shape (4,)."""
    rudder, elevator = settings.spread * stream(seed, "manoeuvre", "fin_trim").standard_normal(2)
    return np.array([settings.rudder + rudder, settings.elevator + elevator, 0.0, 0.0])


def record_inputs(time: Array, inputs: Array, rate: float | None) -> InputRecord:
    """Write down inputs, each of which holds from its time to the next: all, or those of a slower clock, Hz."""
    if rate is None:
        return InputRecord(time, inputs)
    ticks = np.arange(int(np.floor(time[-1] * rate + 1e-9)) + 1) / rate
    # A tick of both clocks is one, however either rounds it.
    return InputRecord(ticks, inputs[np.searchsorted(time, ticks + 1e-9, side="right") - 1])
