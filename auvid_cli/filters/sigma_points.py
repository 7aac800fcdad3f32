"""Prediction with antipodal sigma points: draw them, move them, collect mean and factor.

What a process does to a pair of points ``+delta, -delta`` splits into an odd part (what a linear map
does) and an even part (curvature). In the basis of the factor S the odd part is the matrix ``O = 2 w sum
o_k delta_k'``; because the directions are an orthogonal basis, ``O O'`` is all of the odd covariance.

Parameters are constant. Their mean and their rows of S stay as they are; the columns of O that belong
to them are the new cross block of S, and only the few moving rows are triangularised.
"""

import numpy as np
from numba import types

from auvid_cli.blocks import LANES
from auvid_cli.compilation import compiled
from auvid_cli.filters.factor import triangularise
from auvid_cli.filters.point_sets import PointSet
from auvid_cli.filters.problem import PROCESS_SIGNATURE

_HALF = LANES // 2
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]
POINT_SET = types.NamedTuple((_matrix, types.float64, types.boolean, types.float64), PointSet)


@compiled(types.void(_vector, _matrix, _matrix, types.int64, types.int64, types.int64, _vector), reassociate=True)
def draw_points(mean, columns, directions, first, count, n_moving, block):
    """Fill one block with the points ``mean +- S delta_k`` for k from `first` on.

    +delta lies in the lower half of the lanes and -delta in the upper; lanes without a direction
    hold the mean. Moving rows come first in a block, then the parameters.
    """
    n = mean.size
    n_parameters = n - n_moving
    for i in range(n):
        lane = i - n_parameters if i >= n_parameters else i + n_moving
        row = block[lane * LANES : (lane + 1) * LANES]
        plus, minus = row[:_HALF], row[_HALF:]
        for k in range(_HALF):
            plus[k] = 0.0
        for j in range(i + 1):
            entry = columns[j, i]
            direction = directions[j, first : first + count]
            for k in range(count):
                plus[k] += entry * direction[k]
        for k in range(_HALF):
            minus[k] = mean[i] - plus[k]
            plus[k] = mean[i] + plus[k]


@compiled(
    types.void(_matrix, POINT_SET, types.int64, _vector, types.float64, _vector, _matrix, _matrix), reassociate=True
)
def collect_points(blocks, point_set, n_moving, noise_density, elapsed, mean, columns, spread):
    """Mean, cross block and covariance rows of the moving states from their propagated points.

    Parameters
    ----------
    blocks : ndarray, shape (n_blocks + 1, n * LANES)
        As drawn and advanced; the last one holds the centre.
    mean, columns : ndarray
        Moving entries of the mean and the cross block of the factor are written.
    spread : ndarray, shape (n_moving, 2 n_moving + n + 1)
        Filled with rows whose Gram matrix is the covariance of the moving states given the
        parameters: odd part by moving directions, even part, shift of the mean, process noise.
    """
    n = mean.size
    n_parameters = n - n_moving
    weight, directions = point_set.weight, point_set.directions
    spread[:] = 0.0
    odd = np.zeros(_HALF)
    for i in range(n_moving):
        row = spread[i]
        for j in range(n_parameters):
            columns[j, n_parameters + i] = 0.0
        centre = blocks[blocks.shape[0] - 1, i * LANES]
        if point_set.centred:
            total = 0.0
            for first in range(0, n, _HALF):
                points = blocks[first // _HALF, i * LANES : (i + 1) * LANES]
                for k in range(min(_HALF, n - first)):
                    total += points[k] + points[_HALF + k]
            centre = weight * total
        shift = 0.0
        for first in range(0, n, _HALF):
            count = min(_HALF, n - first)
            points = blocks[first // _HALF, i * LANES : (i + 1) * LANES]
            even = row[n_moving + first : n_moving + first + count]
            for k in range(count):
                odd[k] = weight * (points[k] - points[_HALF + k])
                even[k] = 0.5 * (points[k] + points[_HALF + k]) - centre
                shift += even[k]
                even[k] *= np.sqrt(2.0 * weight)
            for j in range(n):
                direction = directions[j, first : first + count]
                dot = 0.0
                for k in range(count):
                    dot += odd[k] * direction[k]
                if j < n_parameters:
                    columns[j, n_parameters + i] += dot
                else:
                    row[j - n_parameters] += dot
        shift *= 2.0 * weight
        if point_set.centred:
            mean[n_parameters + i] = centre
        else:
            mean[n_parameters + i] = centre + shift
            row[n_moving + n] = np.sqrt(point_set.curvature) * shift
        row[n_moving + n + 1 + i] = noise_density[i] * np.sqrt(elapsed)


@compiled(
    types.boolean(
        types.FunctionType(PROCESS_SIGNATURE),
        *(_vector, _indices, _vector, POINT_SET),
        *(_matrix, _indices, _vector, _vector, _matrix),
    ),
    reassociate=True,
)
def predict(
    advance, constants, selection, noise_density, point_set, inputs, piece_input, piece_duration, mean, columns
):
    """Move mean and factor over consecutive pieces of constant input, in place.

    Returns
    -------
    bool
        False if the result is not finite or not positive definite.
    """
    n, n_moving = mean.size, noise_density.size
    n_parameters = n - n_moving
    n_blocks = (n + _HALF - 1) // _HALF
    blocks = np.empty((n_blocks + 1, n * LANES))
    for b in range(n_blocks + 1):
        if b == n_blocks and point_set.centred:
            break
        block = blocks[b]
        first = b * _HALF
        count = max(min(_HALF, n - first), 0)
        draw_points(mean, columns, point_set.directions, min(first, n), count, n_moving, block)
        moving, parameters = block[: n_moving * LANES], block[n_moving * LANES :]
        n_lanes = np.uint64(LANES if count > 0 else 1)
        for piece in range(piece_duration.size):
            held = inputs[piece_input[piece]]
            advance(moving, parameters, held, constants, selection, n_lanes, piece_duration[piece])

    spread = np.empty((n_moving, 2 * n_moving + n + 1))
    collect_points(blocks, point_set, n_moving, noise_density, piece_duration.sum(), mean, columns, spread)
    lower = np.empty((n_moving, n_moving))
    if not np.isfinite(mean.sum()) or not triangularise(spread, spread.shape[1], lower):
        return False
    for j in range(n_moving):
        for i in range(j, n_moving):
            columns[n_parameters + j, n_parameters + i] = lower[i, j]
    return True
