"""What the data say of their noise: the gradient of a likelihood by one way forward and one way back.

With r and Lambda what the data from an event on say of the deviation there, and its covariance, see
`auvid_cli.filters.smoothing_backward`, the process noise that leads to the event, of variance Q, is most probably
``Q r``, and the derivative of the log-likelihood by the logarithm of its standard deviation ``Q (r^2 - Lambda)``: so
Fisher's identity has it. Of a measurement's noise the same holds with what all data say of it.

Second derivatives are taken for the average of those seen and those expected (Gilmour et al., Biometrics 51(4), 1995):
products of what innovations show of twice the most probable noise of each kind, as if that were a fault.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.fault_scores import FaultEffects, shown_faults
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing
from auvid_cli.filters.problem import TIMELINE, Timeline
from auvid_cli.filters.process_noise import noise_variance
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.smoothing_backward import (
    ADJOINT,
    Adjoint,
    back_in_time,
    take_in_event,
)
from auvid_cli.filters.smoothing_forward import LINEARISED, TRACE, Linearised

Array = NDArray[np.float64]

_matrix = types.float64[:, ::1]


class NoiseGroup(NamedTuple):
    """Noise that has one factor.

    Attributes
    ----------
    moving : tuple of int
        Moving states, whose densities it multiplies.
    sensor : int
        Row of the sensor whose standard deviations it multiplies; negative if none.
    """

    moving: tuple[int, ...] = ()
    sensor: int = -1


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
    """

    process: Array
    of_process: Array
    sensor: Array
    of_sensor: Array


@compiled(types.void(TIMELINE, LINEARISED, TRACE, ADJOINT, types.NamedUniTuple(_matrix, 4, _Told)), reassociate=True)
def _look_back(timeline, about, trace, adjoint, told):
    """Carry the adjoint back over a chunk, and write down what it says of the noise."""
    mean, root, n_moving = adjoint.mean, adjoint.root, told.process.shape[1]
    n_parameters = mean.size - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        take_in_event(event, timeline, about, trace, adjoint, told.sensor, told.of_sensor)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                told.process[event, i] = mean[n_parameters + i]
                square = 0.0
                for column in range(adjoint.n_columns[0]):
                    square += root[n_parameters + i, column] * root[n_parameters + i, column]
                told.of_process[event, i] = square
            back_in_time(about.transition[event], n_parameters, adjoint)


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
    slope, probable = np.zeros(len(groups)), list[FaultEffects]()
    adjoint = Adjoint.of_nothing(problem.n_parameters + problem.n_moving, with_variance=True)
    for _, timeline, about, trace in smoothing.traced_back(filtered, adjoint):
        rows = [about.moving.shape] * 2 + [about.residual.shape] * 2
        told = _Told(*(np.zeros(shape) for shape in rows))
        _look_back(timeline, about, trace, adjoint, told)
        probable.append(_add_chunk(slope, timeline, told, problem, groups))

    def effects(segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        return probable.pop()

    information = np.zeros((len(groups), len(groups)))
    for chunk in shown_faults(smoothing, filtered, len(groups), effects):
        information += 0.5 * chunk.shown.T @ chunk.shown
    return NoiseScores(slope, information)


def _add_chunk(
    slope: Array, timeline: Timeline, told: _Told, problem: JointProblem, groups: Sequence[NoiseGroup]
) -> FaultEffects:
    """Add what a chunk says to the slopes; return twice its most probable noise of each group."""
    pushed, added = (np.zeros((*a.shape, len(groups))) for a in (told.process, told.sensor))
    of_process = noise_variance(problem.process, timeline)
    for g, group in enumerate(groups):
        moving = list(group.moving)
        variance = of_process[:, moving]
        slope[g] += (variance * (told.process[:, moving] ** 2 - told.of_process[:, moving])).sum()
        pushed[:, moving, g] = 2.0 * variance * told.process[:, moving]
        if group.sensor >= 0:
            own = timeline.measurement_sensor == group.sensor
            variance = problem.sensors.variance[group.sensor]
            slope[g] += (variance * (told.sensor[own] ** 2 - told.of_sensor[own])).sum()
            added[own, :, g] = 2.0 * variance * told.sensor[own]
    return FaultEffects(pushed, added)
