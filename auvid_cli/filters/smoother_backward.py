"""The way back of a smoother that is linear about a trajectory: what the filter did not know yet.

The adjoint of the modified Bryson-Frazier recursion (Bierman 1977, section X.5), which inverts no covariance: with r
what the data after an event say, and Lambda its covariance, the smoothed deviation is ``delta + P r``, of covariance
``P - P Lambda P``. Lambda is carried as a root W, ``Lambda = W W'``, to which each component of a measurement adds a
column: where a vehicle is unstable, or little was known at first, rounding of Lambda itself would lose what is left.
"""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.filters.factor import LEAST, orthogonalise
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.filters.smoother_forward import FORWARD_PASS, LINEARISED
from auvid_cli.numerics import compiled, zeros_on_lines

Array = NDArray[np.float64]

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
# Columns that are added to a root before it is made square again.
_MORE = 32
# The loops over columns go by so many.
_WHOLE = 16


class Adjoint(NamedTuple):
    """What the data from an event on say of the deviation there.

    Attributes
    ----------
    mean : ndarray, shape (n,)
        r.
    root : ndarray, shape (n, a multiple of 16)
        W, as far as `n_columns` says, zero beyond; of no size where variances are not asked for.
    n_columns : ndarray of int, shape (1,)
    work : ndarray, shape (as of `root`)
        Overwritten.
    """

    mean: Array
    root: Array
    n_columns: NDArray[np.int64]
    work: Array

    @classmethod
    def zeros(cls, n: int, with_variance: bool) -> "Adjoint":
        """Say nothing yet of a deviation of n components."""
        shape = n, -(-(n + _MORE) // _WHOLE) * _WHOLE
        root = zeros_on_lines(*shape) if with_variance else np.zeros((0, 0))
        # The mean of a step needs some room as well.
        return cls(zeros_on_lines(n), root, np.zeros(1, dtype=np.int64), zeros_on_lines(*shape))

    def to_previous_segment(self, gradient: Array) -> None:
        """Move to the end of the previous segment, whose motion is another: only information on parameters remains.

        Parameters
        ----------
        gradient : ndarray, shape (n, n_parameters)
            Derivative of the deviation by the parameters, themselves included.
        """
        n, n_parameters = gradient.shape
        self.mean[:n_parameters], self.mean[n_parameters:] = gradient.T @ self.mean, 0.0
        if self.root.size:
            self.root[:n_parameters], self.root[n_parameters:] = gradient.T @ self.root[:n], 0.0


ADJOINT = types.NamedTuple((_vector, _matrix, types.int64[::1], _matrix), Adjoint)


@compiled(inline=True)
def _whole_columns(adjoint):
    """Count the columns of the root, rounded up: what is left over would be gone through one by one."""
    return (adjoint.n_columns[0] + (_WHOLE - 1)) // _WHOLE * _WHOLE


@compiled(reassociate=True)
def _add_rows(weight, rows, n_columns, total):
    """Add a weighted sum of rows, as far as so many columns, four at a time: the sum is stored once for four."""
    whole = weight.size - weight.size % 4
    for j in range(0, whole, 4):
        weight0, weight1, weight2, weight3 = weight[j], weight[j + 1], weight[j + 2], weight[j + 3]
        row0, row1, row2, row3 = rows[j], rows[j + 1], rows[j + 2], rows[j + 3]
        for k in range(n_columns):
            total[k] += weight0 * row0[k] + weight1 * row1[k] + weight2 * row2[k] + weight3 * row3[k]
    for j in range(whole, weight.size):
        for k in range(n_columns):
            total[k] += weight[j] * rows[j, k]


@compiled(reassociate=True)
def _update_mean(row, gain, error, total, adjoint):
    """Carry the adjoint back over one component; returns what all data say of its noise, per variance of that."""
    known = 0.0
    for i in range(adjoint.size):
        known += gain[i] * adjoint[i]
    share = (error - known) / total
    for i in range(adjoint.size):
        adjoint[i] += share * row[i]
    return share


@compiled(reassociate=True)
def _make_square(adjoint):
    """Find the lower-triangular root of the same covariance, by modified Gram-Schmidt; see `triangularise`.

    A row that vanishes stays as it is: nothing is said of that component.
    """
    n, root, rows = adjoint.mean.size, adjoint.root, adjoint.work
    for i in range(n):
        for k in range(root.shape[1]):
            rows[i, k] = root[i, k]
            root[i, k] = 0.0
    for i in range(n):
        row, square = rows[i], 0.0
        for k in range(row.size):
            square += row[k] * row[k]
        if square >= LEAST:
            orthogonalise(rows, i, n, square, root)
    adjoint.n_columns[0] = n


@compiled(reassociate=True)
def _update_root(row, gain, total, adjoint):
    """Carry the root back over one component: ``L' W`` with ``L = I - g h' / total``, and ``h / sqrt(total)``.

    Returns the variance of what `_update_mean` does.
    """
    n, root, product = row.size, adjoint.root, adjoint.work[0]
    if adjoint.n_columns[0] == root.shape[1]:
        _make_square(adjoint)
    n_columns, last = _whole_columns(adjoint), adjoint.n_columns[0]
    for k in range(n_columns):
        product[k] = 0.0
    _add_rows(gain, root, n_columns, product)
    known, inverse = 0.0, 1.0 / total
    for k in range(n_columns):
        product[k] *= inverse
        known += product[k] * product[k]
    for i in range(n):
        h = row[i]
        if h != 0.0:
            for k in range(n_columns):
                root[i, k] -= h * product[k]
            root[i, last] = h * np.sqrt(inverse)
    adjoint.n_columns[0] = last + 1
    return inverse + known


@compiled(reassociate=True)
def adjoint_predict(transition, n_parameters, adjoint):
    """Carry adjoint and root back over a transition: ``F' r`` and ``F' W``; of F the upper rows are the identity's."""
    mean, root, moving = adjoint.mean, adjoint.root, adjoint.work
    n = mean.size
    n_moving = n - n_parameters
    for i in range(n_moving):
        moving[0, i] = mean[n_parameters + i]
        mean[n_parameters + i] = 0.0
    for i in range(n_moving):
        for j in range(n):
            mean[j] += moving[0, i] * transition[i, j]
    if root.shape[0] == 0:
        return
    n_columns = _whole_columns(adjoint)
    for i in range(n_moving):
        for k in range(n_columns):
            moving[i, k] = root[n_parameters + i, k]
            root[n_parameters + i, k] = 0.0
    for j in range(n):
        _add_rows(transition[:, j], moving, n_columns, root[j])


@compiled(reassociate=True, inline=True)
def adjoint_update(event, timeline, about, forward_pass, adjoint, told, variance):
    """Carry the adjoint back over the measurements of an event; write down what is said of their noise, if asked for.

    Parameters
    ----------
    event, timeline, about, forward_pass, adjoint
        As of `backward`.
    told, variance : ndarray, shape (n_measurements, c)
        Filled in: what all data say of the noise of each component, per variance of it, and the variance of that. Of no
        rows where they are not asked for.
    """
    n_components = about.residual.shape[1]
    first, last = timeline.measurement_offset[event], timeline.measurement_offset[event + 1]
    for before in range(last - first):
        k = last - 1 - before
        for reverse in range(n_components):
            c = n_components - 1 - reverse
            if np.isnan(about.residual[k, c]):
                continue
            row, gain, total, its_variance = about.rows[k, c], forward_pass.gain[k, c], forward_pass.total[k, c], 0.0
            if adjoint.root.shape[0] > 0:
                its_variance = _update_root(row, gain, total, adjoint)
            said = _update_mean(row, gain, forward_pass.error[k, c], total, adjoint.mean)
            if told.shape[0] > 0:
                told[k, c], variance[k, c] = said, its_variance


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, ADJOINT, _matrix, _matrix), reassociate=True)
def backward(timeline, about, forward_pass, adjoint, step, variance):
    """Smooth a chunk of the data.

    Parameters
    ----------
    timeline, about, forward_pass
        Of `forward`.
    adjoint : Adjoint
        After the last event; carried to before the first.
    step : ndarray, shape (n_events, n_moving)
        Filled in: smoothed deviation of the moving states.
    variance : ndarray, shape (n_events, n_moving)
        Filled in: its variance, if asked for.
    """
    mean, root, projected = adjoint.mean, adjoint.root, adjoint.work[0]
    n, n_moving = mean.size, step.shape[1]
    n_parameters = n - n_moving
    for back in range(timeline.time.size):
        event = timeline.time.size - 1 - back
        for i in range(n_moving):
            row = forward_pass.covariance[event, i]
            total = forward_pass.filtered[event, n_parameters + i]
            for j in range(n):
                total += row[j] * mean[j]
            step[event, i] = total
            if root.shape[0] > 0:
                n_columns = _whole_columns(adjoint)
                for k in range(n_columns):
                    projected[k] = 0.0
                _add_rows(row, root, n_columns, projected)
                square = 0.0
                for k in range(n_columns):
                    square += projected[k] * projected[k]
                variance[event, i] = row[n_parameters + i] - square
        adjoint_update(event, timeline, about, forward_pass, adjoint, step[:0], step[:0])
        if timeline.substep_offset[event + 1] > timeline.substep_offset[event]:
            adjoint_predict(about.transition[event], n_parameters, adjoint)
