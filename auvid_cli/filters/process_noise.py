"""What white noise that drives moving states leaves in them by the end of an interval.

It acts all along the interval, of length h, and a motion forgets a part of it before the end: of a state whose rate
changes by ``-a`` for a change of its own, noise of density q leaves

    q^2 (1 - exp(-2 a h)) / (2 a)

That is the diagonal of ``integral exp(F s) Q exp(F' s) ds`` over the interval (van Loan, IEEE Trans. Autom. Control
23(3), 1978) but for terms of third order in h, and all of it where states do not push each other. Who does not know the
rates a, as nobody does before the parameters are found, counts all of the noise, ``q^2 h``.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.problem import Process, Timeline
from auvid_cli.filters.segments import JointProblem

Array = NDArray[np.float64]

_STEP = 1e-5  # s, of the difference quotient for rates
_EVERY = 10  # events between those at which rates are evaluated


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


def with_process_memory(problem: JointProblem, parameters: Array, moving: Sequence[Sequence[Array]]) -> JointProblem:
    """Return the problem with the mean rates at which the motion forgets process noise along a trajectory.

    They stay the same while the trajectory changes, so that likelihoods can be compared.

    Parameters
    ----------
    problem : JointProblem
    parameters : ndarray, shape (n_parameters,)
    moving : sequence of sequence of ndarray, shape (n_events, n_moving)
        Moving states by segment and chunk.
    """
    rates = [
        _rates(problem, timeline, np.hstack([np.tile(parameters, (len(chunk), 1)), chunk]))
        for segment, chunks in zip(problem.segments, moving, strict=True)
        for timeline, chunk in zip(segment, chunks, strict=True)
    ]
    return problem._replace(process=problem.process._replace(decay=np.concatenate(rates).mean(axis=0)))


def _rates(problem: JointProblem, timeline: Timeline, states: Array) -> Array:
    """Return the rates at some events of a chunk, shape (n, n_moving)."""
    process, n_parameters = problem.process, problem.n_parameters
    rates, matrix, scratch = [], np.eye(states.shape[1]), np.zeros(process.scratch_size)
    for event in range(0, len(states), _EVERY):
        substep = timeline.event_input[event : event + 1], np.array([_STEP])
        constants = process.constants, process.selection
        process.transition(states[event].copy(), timeline.inputs, *substep, *constants, matrix, scratch)
        rates.append((1.0 - np.diagonal(matrix)[n_parameters:]) / _STEP)
    return np.array(rates)
