"""Sets of antipodal points as the compiled loops want them: in whole tiles of directions."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.point_sets import PointSet
from auvid_cli.lanes import LANES

Array = NDArray[np.float64]

# A block of lanes holds this many pairs; the last one has room for as many of the others as it needs.
PAIRS = LANES // 2
FEWER = PAIRS // 4, PAIRS // 2
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class Basis(NamedTuple):
    """A point set laid out for the compiled loops, which work on whole tiles of `PAIRS` pairs.

    Attributes
    ----------
    directions : ndarray, shape (n_tiles, m * PAIRS)
        Tile t holds, for every coordinate j, that of the pairs from ``t * PAIRS`` on, at ``j * PAIRS``; of the last one
        at ``j * last``. The dimension m is n, padded with zeros to the pairs that there is room for.
    transposed : ndarray, shape (n_tiles, m * PAIRS)
        Tile t holds, for every pair k, its coordinates from ``t * PAIRS`` on, in the same way.
    present : ndarray, shape (m,)
        One for each pair, zero for padding.
    last : int
        How many pairs the last tile holds: one of `FEWER`, or `PAIRS`.
    length : float
        Of the directions where each lies along an axis; zero where they are turned.
    weight, centred, curvature
        As in `PointSet`.
    """

    directions: Array
    transposed: Array
    present: Array
    last: int
    length: float
    weight: float
    centred: bool
    curvature: float


BASIS = types.NamedTuple(
    (_matrix, _matrix, _vector, types.int64, types.float64, types.float64, types.boolean, types.float64), Basis
)


def basis_of(point_set: PointSet) -> Basis:
    """Lay out a point set."""
    n = point_set.directions.shape[0]
    before = (n - 1) // PAIRS * PAIRS
    last = next(pairs for pairs in (*FEWER, PAIRS) if n <= before + pairs)
    n_tiles, m = before // PAIRS + 1, before + last
    padded = np.zeros((m, m))
    padded[:n, :n] = point_set.directions

    def in_tiles(matrix: Array) -> Array:
        tiles = np.zeros((n_tiles, m * PAIRS))
        for t in range(n_tiles):
            tile = matrix[:, t * PAIRS : (t + 1) * PAIRS]
            tiles[t, : tile.size] = tile.reshape(-1)
        return tiles

    present = (np.arange(m) < n).astype(float)
    tiles = in_tiles(padded), in_tiles(padded.T)
    first = float(point_set.directions[0, 0])
    length = first if np.array_equal(point_set.directions, first * np.eye(n)) else 0.0
    return Basis(*tiles, present, last, length, point_set.weight, point_set.centred, point_set.curvature)


@compiled(types.int64(BASIS), internal=True)
def n_blocks(basis):
    """Count the blocks of points that a map has to work on: the centre, where it is needed, has one of its own."""
    n_tiles = basis.directions.shape[0]
    return n_tiles if basis.centred else n_tiles + 1


@compiled(types.uint64(BASIS, types.int64), internal=True)
def lanes_of(basis, block):
    """Count the lanes of a block that are in use."""
    n_tiles = basis.directions.shape[0]
    if block == n_tiles:
        return 1
    return 2 * basis.last if block == n_tiles - 1 else LANES
