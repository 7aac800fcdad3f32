"""Process noise that accumulates between events, and how fast the motion forgets it."""

from collections.abc import Sequence

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import JointProblem, Process, Timeline
from auvid_cli.filters.smoother_forward import AccumulatedNoise

# Step of the difference quotient of decay rates.
_RATE_STEP = 1e-5  # s
# Events from one evaluation of the decay rates to the next.
_RATE_INTERVAL = 10


def noise_variance(process: Process, timeline: Timeline) -> Array:
    """Return the variance of each moving state's own noise accumulated before each event, shape (n_events, n_moving).

    A state that decays at the rate a, over the time h, keeps ``q^2 (1 - exp(-2 a h)) / (2 a)`` of white noise of
    density q. Zero for an event without substeps.
    """
    elapsed = _elapsed(timeline)
    white = np.outer(elapsed, process.noise_density**2)
    if process.decay.size == 0:
        return white
    exponent = 2.0 * np.outer(elapsed, process.decay)
    return white * np.divide(-np.expm1(-exponent), exponent, out=np.ones_like(exponent), where=exponent != 0.0)


def accumulated_noise(process: Process, timeline: Timeline) -> AccumulatedNoise:
    """Return the process noise accumulated before each event.

    White noise of density q on a state that drives another one by the factor a gives them, over the time h, the
    covariance ``q^2 [h, a h^2 / 2; a h^2 / 2, a^2 h^3 / 3]`` (Van Loan, IEEE Trans. Autom. Control 23(3), 1978). It is
    that of noise in the middle of h, and of ``a^2 q^2 h^3 / 12`` on the driven state alone.
    """
    variance = noise_variance(process, timeline)
    total = variance + variance_on_driven(process, timeline, variance)
    return AccumulatedNoise(total, 0.5 * _elapsed(timeline), process.driven)


def variance_on_driven(process: Process, timeline: Timeline, variance: Array) -> Array:
    """Return the part ``a^2 q^2 h^3 / 12`` of `accumulated_noise`, shape (n_events, n_moving), linear in `variance`."""
    if not process.driven.size:
        return np.zeros_like(variance)
    return (_elapsed(timeline)[:, None] ** 2 / 12.0) * (variance @ np.square(process.driven).T)


def variance_by_time_constant(process: Process, timeline: Timeline) -> Array:
    """Return the derivative of log `noise_variance` by the log of a state's time constant, shape (n_events, n_moving).

    The stationary variance s^2 of the state is held constant: its noise has ``q^2 = 2 a s^2``.
    """
    elapsed = _elapsed(timeline)
    if process.decay.size == 0:
        return np.full((elapsed.size, process.noise_density.size), -1.0)
    exponent = 2.0 * np.outer(elapsed, process.decay)
    return -np.divide(exponent, np.expm1(exponent), out=np.ones_like(exponent), where=exponent != 0.0)


def _elapsed(timeline: Timeline) -> Array:
    """Return the duration of the substeps before each event, s."""
    return np.diff(np.concatenate([[0.0], np.cumsum(timeline.substep_duration)])[timeline.substep_offset])


def with_process_memory(problem: JointProblem, parameters: Array, moving: Sequence[Sequence[Array]]) -> JointProblem:
    """Return the problem with the mean rates at which the motion forgets process noise along a trajectory.

    They stay constant while the trajectory changes, so that likelihoods remain comparable.

    Parameters
    ----------
    problem : JointProblem
    parameters : ndarray, shape (n_parameters,)
    moving : sequence of sequence of ndarray, shape (n_events, n_moving)
        Moving states by segment and chunk.
    """
    rates = [
        _decay_rates(problem, timeline, np.hstack([np.tile(parameters, (len(chunk), 1)), chunk]))
        for segment, chunks in zip(problem.segments, moving, strict=True)
        for timeline, chunk in zip(segment, chunks, strict=True)
    ]
    return problem._replace(process=problem.process._replace(decay=np.concatenate(rates).mean(axis=0)))


def _decay_rates(problem: JointProblem, timeline: Timeline, states: Array) -> Array:
    """Return the rates at some events of a chunk, 1/s, shape (n, n_moving)."""
    process, n_parameters = problem.process, problem.n_parameters
    rates, matrix, scratch = [], np.eye(states.shape[1]), np.zeros(process.scratch_size)
    for event in range(0, len(states), _RATE_INTERVAL):
        substep = timeline.event_input[event : event + 1], np.array([_RATE_STEP])
        constants = process.constants, process.selection
        process.transition(states[event].copy(), timeline.inputs, *substep, *constants, matrix, scratch)
        rates.append((1.0 - np.diagonal(matrix)[n_parameters:]) / _RATE_STEP)
    return np.array(rates)
