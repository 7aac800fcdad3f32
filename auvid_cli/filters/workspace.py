"""Scratch of the square-root filter, made once: the loops allocate nothing."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from auvid_cli.filters.basis import PAIRS, Basis
from auvid_cli.filters.factor import SPARE_ROWS, TILE
from auvid_cli.filters.problem import Indices, Process
from auvid_cli.lanes import LANES, zeros_on_lines

Array = NDArray[np.float64]


class Workspace(NamedTuple):
    """Arrays that hold nothing from one use to the next.

    Attributes
    ----------
    points : ndarray, shape (n_tiles + 1, n * LANES)
        Drawn points; the last block is the centre's.
    images : ndarray, shape (n_tiles + 1, c * LANES)
        What a sensor measures of them.
    odd, regression : ndarray, shape (r, m)
        With r the number of moving states or of components of a sensor, whichever is more, and `SPARE_ROWS`.
    spread : ndarray, shape (r, whole tiles)
    lower : ndarray, shape (r, r)
    product : ndarray, shape (4 * PAIRS,)
    process : ndarray
        For the process itself.
    gain : ndarray, shape (width of the factor,)
    measured, ratio, share : ndarray, shape (m + 1,)
    component : ndarray of int, shape (c,)
        Which components of a measurement are used.
    noise, error : ndarray, shape (c,)
        Variance of the noise and innovation of these.
    """

    points: Array
    images: Array
    odd: Array
    regression: Array
    spread: Array
    lower: Array
    product: Array
    process: Array
    gain: Array
    measured: Array
    ratio: Array
    share: Array
    component: Indices
    noise: Array
    error: Array


_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
WORKSPACE = types.NamedTuple((*[_matrix] * 6, *[_vector] * 6, types.int64[::1], *[_vector] * 2), Workspace)


def padded(size: int) -> int:
    """Round up to whole tiles."""
    return -(-size // TILE) * TILE


def new_workspace(basis: Basis, process: Process, n: int, n_components: int, width: int) -> Workspace:
    """Make the workspace for a state of n entries, and sensors of up to `n_components`."""
    n_tiles, m = basis.directions.shape[0], basis.present.size
    n_moving = process.noise_density.size
    most = max(n_moving, n_components)
    rows = most + SPARE_ROWS
    return Workspace(
        points=zeros_on_lines(n_tiles + 1, n * LANES),
        images=zeros_on_lines(n_tiles + 1, n_components * LANES),
        odd=zeros_on_lines(rows, m),
        regression=zeros_on_lines(rows, m),
        spread=zeros_on_lines(rows, padded(2 * most + m + 1)),
        lower=zeros_on_lines(rows, rows),
        product=zeros_on_lines(4 * PAIRS),
        process=zeros_on_lines(process.scratch_size),
        gain=zeros_on_lines(width),
        measured=zeros_on_lines(m + 1),
        ratio=zeros_on_lines(m + 1),
        share=zeros_on_lines(m + 1),
        component=np.zeros(n_components, dtype=np.int64),
        noise=zeros_on_lines(n_components),
        error=zeros_on_lines(n_components),
    )
