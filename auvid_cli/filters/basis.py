"""Sets of antipodal points as the compiled loops want them: in whole tiles of directions."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.compilation import compiled
from auvid_cli.filters.point_sets import PointSet
from auvid_cli.lanes import LANES

Array = NDArray[np.float64]

# A block of lanes holds this many pairs.
PAIRS = LANES // 2
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]


class Basis(NamedTuple):
    """A point set laid out for the compiled loops, which work on whole tiles of `PAIRS` pairs.

    Attributes
    ----------
    directions : ndarray, shape (n_tiles, m * PAIRS)
        Tile t holds, for every coordinate j, that of the pairs from ``t * PAIRS`` on, at ``j * PAIRS``. The
        dimension m is n, padded with zeros to whole tiles.
    transposed : ndarray, shape (n_tiles, m * PAIRS)
        Tile t holds, for every pair k, its coordinates from ``t * PAIRS`` on, at ``k * PAIRS``.
    present : ndarray, shape (m,)
        One for each pair, zero for padding.
    weight, centred, curvature
        As in `PointSet`.
    """

    directions: Array
    transposed: Array
    present: Array
    weight: float
    centred: bool
    curvature: float


BASIS = types.NamedTuple((_matrix, _matrix, _vector, types.float64, types.boolean, types.float64), Basis)


def basis_of(point_set: PointSet) -> Basis:
    """Lay out a point set."""
    n = point_set.directions.shape[0]
    n_tiles = -(-n // PAIRS)
    padded = np.zeros((n_tiles * PAIRS, n_tiles * PAIRS))
    padded[:n, :n] = point_set.directions

    def in_tiles(matrix: Array) -> Array:
        return np.ascontiguousarray(matrix.reshape(-1, n_tiles, PAIRS).swapaxes(0, 1)).reshape(n_tiles, -1)

    present = (np.arange(n_tiles * PAIRS) < n).astype(float)
    return Basis(
        in_tiles(padded), in_tiles(padded.T), present, point_set.weight, point_set.centred, point_set.curvature
    )


@compiled(types.UniTuple(types.int64, 2)(BASIS), internal=True)
def blocks_and_lanes(basis):
    """Count the blocks of points that a map has to work on, and the lanes of the last: the centre needs one."""
    n_tiles = basis.directions.shape[0]
    return (n_tiles, LANES) if basis.centred else (n_tiles + 1, 1)
