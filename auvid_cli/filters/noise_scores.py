"""Derivatives of the log-likelihood by the noise, from one forward and one backward pass.

With the adjoint r of the data after an event and its covariance Lambda (`auvid_cli.filters.smoother_backward`), process
noise of variance Q has the smoothed value ``Q r``, and the derivative of the log-likelihood by the logarithm of its
standard deviation is ``Q (r^2 - Lambda)`` (Fisher's identity). The same holds for measurement noise with its own
smoothed value, and for an initial value whose prior has the factor.

The time constant of a correlated state also changes the transition F by dF. With the covariance P and the smoothed
state x before the transition, its derivative adds ``<r x' - Lambda F P, dF>``.

The information matrix is the average of the observed and the expected one (Gilmour et al., Biometrics 51(4), 1995). It
consists of products of signatures in the innovations, where each group has a "fault" of twice its smoothed noise. For
a time constant this is ``dF x``, and the smoothed noise due to the change of r by dF.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing
from auvid_cli.filters.problem import TIMELINE, Gaussian, JointProblem, ModelData, Process, Timeline
from auvid_cli.filters.process_noise import (
    accumulated_noise,
    noise_variance,
    variance_by_time_constant,
    variance_on_driven,
)
from auvid_cli.filters.signatures import FaultEffects, fault_signatures
from auvid_cli.filters.smoother_backward import ADJOINT, Adjoint, adjoint_predict, adjoint_update
from auvid_cli.filters.smoother_forward import (
    ACCUMULATED_NOISE,
    FORWARD_PASS,
    LINEARISED,
    AccumulatedNoise,
    Linearised,
    SmootherWorkspace,
    linearise_process,
)
from auvid_cli.numerics import compiled, types

_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
_indices = types.int64[::1]

# Relative step of a time constant in difference quotients.
_TIME_CONSTANT_STEP = 1e-4


class NoiseGroup(NamedTuple):
    """Noise with a common factor."""

    moving: tuple[int, ...] = ()  # moving states whose noise densities have the factor
    sensor: int = -1  # row of the sensor whose standard deviations have the factor; negative if none
    # Indices of decay rates among the constants of the process, one for each of `moving`. If given, the factor is that
    # of the time constants, with constant stationary variance.
    rates: tuple[int, ...] = ()
    min_log_factor: float = -14.0  # logarithm of the smallest factor; such noise is negligible
    # Whether the standard deviations of the states' initial values have the factor too. Their prior is independent of
    # the other states.
    is_stationary: bool = False

    @property
    def correlated(self) -> tuple[int, ...]:
        """Moving states whose time constants have the factor."""
        return self.moving if self.rates else ()


class NoiseScores(NamedTuple):
    """Derivatives of the log-likelihood by the logarithms of noise factors."""

    slope: Array  # shape (k,); first derivatives
    information: Array  # shape (k, k); average information matrix


class _SmoothedNoise(NamedTuple):
    """Smoothed noise of a chunk, divided by its variance, and the variance of that."""

    process: Array  # shape (n_events, n_moving)
    process_variance: Array  # shape (n_events, n_moving)
    sensor: Array  # shape (n_measurements, c); 0 if missing
    sensor_variance: Array  # shape (n_measurements, c); 0 if missing
    transition: Array  # shape (n_events, n_correlated); ``r dF`` of each correlated state
    transition_variance: Array  # shape (n_events, n_correlated); ``Lambda F P dF`` of each correlated state
    state: Array  # shape (n_events, n_correlated); smoothed deviation of the correlated states
    # Shape (n_events, n_correlated); sum of ``r dF`` at later events, multiplied by the transitions to them
    later: Array


class _Correlated(NamedTuple):
    """Correlated states whose time constants have a factor, in a chunk."""

    rows: NDArray[np.int64]  # shape (n_correlated,); rows among the moving states
    # Shape (n_events, n_moving, n_correlated); dF: derivative of the transition's column of each correlated state by
    # the logarithm of its time constant
    change: Array
    later: Array  # shape (n_correlated,); as in `_SmoothedNoise`, after the chunk; afterwards before it
    before: Array  # shape (n_moving, n); moving rows of the covariance before the chunk


_SMOOTHED_NOISE = types.NamedUniTuple(_matrix, len(_SmoothedNoise._fields), _SmoothedNoise)
_CORRELATED = types.NamedTuple((_indices, _stack, types.float64[::1], _matrix), _Correlated)


@compiled(reassociate=True)
def _smooth_transition(event, f, transition, forward_pass, adjoint, noise, correlated):
    """Fill in the terms of one correlated state's transition, from the adjoint at an event."""
    mean, root, row, change = adjoint.mean, adjoint.root, correlated.rows[f], correlated.change[event]
    n, n_moving, n_columns = mean.size, noise.process.shape[1], adjoint.n_columns[0]
    n_parameters = n - n_moving
    covariance = forward_pass.covariance[event - 1, row] if event > 0 else correlated.before[row]
    value, moved = 0.0, adjoint.work[0]
    for i in range(n):
        moved[i] = covariance[i]
    for i in range(n_moving):
        value += change[i, f] * mean[n_parameters + i]
        total = 0.0
        for j in range(n):
            total += transition[i, j] * covariance[j]
        moved[n_parameters + i] = total
    variance = 0.0
    for column in range(n_columns):
        projected, changed = 0.0, 0.0
        for i in range(n):
            projected += root[i, column] * moved[i]
        for i in range(n_moving):
            changed += root[n_parameters + i, column] * change[i, f]
        variance += projected * changed
    noise.transition[event, f], noise.transition_variance[event, f] = value, variance
    noise.later[event, f] = correlated.later[f]
    correlated.later[f] = transition[row, n_parameters + row] * correlated.later[f] + value


