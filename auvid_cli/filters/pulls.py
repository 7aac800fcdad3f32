"""What pulls on the states of a linear smoothing problem do: terms that are linear in them, added to half its cost.

A pull p on a state whose covariance is P after its measurements moves the filter's mean by ``-P p`` there; that goes on
as an error does (see `auvid_cli.filters.fault_scores`), and what later innovations show of it is data to the adjoint:
the whole answer moves by minus the inverse of the cost's curvature times all pulls.
"""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.fault_scores import Faults
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing, Trajectory
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.filters.smoothing_backward import ADJOINT, Adjoint, back_in_time, take_in_event
from auvid_cli.filters.smoothing_forward import LINEARISED, TRACE

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class Pulled(NamedTuple):
    """What pulls do, times minus one.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        To these.
    shown : list of list of ndarray, shape (n_measurements, c)
        By segment and chunk: to innovations; zero where missing.
    """

    parameters: Array
    shown: list[list[Array]]


def pulled(smoothing: LinearSmoothing, filtered: Filtered, pulls: Trajectory) -> Pulled:
    """Find what pulls do to the parameters and to innovations.

    Parameters
    ----------
    smoothing : LinearSmoothing
    filtered : Filtered
    pulls : Trajectory
        On each of a trajectory's states.
    """
    n, n_moving = pulls.parameters.size, pulls.initial[0].size
    moved, scratch = np.zeros(n + n_moving), np.zeros(n_moving)
    shown = list[list[Array]]()
    for segment, timeline, about, trace in smoothing.traced(filtered):
        if segment == len(shown):
            # As in `score_faults`; a pull on where the segment begins is felt before its first event.
            moved[n:] = filtered.by_parameters[segment] @ moved[:n]
            moved += filtered.before[segment][0].covariance()[:, n:] @ pulls.initial[segment]
            shown.append([])
        of_chunk = np.zeros(about.residual.shape)
        _carry(timeline, about, trace, pulls.moving[segment][len(shown[-1])], moved, of_chunk, scratch)
        shown[-1].append(of_chunk)
    return Pulled(moved[:n] + filtered.final.covariance()[:n, :n] @ pulls.parameters, shown)


def pulled_scores(smoothing: LinearSmoothing, filtered: Filtered, pulls: Trajectory, faults: Faults) -> Array:
    """Return how the pulls' terms change with what faults do to the whole answer, per unit of each.

    Parameters
    ----------
    smoothing, filtered, pulls
        As of `pulled`.
    faults : Faults
    """
    n, n_moving = pulls.parameters.size, pulls.initial[0].size
    shown, changes = pulled(smoothing, filtered, pulls).shown, np.zeros(len(faults.labels))
    adjoint = Adjoint.of_nothing(n + n_moving, with_variance=False)
    adjoint.mean[:n] = pulls.parameters
    for segment, timeline, about, trace in smoothing.traced_back(filtered, adjoint):
        by_pushed, by_added, scratch = (np.zeros(a.shape) for a in (about.moving, about.residual, about.residual))
        chunk = len(shown[segment]) - 1
        opposed = trace._replace(error=-shown[segment].pop())
        _carry_back(timeline, about, opposed, pulls.moving[segment][chunk], adjoint, by_pushed, by_added, scratch)
        if chunk == 0:
            adjoint.mean[n:] += pulls.initial[segment]
        effects = faults.effects(segment, timeline, about)
        changes += np.einsum("ki,kif->f", by_pushed, effects.pushed) + np.einsum("kc,kcf->f", by_added, effects.added)
    return changes


@compiled(types.void(TIMELINE, LINEARISED, TRACE, _matrix, _vector, _matrix, _vector), reassociate=True)
def _carry(timeline, about, trace, pull, moved, shown, scratch):
    """Carry what pulls do through a chunk.

    Parameters
    ----------
    timeline, about, trace
        Of the chunk.
    pull : ndarray, shape (n_events, n_moving)
    moved : ndarray, shape (n,)
        The filter's mean, times minus one: before the chunk, and afterwards at its end.
    shown : ndarray, shape (n_measurements, c)
        Filled in; zero where missing.
    scratch : ndarray, shape (n_moving,)
        Overwritten.
    """
    n, n_moving = moved.size, scratch.size
    n_parameters = n - n_moving
    for event in range(timeline.time.size):
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                scratch[i] = 0.0
                for j in range(n):
                    scratch[i] += about.transition[event, i, j] * moved[j]
            for i in range(n_moving):
                moved[n_parameters + i] = scratch[i]
        for k in range(timeline.measurement_offset[event], timeline.measurement_offset[event + 1]):
            for c in range(about.residual.shape[1]):
                if np.isnan(about.residual[k, c]):
                    continue
                for j in range(n):
                    shown[k, c] += about.rows[k, c, j] * moved[j]
                share = shown[k, c] / trace.total[k, c]
                for j in range(n):
                    moved[j] -= trace.gain[k, c, j] * share
        for i in range(n_moving):
            for j in range(n):
                moved[j] += trace.covariance[event, i, j] * pull[event, i]


@compiled(types.void(TIMELINE, LINEARISED, TRACE, _matrix, ADJOINT, _matrix, _matrix, _matrix), reassociate=True)
def _carry_back(timeline, about, trace, pull, adjoint, by_pushed, by_added, scratch):
    """Carry pulls back through a chunk, to what pushes the states and to what is added to measurements.

    Parameters
    ----------
    timeline, about, trace
        Of the chunk; errors are minus what innovations show of the pulls.
    pull : ndarray, shape (n_events, n_moving)
    adjoint : Adjoint
        After the chunk, then before it.
    by_pushed, by_added : ndarray, shape (n_events, n_moving) and (n_measurements, c)
        Filled in; zero where nothing leads and where missing.
    scratch : ndarray, shape (n_measurements, c)
        Overwritten.
    """
    mean, n_moving = adjoint.mean, pull.shape[1]
    n_parameters = mean.size - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for i in range(n_moving):
            mean[n_parameters + i] += pull[event, i]
        take_in_event(event, timeline, about, trace, adjoint, by_added, scratch)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                by_pushed[event, i] = mean[n_parameters + i]
            back_in_time(about.transition[event], n_parameters, adjoint)
