"""Effect of terms that are linear in the states, added to half the cost of a linear smoothing problem.

A gradient p at a state of covariance P, after its measurements, moves the mean of the filter by ``-P p``. The move
propagates as an error does (see `auvid_cli.filters.fault_scores`), and its effect on later innovations is data to the
adjoint: the estimate moves by minus the inverse of the cost's curvature times the gradient.
"""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.fault_scores import Faults
from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing, Trajectory
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.filters.smoothing_backward import ADJOINT, Adjoint, adjoint_predict, adjoint_update
from auvid_cli.filters.smoothing_forward import FORWARD_PASS, LINEARISED

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class GradientResponse(NamedTuple):
    """Effect of a gradient, times minus one.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        Effect on the parameters.
    shown : list of list of ndarray, shape (n_measurements, c)
        Effect on innovations, by segment and chunk; zero where missing.
    """

    parameters: Array
    shown: list[list[Array]]


def apply_gradient(smoothing: LinearSmoothing, filtered: Filtered, gradient: Trajectory) -> GradientResponse:
    """Return the effect of a gradient on parameters and innovations.

    Parameters
    ----------
    smoothing : LinearSmoothing
    filtered : Filtered
    gradient : Trajectory
        At each state of the trajectory.
    """
    n, n_moving = gradient.parameters.size, gradient.initial[0].size
    moved, scratch = np.zeros(n + n_moving), np.zeros(n_moving)
    shown = list[list[Array]]()
    for segment, timeline, about, forward_pass in smoothing.forward_passes(filtered):
        if segment == len(shown):
            # As in `score_faults`; a gradient at the beginning of the segment acts before its first event.
            moved[n:] = filtered.by_parameters[segment] @ moved[:n]
            moved += filtered.before[segment][0].covariance()[:, n:] @ gradient.initial[segment]
            shown.append([])
        of_chunk = np.zeros(about.residual.shape)
        _propagate(timeline, about, forward_pass, gradient.moving[segment][len(shown[-1])], moved, of_chunk, scratch)
        shown[-1].append(of_chunk)
    return GradientResponse(moved[:n] + filtered.final.covariance()[:n, :n] @ gradient.parameters, shown)


def gradient_scores(smoothing: LinearSmoothing, filtered: Filtered, gradient: Trajectory, faults: Faults) -> Array:
    """Return the change of the linear terms by the effect of faults on the estimate, per unit of each fault.

    Parameters
    ----------
    smoothing, filtered, gradient
        As of `apply_gradient`.
    faults : Faults
    """
    n, n_moving = gradient.parameters.size, gradient.initial[0].size
    shown, changes = apply_gradient(smoothing, filtered, gradient).shown, np.zeros(len(faults.labels))
    adjoint = Adjoint.zeros(n + n_moving, with_variance=False)
    adjoint.mean[:n] = gradient.parameters
    for segment, timeline, about, forward_pass in smoothing.forward_passes_back(filtered, adjoint):
        by_pushed, by_added, scratch = (np.zeros(a.shape) for a in (about.moving, about.residual, about.residual))
        chunk = len(shown[segment]) - 1
        opposed = forward_pass._replace(error=-shown[segment].pop())
        _propagate_back(
            timeline, about, opposed, gradient.moving[segment][chunk], adjoint, by_pushed, by_added, scratch
        )
        if chunk == 0:
            adjoint.mean[n:] += gradient.initial[segment]
        effects = faults.effects(segment, timeline, about)
        changes += np.einsum("ki,kif->f", by_pushed, effects.pushed) + np.einsum("kc,kcf->f", by_added, effects.added)
    return changes


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, _matrix, _vector, _matrix, _vector), reassociate=True)
def _propagate(timeline, about, forward_pass, gradient, moved, shown, scratch):
    """Carry the effect of a gradient through a chunk.

    Parameters
    ----------
    timeline, about, forward_pass
        Of the chunk.
    gradient : ndarray, shape (n_events, n_moving)
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
                share = shown[k, c] / forward_pass.total[k, c]
                for j in range(n):
                    moved[j] -= forward_pass.gain[k, c, j] * share
        for i in range(n_moving):
            for j in range(n):
                moved[j] += forward_pass.covariance[event, i, j] * gradient[event, i]


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, _matrix, ADJOINT, _matrix, _matrix, _matrix), reassociate=True)
def _propagate_back(timeline, about, forward_pass, gradient, adjoint, by_pushed, by_added, scratch):
    """Carry a gradient back through a chunk, to additions to the states and to the measurements.

    Parameters
    ----------
    timeline, about, forward_pass
        Of the chunk; errors are minus the effect of the gradient on innovations.
    gradient : ndarray, shape (n_events, n_moving)
    adjoint : Adjoint
        After the chunk, then before it.
    by_pushed, by_added : ndarray, shape (n_events, n_moving) and (n_measurements, c)
        Filled in; zero where nothing leads and where missing.
    scratch : ndarray, shape (n_measurements, c)
        Overwritten.
    """
    mean, n_moving = adjoint.mean, gradient.shape[1]
    n_parameters = mean.size - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for i in range(n_moving):
            mean[n_parameters + i] += gradient[event, i]
        adjoint_update(event, timeline, about, forward_pass, adjoint, by_added, scratch)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            for i in range(n_moving):
                by_pushed[event, i] = mean[n_parameters + i]
            adjoint_predict(about.transition[event], n_parameters, adjoint)