@compiled(
    types.void(TIMELINE, LINEARISED, FORWARD_PASS, ADJOINT, _SMOOTHED_NOISE, _CORRELATED, ACCUMULATED_NOISE),
    reassociate=True,
)
def _backward_pass(timeline, about, forward_pass, adjoint, noise, correlated, accumulated):
    """Carry the adjoint back over a chunk, and fill in the smoothed noise."""
    mean, root, n_moving, n_correlated = adjoint.mean, adjoint.root, noise.process.shape[1], correlated.rows.size
    n = mean.size
    n_parameters = n - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for f in range(n_correlated):
            row, total = correlated.rows[f], forward_pass.filtered[event, n_parameters + correlated.rows[f]]
            for j in range(n):
                total += forward_pass.covariance[event, row, j] * mean[j]
            noise.state[event, f] = total
        adjoint_update(event, timeline, about, forward_pass, adjoint, noise.sensor, noise.sensor_variance)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                # Noise in the middle of the interval acts on driven states too.
                row, value = adjoint.work[0], mean[n_parameters + i]
                for column in range(adjoint.n_columns[0]):
                    row[column] = root[n_parameters + i, column]
                for j in range(accumulated.driven.shape[0]):
                    share = accumulated.half_elapsed[event] * accumulated.driven[j, i]
                    if share != 0.0:
                        value += share * mean[n_parameters + j]
                        for column in range(adjoint.n_columns[0]):
                            row[column] += share * root[n_parameters + j, column]
                square = 0.0
                for column in range(adjoint.n_columns[0]):
                    square += row[column] * row[column]
                noise.process[event, i], noise.process_variance[event, i] = value, square
            for f in range(n_correlated):
                _smooth_transition(event, f, about.transition[event], forward_pass, adjoint, noise, correlated)
            adjoint_predict(about.transition[event], n_parameters, adjoint)


