"""Backward pass of the smoother: the modified Bryson-Frazier recursion (Bierman 1977, section X.5).

It gives the same estimates as the Rauch-Tung-Striebel recursion, and inverts no covariance. With the filtered deviation
d of covariance P, the adjoint r of the later data and its covariance Lambda, the smoothed deviation is ``d + P r``, of
covariance ``P - P Lambda P``. Over a transition F the adjoint becomes ``F' r``; over a measurement row h with
innovation e of variance S and gain ``g = P h'`` it becomes ``r + h' (e - g' r) / S``. Lambda is stored as a root W,
``Lambda = W W'``, to which each component adds a column: with unstable vehicles or a wide prior, rounding of Lambda
itself would exceed the smoothed covariance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.filters.factor import LEAST, orthogonalise
from auvid_cli.filters.problem import TIMELINE
from auvid_cli.filters.smoother_forward import FORWARD_PASS, LINEARISED
from auvid_cli.numerics import compiled, types, zeros_on_lines

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
# Columns added to a root before it is made square again.
_SPARE_COLUMNS = 32
# Columns of a vectorised loop are rounded up to a multiple of this.
_COLUMN_TILE = 16


class Adjoint(NamedTuple):
    """Adjoint of the deviation at an event, from the data after it."""

    mean: Array  # shape (n,); r
    # Shape (n, multiple of `_COLUMN_TILE`); W in the first `n_columns` columns, then zeros; empty without variances
    root: Array
    n_columns: NDArray[np.int64]  # shape (1,)
    work: Array  # scratch

    @classmethod
    def zeros(cls, n: int, with_variance: bool) -> "Adjoint":
        """Return the adjoint of n states after the last event."""
        shape = n, -(-(n + _SPARE_COLUMNS) // _COLUMN_TILE) * _COLUMN_TILE
        root = zeros_on_lines(*shape) if with_variance else np.zeros((0, 0))
        # `adjoint_predict` needs `work` for the mean, too.
        return cls(zeros_on_lines(n), root, np.zeros(1, dtype=np.int64), zeros_on_lines(*shape))

    def to_previous_segment(self, gradient: Array) -> None:
        """Move to the end of the previous segment; only information on parameters remains.

        `gradient`, shape (n, n_parameters), is the derivative of the initial deviation of this segment by the
        parameters, including themselves.
        """
        n, n_parameters = gradient.shape
        self.mean[:n_parameters], self.mean[n_parameters:] = gradient.T @ self.mean, 0.0
        if self.root.size:
            self.root[:n_parameters], self.root[n_parameters:] = gradient.T @ self.root[:n], 0.0


ADJOINT = types.NamedTuple((_vector, _matrix, types.int64[::1], _matrix), Adjoint)


@compiled(inline=True)
def _whole_columns(adjoint):
    """Return the number of columns of the root, rounded up so that loops are vectorised to the end."""
    return (adjoint.n_columns[0] + (_COLUMN_TILE - 1)) // _COLUMN_TILE * _COLUMN_TILE


@compiled(reassociate=True)
def _add_rows(weight, rows, n_columns, total):
    """Add a weighted sum of rows to `total`, in the first `n_columns`; four rows at a time save stores."""
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
    """Carry the adjoint back over one component; returns its smoothed noise divided by the noise variance."""
    projection = 0.0
    for i in range(adjoint.size):
        projection += gain[i] * adjoint[i]
    factor = (error - projection) / total
    for i in range(adjoint.size):
        adjoint[i] += factor * row[i]
    return factor


@compiled(reassociate=True)
def _make_square(adjoint):
    """Replace the root by the lower-triangular one, by modified Gram-Schmidt; see `triangularise`.

    A zero row stays zero: there is no information about that state.
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
    """Carry the root back over one component: ``[L' W, h' / sqrt(S)]`` with ``L = I - g h / S``.

    Returns the variance of the value that `_update_mean` returns.
    """
    n, root, product = row.size, adjoint.root, adjoint.work[0]
    if adjoint.n_columns[0] == root.shape[1]:
        _make_square(adjoint)
    n_columns, last = _whole_columns(adjoint), adjoint.n_columns[0]
    for k in range(n_columns):
        product[k] = 0.0
    _add_rows(gain, root, n_columns, product)
    square, inverse = 0.0, 1.0 / total
    for k in range(n_columns):
        product[k] *= inverse
        square += product[k] * product[k]
    for i in range(n):
        h = row[i]
        if h != 0.0:
            for k in range(n_columns):
                root[i, k] -= h * product[k]
            root[i, last] = h * np.sqrt(inverse)
    adjoint.n_columns[0] = last + 1
    return inverse + square


@compiled(reassociate=True)
def adjoint_predict(transition, n_parameters, adjoint):
    """Carry adjoint and root back over a transition, to ``F' r`` and ``F' W``; parameters stay."""
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
def adjoint_update(event, timeline, about, forward_pass, adjoint, noise, variance):
    """Carry the adjoint back over the measurements of an event.

    Parameters
    ----------
    event, timeline, about, forward_pass, adjoint
        As in `backward`.
    noise, variance : ndarray, shape (n_measurements, c) or (0, c)
        Filled in, unless empty: smoothed noise of each component divided by its variance, and the variance of that.
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
            smoothed = _update_mean(row, gain, forward_pass.error[k, c], total, adjoint.mean)
            if noise.shape[0] > 0:
                noise[k, c], variance[k, c] = smoothed, its_variance


@compiled(types.void(TIMELINE, LINEARISED, FORWARD_PASS, ADJOINT, _matrix, _matrix), reassociate=True)
def backward(timeline, about, forward_pass, adjoint, step, variance):
    """Smooth a chunk of the data.

    Parameters
    ----------
    timeline, about, forward_pass
        From `forward`.
    adjoint : Adjoint
        After the last event; afterwards before the first.
    step, variance : ndarray, shape (n_events, n_moving)
        Filled in: smoothed deviation of the moving states; its variance, if the adjoint has a root.
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
