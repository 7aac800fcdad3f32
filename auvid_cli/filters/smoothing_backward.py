"""The way back of a smoother that is linear about a trajectory: what the filter did not know yet.

The adjoint of the modified Bryson-Frazier recursion (Bierman 1977, section X.5), which inverts no covariance: with r
what the data after an event say, and Lambda its covariance, the smoothed deviation is ``delta + P r``, of covariance
``P - P Lambda P``.
"""

import numpy as np
from numba import types

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.filters.smoothing_forward import LINEARISED, TRACE

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


@compiled(types.void(_vector, _vector, types.float64, types.float64, _vector), reassociate=True, internal=True)
def _take_in(row, gain, error, total, adjoint):
    """Carry the adjoint back over one component."""
    known = 0.0
    for i in range(adjoint.size):
        known += gain[i] * adjoint[i]
    share = (error - known) / total
    for i in range(adjoint.size):
        adjoint[i] += share * row[i]


@compiled(types.void(_vector, _vector, types.float64, _matrix, _vector), reassociate=True, internal=True)
def _take_in_information(row, gain, total, information, product):
    """Carry its covariance back over one component: ``L' Lambda L + h h' / total`` with ``L = I - g h' / total``."""
    n = row.size
    square = 0.0
    for i in range(n):
        dot = 0.0
        for j in range(n):
            dot += information[i, j] * gain[j]
        product[i] = dot / total
        square += gain[i] * product[i]
    weight = 1.0 / total + square / total
    for i in range(n):
        h = row[i]
        if h != 0.0:
            for j in range(n):
                information[i, j] -= h * product[j]
                information[j, i] -= h * product[j]
    for i in range(n):
        if row[i] != 0.0:
            for j in range(n):
                information[i, j] += weight * row[i] * row[j]


@compiled(types.void(_matrix, types.int64, _vector, _matrix, _matrix), reassociate=True, internal=True)
def _back_in_time(transition, n_parameters, adjoint, information, product):
    """Carry adjoint and its covariance back over a transition: ``F' r`` and ``F' Lambda F``."""
    n = adjoint.size
    n_moving = n - n_parameters
    for i in range(n_moving):
        product[0, i] = adjoint[n_parameters + i]
        adjoint[n_parameters + i] = 0.0
    for i in range(n_moving):
        for j in range(n):
            adjoint[j] += product[0, i] * transition[i, j]
    if information.shape[0] == 0:
        return
    # Lambda F, row by row; of F the upper rows are those of the identity.
    for i in range(n):
        row = product[i]
        for j in range(n):
            row[j] = information[i, j] if j < n_parameters else 0.0
        for k in range(n_moving):
            share = information[i, n_parameters + k]
            for j in range(n):
                row[j] += share * transition[k, j]
    for i in range(n):
        for j in range(n):
            information[i, j] = product[i, j] if i < n_parameters else 0.0
    for k in range(n_moving):
        row = product[n_parameters + k]
        for i in range(n):
            share = transition[k, i]
            for j in range(n):
                information[i, j] += share * row[j]


@compiled(types.void(TIMELINE, LINEARISED, TRACE, _vector, _matrix, _matrix, _matrix, _matrix), reassociate=True)
def backward(timeline, about, trace, adjoint, information, step, variance, product):
    """Smooth a chunk of the data.

    Parameters
    ----------
    timeline, about, trace
        Of `forward`.
    adjoint : ndarray, shape (n,)
        r after the last event; carried to before the first.
    information : ndarray, shape (n, n)
        Its covariance, alike; of no size where variances are not asked for.
    step : ndarray, shape (n_events, n_moving)
        Filled in: smoothed deviation of the moving states.
    variance : ndarray, shape (n_events, n_moving)
        Filled in: its variance, if asked for.
    product : ndarray, shape (n, n)
        Overwritten.
    """
    n, n_moving = adjoint.size, step.shape[1]
    n_parameters = n - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for i in range(n_moving):
            row = trace.covariance[event, i]
            total = trace.filtered[event, n_parameters + i]
            for j in range(n):
                total += row[j] * adjoint[j]
            step[event, i] = total
            if information.shape[0] > 0:
                square = 0.0
                for k in range(n):
                    dot = 0.0
                    for j in range(n):
                        dot += information[k, j] * row[j]
                    square += row[k] * dot
                variance[event, i] = row[n_parameters + i] - square
        first, last = timeline.measurement_offset[event], timeline.measurement_offset[event + 1]
        for before in range(last - first):
            k = last - 1 - before
            for reverse in range(about.residual.shape[1]):
                c = about.residual.shape[1] - 1 - reverse
                if np.isnan(about.residual[k, c]):
                    continue
                gain, total = trace.gain[k, c], trace.total[k, c]
                if information.shape[0] > 0:
                    _take_in_information(about.rows[k, c], gain, total, information, product[0])
                _take_in(about.rows[k, c], gain, trace.error[k, c], total, adjoint)
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            _back_in_time(trace.transition[event], n_parameters, adjoint, information, product)
