"""What the data say of their noise: the gradient of a likelihood by one way forward and one way back.

With r and Lambda what the data from an event on say of the deviation there, and its covariance, see
`auvid_cli.filters.smoother_backward`, the process noise that leads to the event, of variance Q, is most probably
``Q r``, and the derivative of the log-likelihood by the logarithm of its standard deviation ``Q (r^2 - Lambda)``: so
Fisher's identity has it. Of a measurement's noise the same holds with what all data say of it.

How long a state lasts that noise drives, with a variance of its own, is in the transition F as well: with P the
covariance before it, and x what most probably was before it, its derivative adds ``<r x' - Lambda F P, dF>``.

Second derivatives are taken for the average of those seen and those expected (Gilmour et al., Biometrics 51(4), 1995):
products of what innovations show of twice the most probable noise of each kind, as if that were a fault. It is
``dV v``, with V the covariance of the data and ``V v`` what they are beyond their mean: of a time constant what dF
makes of x, and the noise that is most probable by what dF adds to r.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.fault_scores import FaultEffects, fault_signatures
from auvid_cli.filters.linear_smoother import Filtered, LinearSmoothing, noise_variance, variance_by_time_constant
from auvid_cli.filters.problem import TIMELINE, ModelData, Process, Timeline
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoother_backward import ADJOINT, Adjoint, adjoint_predict, adjoint_update
from auvid_cli.filters.smoother_forward import (
    FORWARD_PASS,
    LINEARISED,
    Linearised,
    SmootherWorkspace,
    linearise_process,
)

Array = NDArray[np.float64]

_matrix = types.float64[:, ::1]
_stack = types.float64[:, :, ::1]
_indices = types.int64[::1]

# Of a rate, for a difference quotient.
_CHANGE = 1e-4


class NoiseGroup(NamedTuple):
    """Noise that has one factor.

    Attributes
    ----------
    moving : tuple of int
        Moving states, whose densities it multiplies.
    sensor : int
        Row of the sensor whose standard deviations it multiplies; negative if none.
    rates : tuple of int
        Of moving states that fade, where among the constants of the process the rates stand at which they do. Then the
        factor multiplies their time constants, and not how large they are.
    least : float
        Logarithm of the least factor that may be; of noise so little that it is none.
    """

    moving: tuple[int, ...] = ()
    sensor: int = -1
    rates: tuple[int, ...] = ()
    min_log_factor: float = -14.0

    @property
    def correlated(self) -> tuple[int, ...]:
        """Return the moving states whose time constants it multiplies."""
        return self.moving if self.rates else ()


class NoiseScores(NamedTuple):
    """How the log-likelihood depends on the logarithms of factors of noise.

    Attributes
    ----------
    slope : ndarray, shape (k,)
        Its derivatives.
    information : ndarray, shape (k, k)
        Minus its second ones, on average.
    """

    slope: Array
    information: Array


class _Told(NamedTuple):
    """What the data say of the noise in a chunk, by the variance of that, and the variance of what they say.

    Attributes
    ----------
    process, of_process : ndarray, shape (n_events, n_moving)
    sensor, of_sensor : ndarray, shape (n_measurements, c)
        0 where a component is missing.
    fading, of_fading : ndarray, shape (n_events, n_fading)
        Of what a change of the transition makes of each state that fades, per unit of that; and its covariance with it.
    smoothed : ndarray, shape (n_events, n_fading)
        Deviation of these states.
    remembered : ndarray, shape (n_events, n_fading)
        What such changes at all later events add to what the data say of the noise that drives these states.
    """

    process: Array
    of_process: Array
    sensor: Array
    of_sensor: Array
    fading: Array
    of_fading: Array
    smoothed: Array
    remembered: Array


class _Fading(NamedTuple):
    """States whose time constants are looked at, in a chunk.

    Attributes
    ----------
    rows : ndarray of int, shape (n_fading,)
        Among the moving states.
    change : ndarray, shape (n_events, n_moving, n_fading)
        Of their columns of the transition, per unit of the logarithm of the time constant.
    remembered : ndarray, shape (n_fading,)
        As of `_Told`, after the chunk; carried to before it.
    before : ndarray, shape (n_moving, n)
        Moving rows of the covariance before the chunk.
    """

    rows: NDArray[np.int64]
    change: Array
    remembered: Array
    before: Array


_TOLD = types.NamedUniTuple(_matrix, len(_Told._fields), _Told)
_FADING = types.NamedTuple((_indices, _stack, types.float64[::1], _matrix), _Fading)


@compiled(
    types.void(types.int64, types.int64, _matrix, FORWARD_PASS, ADJOINT, _TOLD, _FADING),
    reassociate=True,
    internal=True,
)
def _look_at_fading(event, f, transition, forward_pass, adjoint, told, fading):
    """Write down what the adjoint at an event says of how one state faded before it."""
    mean, root, row, change = adjoint.mean, adjoint.root, fading.rows[f], fading.change[event]
    n, n_moving, n_columns = mean.size, told.process.shape[1], adjoint.n_columns[0]
    n_parameters = n - n_moving
    covariance = forward_pass.covariance[event - 1, row] if event > 0 else fading.before[row]
    said, moved = 0.0, adjoint.work[0]
    for i in range(n):
        moved[i] = covariance[i]
    for i in range(n_moving):
        said += change[i, f] * mean[n_parameters + i]
        total = 0.0
        for j in range(n):
            total += transition[i, j] * covariance[j]
        moved[n_parameters + i] = total
    owed = 0.0
    for column in range(n_columns):
        known, changed = 0.0, 0.0
        for i in range(n):
            known += root[i, column] * moved[i]
        for i in range(n_moving):
            changed += root[n_parameters + i, column] * change[i, f]
        owed += known * changed
    told.fading[event, f], told.of_fading[event, f] = said, owed
    told.remembered[event, f] = fading.remembered[f]
    fading.remembered[f] = transition[row, n_parameters + row] * fading.remembered[f] + said


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, ADJOINT, _TOLD, _FADING), reassociate=True)
def _backward_pass(timeline, about, forward_pass, adjoint, told, fading):
    """Carry the adjoint back over a chunk, and write down what it says of the noise."""
    mean, root, n_moving, n_fading = adjoint.mean, adjoint.root, told.process.shape[1], fading.rows.size
    n = mean.size
    n_parameters = n - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for f in range(n_fading):
            row, total = fading.rows[f], forward_pass.filtered[event, n_parameters + fading.rows[f]]
            for j in range(n):
                total += forward_pass.covariance[event, row, j] * mean[j]
            told.smoothed[event, f] = total
        adjoint_update(event, timeline, about, forward_pass, adjoint, told.sensor, told.of_sensor)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                told.process[event, i] = mean[n_parameters + i]
                square = 0.0
                for column in range(adjoint.n_columns[0]):
                    square += root[n_parameters + i, column] * root[n_parameters + i, column]
                told.of_process[event, i] = square
            for f in range(n_fading):
                _look_at_fading(event, f, about.transition[event], forward_pass, adjoint, told, fading)
            adjoint_predict(about.transition[event], n_parameters, adjoint)


def noise_scores(
    smoothing: LinearSmoothing, filtered: Filtered, problem: JointProblem, groups: Sequence[NoiseGroup]
) -> NoiseScores:
    """Find how the log-likelihood of the linear problem depends on its noise.

    Parameters
    ----------
    smoothing : LinearSmoothing
        Of the problem.
    filtered : Filtered
        The problem about a trajectory.
    problem : JointProblem
        With its present noise.
    groups : sequence of NoiseGroup
    """
    n, n_moving = problem.n_parameters + problem.n_moving, problem.n_moving
    slope, probable = np.zeros(len(groups)), list[FaultEffects]()
    rows = np.array([row for group in groups for row in group.correlated], dtype=np.int64)
    adjoint, remembered, segment_before = Adjoint.zeros(n, with_variance=True), np.zeros(rows.size), -1
    chunks = [len(before) for before in filtered.before]
    for segment, timeline, about, forward_pass in smoothing.forward_passes_back(filtered, adjoint):
        if segment != segment_before:
            remembered[:], segment_before = 0.0, segment
        chunks[segment] -= 1
        before = filtered.before[segment][chunks[segment]]
        shapes = [about.moving.shape] * 2 + [about.residual.shape] * 2 + [(len(about.moving), rows.size)] * 4
        told = _Told(*(np.zeros(shape) for shape in shapes))
        covariance = before.covariance()[n - n_moving :]
        fading = _Fading(rows, _changes(problem, timeline, about, groups), remembered, covariance)
        _backward_pass(timeline, about, forward_pass, adjoint, told, fading)
        first = before.mean[n - n_moving : n][rows] + covariance[rows] @ adjoint.mean
        value = np.vstack([about.before[rows] + first, (about.moving[:, rows] + told.smoothed)[:-1]])
        probable.append(_add_chunk(slope, timeline, told, fading, value, problem, groups))

    def effects(segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        return probable.pop()

    information = np.zeros((len(groups), len(groups)))
    for chunk in fault_signatures(smoothing, filtered, len(groups), effects):
        information += 0.5 * chunk.shown.T @ chunk.shown
    return NoiseScores(slope, information)


def with_time_constants(process: Process, group: NoiseGroup, factor: float) -> Process:
    """Multiply the time constants of a group, whose states stay as large as they are."""
    constants, density, decay = process.constants.copy(), process.noise_density.copy(), process.decay.copy()
    constants[[*group.rates]] /= factor
    density[[*group.moving]] /= np.sqrt(factor)
    if decay.size:
        decay[[*group.moving]] /= factor
    return process._replace(constants=constants, noise_density=density, decay=decay)


def _changes(problem: JointProblem, timeline: Timeline, about: Linearised, groups: Sequence[NoiseGroup]) -> Array:
    """Return how the transitions depend on the logarithms of time constants, see `_Fading.change`."""
    process, rows = problem.process, [row for group in groups for row in group.correlated]
    if not rows:
        return np.zeros((0, 0, 0))
    for group in groups:
        if group.rates:
            process = with_time_constants(process, group, 1.0 + _CHANGE)
    beside = about._replace(defect=np.zeros_like(about.defect), transition=np.zeros_like(about.transition))
    n, n_components = about.rows.shape[2], about.residual.shape[1]
    work = SmootherWorkspace.of(process, n, n_components)
    linearise_process(process.transition, ModelData.of(process, problem.sensors), timeline, beside, work)
    columns = [problem.n_parameters + row for row in rows]
    # Of each state only its own time constant moves what comes of it.
    return np.ascontiguousarray(beside.transition[..., columns] - about.transition[..., columns]) / np.log1p(_CHANGE)


def _add_chunk(
    slope: Array,
    timeline: Timeline,
    told: _Told,
    fading: _Fading,
    value: Array,
    problem: JointProblem,
    groups: Sequence[NoiseGroup],
) -> FaultEffects:
    """Add what a chunk says to the slopes; return twice its most probable noise of each group.

    What fades had the `value` before each event, shape (n_events, n_fading).
    """
    pushed, added = (np.zeros((*a.shape, len(groups))) for a in (told.process, told.sensor))
    of_process = noise_variance(problem.process, timeline)
    slope_by_variance = 0.5 * of_process * (told.process**2 - told.of_process)
    for g, group in enumerate(groups):
        moving = list(group.moving)
        # Derivative of the logarithm of its variance.
        share = 2.0
        if group.rates:
            share = variance_by_time_constant(problem.process, timeline)[:, moving]
            own = [f for f, row in enumerate(fading.rows) if row in moving]
            slope[g] += (told.fading[:, own] * value[:, own] - told.of_fading[:, own]).sum()
            pushed[:, :, g] = np.einsum("eif,ef->ei", fading.change[..., own], value[:, own])
            pushed[:, moving, g] += of_process[:, moving] * told.remembered[:, own]
        slope[g] += (share * slope_by_variance[:, moving]).sum()
        pushed[:, moving, g] += share * of_process[:, moving] * told.process[:, moving]
        if group.sensor >= 0:
            own = timeline.measurement_sensor == group.sensor
            variance = problem.sensors.variance[group.sensor]
            slope[g] += (variance * (told.sensor[own] ** 2 - told.of_sensor[own])).sum()
            added[own, :, g] = 2.0 * variance * told.sensor[own]
    return FaultEffects(pushed, added)
