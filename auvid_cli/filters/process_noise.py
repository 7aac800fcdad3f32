"""What white noise that drives moving states leaves in them by the end of an interval.

It acts all along the interval, of length h, and a motion forgets a part of it before the end: of a state whose rate
changes by ``-a`` for a change of its own, noise of density q leaves

    q^2 (1 - exp(-2 a h)) / (2 a)

That is the diagonal of ``integral exp(F s) Q exp(F' s) ds`` over the interval (van Loan, IEEE Trans. Autom. Control
23(3), 1978) but for terms of third order in h, and all of it where states do not push each other. Who does not know the
rates a, as nobody does before the parameters are found, counts all of the noise, ``q^2 h``.
"""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.problem import Process, Timeline

Array = NDArray[np.float64]


def noise_variance(process: Process, timeline: Timeline) -> Array:
    """Return the variance that process noise adds up to each event, shape (n_events, n_moving); 0 if nothing leads."""
    elapsed = _elapsed(timeline)
    driven = np.outer(elapsed, process.noise_density**2)
    if process.decay.size == 0:
        return driven
    forgotten = 2.0 * np.outer(elapsed, process.decay)
    left = np.divide(-np.expm1(-forgotten), forgotten, out=np.ones_like(forgotten), where=forgotten != 0.0)
    return driven * left


def variance_by_time_constant(process: Process, timeline: Timeline) -> Array:
    """Return how its logarithm depends on that of a state's time constant, of the same shape.

    A state of variance s^2, which stays, is driven by ``q^2 = 2 a s^2``, of which ``s^2 (1 - exp(-2 a h))`` is left.
    """
    elapsed = _elapsed(timeline)
    if process.decay.size == 0:
        return np.full((elapsed.size, process.noise_density.size), -1.0)
    forgotten = 2.0 * np.outer(elapsed, process.decay)
    return -np.divide(forgotten, np.expm1(forgotten), out=np.ones_like(forgotten), where=forgotten != 0.0)


def _elapsed(timeline: Timeline) -> Array:
    """Return the time that leads to each event, s."""
    return np.diff(np.concatenate([[0.0], np.cumsum(timeline.substep_duration)])[timeline.substep_offset])