def noise_scores(
    smoothing: LinearSmoothing, filtered: Filtered, problem: JointProblem, groups: Sequence[NoiseGroup]
) -> NoiseScores:
    """Return the derivatives of the log-likelihood of a linear problem by its noise.

    Parameters
    ----------
    smoothing : LinearSmoothing
    filtered : Filtered
    problem : JointProblem
        With the noise with which it was filtered.
    groups : sequence of NoiseGroup
    """
    n, n_moving = problem.n_parameters + problem.n_moving, problem.n_moving
    slope, doubled, initial = np.zeros(len(groups)), list[FaultEffects](), list[Array]()
    rows = np.array([row for group in groups for row in group.correlated], dtype=np.int64)
    adjoint, later, last_segment = Adjoint.zeros(n, with_variance=True), np.zeros(rows.size), -1
    chunks = [len(before) for before in filtered.before]
    for segment, timeline, about, forward_pass in smoothing.forward_passes_back(filtered, adjoint):
        if segment != last_segment:
            later[:], last_segment = 0.0, segment
        chunks[segment] -= 1
        before = filtered.before[segment][chunks[segment]]
        shapes = [about.moving.shape] * 2 + [about.residual.shape] * 2 + [(len(about.moving), rows.size)] * 4
        noise = _SmoothedNoise(*(np.zeros(shape) for shape in shapes))
        covariance = before.covariance()[n - n_moving :]
        correlated = _Correlated(rows, _transition_changes(problem, timeline, about, groups), later, covariance)
        accumulated = accumulated_noise(problem.process, timeline)
        _backward_pass(timeline, about, forward_pass, adjoint, noise, correlated, accumulated)
        first = before.mean[n - n_moving : n][rows] + covariance[rows] @ adjoint.mean
        value = np.vstack([about.before[rows] + first, (about.moving[:, rows] + noise.state)[:-1]])
        doubled.append(_add_chunk(slope, timeline, noise, correlated, value, problem, groups, accumulated))
        if chunks[segment] == 0:
            initial.append(_add_initial(slope, adjoint, problem.priors[segment], groups, n_moving))

    def effects(segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        return doubled.pop()

    information = np.zeros((len(groups), len(groups)))
    for chunk in fault_signatures(smoothing, filtered, len(groups), effects, initial[::-1]):
        signature = chunk.normalised()
        information += 0.5 * signature.T @ signature
    return NoiseScores(slope, information)


def _add_initial(slope: Array, adjoint: Adjoint, prior: Gaussian, groups: Sequence[NoiseGroup], n_moving: int) -> Array:
    """Add the initial values of a segment to the slopes; return twice their deviations from the prior's mean.

    The adjoint is that before the first event. The deviations have the shape (n_moving, n_groups).
    """
    doubled, variance = np.zeros((n_moving, len(groups))), np.square(prior.factor[-n_moving:]).sum(axis=1)
    for g, group in enumerate(groups):
        if group.is_stationary:
            rows = list(group.moving)
            mean, root = adjoint.mean[-n_moving:][rows], adjoint.root[-n_moving:][rows]
            slope[g] += (variance[rows] * (mean**2 - np.square(root).sum(axis=1))).sum()
            doubled[rows, g] = 2.0 * variance[rows] * mean
    return doubled


def with_time_constants(process: Process, group: NoiseGroup, factor: float) -> Process:
    """Multiply the time constants of a group, at constant stationary variance."""
    constants, density, decay = process.constants.copy(), process.noise_density.copy(), process.decay.copy()
    constants[[*group.rates]] /= factor
    density[[*group.moving]] /= np.sqrt(factor)
    if decay.size:
        decay[[*group.moving]] /= factor
    return process._replace(constants=constants, noise_density=density, decay=decay)


def _transition_changes(
    problem: JointProblem, timeline: Timeline, about: Linearised, groups: Sequence[NoiseGroup]
) -> Array:
    """Return `_Correlated.change` by difference quotients."""
    process, rows = problem.process, [row for group in groups for row in group.correlated]
    if not rows:
        return np.zeros((0, 0, 0))
    for group in groups:
        if group.rates:
            process = with_time_constants(process, group, 1.0 + _TIME_CONSTANT_STEP)
    changed = about._replace(defect=np.zeros_like(about.defect), transition=np.zeros_like(about.transition))
    n, n_components = about.rows.shape[2], about.residual.shape[1]
    work = SmootherWorkspace.of(process, n, n_components)
    linearise_process(process.transition, ModelData.of(process, problem.sensors), timeline, changed, work)
    columns = [problem.n_parameters + row for row in rows]
    # All time constants change at once: each column depends on its own one only.
    difference = np.ascontiguousarray(changed.transition[..., columns] - about.transition[..., columns])
    return difference / np.log1p(_TIME_CONSTANT_STEP)


def _add_chunk(
    slope: Array,
    timeline: Timeline,
    noise: _SmoothedNoise,
    correlated: _Correlated,
    value: Array,
    problem: JointProblem,
    groups: Sequence[NoiseGroup],
    accumulated: AccumulatedNoise,
) -> FaultEffects:
    """Add a chunk to the slopes; return twice its smoothed noise of each group.

    `value`, shape (n_events, n_correlated), holds the smoothed correlated states before each event.
    """
    on_states, on_measurements = (np.zeros((*a.shape, len(groups))) for a in (noise.process, noise.sensor))
    process_variance = noise_variance(problem.process, timeline)
    squares = noise.process**2 - noise.process_variance
    for g, group in enumerate(groups):
        moving, added = list(group.moving), np.zeros_like(process_variance)
        # Derivative of the variance by the logarithm of the factor.
        by_factor = np.zeros_like(process_variance)
        by_factor[:, moving] = 2.0 * process_variance[:, moving]
        if group.rates:
            by_time_constant = variance_by_time_constant(problem.process, timeline)
            by_factor[:, moving] = process_variance[:, moving] * by_time_constant[:, moving]
            own = [f for f, row in enumerate(correlated.rows) if row in moving]
            slope[g] += (noise.transition[:, own] * value[:, own] - noise.transition_variance[:, own]).sum()
            on_states[:, :, g] = np.einsum("eif,ef->ei", correlated.change[..., own], value[:, own])
            added[:, moving] = process_variance[:, moving] * noise.later[:, own]
        by_factor += variance_on_driven(problem.process, timeline, by_factor)
        slope[g] += 0.5 * (by_factor * squares).sum()
        added += by_factor * noise.process
        on_states[:, :, g] += added
        if accumulated.driven.size:
            on_states[:, :, g] += accumulated.half_elapsed[:, None] * (added @ accumulated.driven.T)
        if group.sensor >= 0:
            own = timeline.measurement_sensor == group.sensor
            variance = problem.sensors.variance[group.sensor]
            slope[g] += (variance * (noise.sensor[own] ** 2 - noise.sensor_variance[own])).sum()
            on_measurements[own, :, g] = 2.0 * variance * noise.sensor[own]
    return FaultEffects(on_states, on_measurements)
