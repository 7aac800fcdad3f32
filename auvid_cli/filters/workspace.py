"""Sigma-point sets, and the data layout of the compiled square-root filter."""

from typing import Any, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.filters.factor import TILE
from auvid_cli.filters.problem import (
    MODEL_DATA,
    OBSERVATION_SIGNATURE,
    PROCESS_SIGNATURE,
    Gaussian,
    Indices,
    ModelData,
    Process,
    Sensors,
)
from auvid_cli.numerics import LANES, compiled, types, zeros_on_lines

# Antipodal pairs in a block of lanes; the last block has one of `FEWER` or `PAIRS`.
PAIRS = LANES // 2
FEWER = PAIRS // 4, PAIRS // 2
_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_indices = types.int64[::1]


class PointSet(NamedTuple):
    """Half of an antipodal set for a standard normal vector."""

    directions: Array  # shape (n, n); column k is ``delta_k``; the points are +delta_k and -delta_k
    weight: float  # weight of each of the 2 n points; ``2 weight directions @ directions.T == I``
    centred: bool  # whether deviations are taken from the mean of the points (cubature) or from the centre (unscented)
    # Weight, in the covariance, of the squared shift of the mean from the centre: ``beta - alpha^2`` of the scaled
    # unscented transformation; not used by centred sets
    curvature: float


def cubature(n: int) -> PointSet:
    """Return the points of the third-degree spherical-radial rule: ``+-sqrt(n) e_i`` (Arasaratnam and Haykin 2009)."""
    return PointSet(np.sqrt(n) * np.eye(n), 0.5 / n, True, 0.0)


def transformed(n: int) -> PointSet:
    """Return the rotated cubature set, in which no coordinate exceeds sqrt 2.

    Sabet et al. 2018, eq. (34); Chang, Hu, Li and Chang, IEEE TAC 58(1), 2013. Of the paper's 2 n
    points, the k-th and the (n + k)-th are antipodal.
    """
    k = np.arange(1, n + 1)
    directions = np.zeros((n, n))
    for j in range(1, n // 2 + 1):
        angle = (2 * j - 1) * k * np.pi / n
        directions[2 * j - 2] = np.sqrt(2.0) * np.cos(angle)
        directions[2 * j - 1] = np.sqrt(2.0) * np.sin(angle)
    if n % 2:
        directions[n - 1] = (-1.0) ** k
    return PointSet(directions, 0.5 / n, True, 0.0)


def unscented(n: int, alpha: float, beta: float, kappa: float) -> PointSet:
    """Return the points of the scaled unscented transformation (Julier 2002; van der Merwe 2004).

    With the even part e of the propagated points about the centre and its mean mu, the covariance is
    ``odd + 2 w sum e e' + (beta - alpha^2) mu mu'``: a sum of squares if ``beta >= alpha^2``, even if the weight of the
    centre is negative.
    """
    spread = alpha**2 * (n + kappa)
    return PointSet(np.sqrt(spread) * np.eye(n), 0.5 / spread, False, beta - alpha**2)


class Basis(NamedTuple):
    """Point set as tiles of `PAIRS` pairs; the dimension m is n padded to whole tiles."""

    # Shape (n_tiles, m * PAIRS); tile t holds the pairs from ``t * PAIRS`` on, with their coordinates j from
    # ``j * PAIRS`` on, in the last tile from ``j * last`` on
    directions: Array
    transposed: Array  # shape (n_tiles, m * PAIRS); the same for the transposed directions
    present: Array  # shape (m,); 1 for a pair, 0 for padding
    last: int  # number of pairs in the last tile: one of `FEWER`, or `PAIRS`
    length: float  # length of directions along axes; zero for a rotated set
    weight: float  # as in `PointSet`
    centred: bool  # as in `PointSet`
    curvature: float  # as in `PointSet`


BASIS = types.NamedTuple(
    (_matrix, _matrix, _vector, types.int64, types.float64, types.float64, types.boolean, types.float64), Basis
)


def basis_of(point_set: PointSet) -> Basis:
    """Return the tiles of a point set."""
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


@compiled()
def n_blocks(basis):
    """Return the number of blocks of points; the centre has its own block if it is needed."""
    n_tiles = basis.directions.shape[0]
    return n_tiles if basis.centred else n_tiles + 1


@compiled()
def lanes_of(basis, block):
    """Return the number of lanes in use in a block."""
    n_tiles = basis.directions.shape[0]
    if block == n_tiles:
        return 1
    return 2 * basis.last if block == n_tiles - 1 else LANES


class Components(NamedTuple):
    """Sparse measurement matrices by component; a nonlinear sensor selects the appended rows of the factor."""

    begin: Indices  # shape (n_sensors * c + 1,); index of the first entry of component i of sensor s, at ``s * c + i``
    place: Indices  # row of the factor of each entry
    weight: Array  # value of each entry

    @classmethod
    def of(cls, sensors: Sensors) -> "Components":
        """Return the nonzero entries of the measurement matrices."""
        n_sensors, n_components, n = sensors.matrix.shape
        rows = np.concatenate([sensors.matrix, np.zeros((n_sensors, n_components, n_components))], axis=2)
        rows[sensors.nonlinear] = np.eye(n_components, n + n_components, n)
        rows = rows.reshape(n_sensors * n_components, -1)
        component, place = np.nonzero(rows)
        begin = np.searchsorted(component, np.arange(len(rows) + 1))
        return cls(begin, np.ascontiguousarray(place), rows[component, place])


COMPONENTS = types.NamedTuple((_indices, _indices, _vector), Components)


class SquareRootModel(NamedTuple):
    """Process, sensors and sigma points; `advance` and `observe` as in `Process`."""

    advance: Any
    observe: Any
    data: ModelData
    components: Components
    basis: Basis


MODEL = types.NamedTuple(
    (types.FunctionType(PROCESS_SIGNATURE), types.FunctionType(OBSERVATION_SIGNATURE), MODEL_DATA, COMPONENTS, BASIS),
    SquareRootModel,
)


class State(NamedTuple):
    """Gaussian in the layout of the compiled loops."""

    n: int  # dimension
    mean: Array  # shape (width,); the state, then the prediction of a nonlinear sensor, then padding
    # Shape (m, width); row j holds column j of the lower-triangular factor of the covariance, then column j of the
    # prediction's rows; zero elsewhere
    columns: Array

    @classmethod
    def of(cls, gaussian: Gaussian, n_columns: int, width: int) -> "State":
        """Return a Gaussian in this layout."""
        n = gaussian.mean.size
        state = cls(n, zeros_on_lines(width), zeros_on_lines(n_columns, width))
        state.mean[:n], state.columns[:n, :n] = gaussian.mean, gaussian.factor.T
        return state

    def copy(self) -> "State":
        """Return a copy."""
        return State(self.n, self.mean.copy(), self.columns.copy())

    def covariance(self) -> Array:
        """Return the covariance, shape (n, n)."""
        factor = self.columns[: self.n, : self.n]
        return factor.T @ factor


STATE = types.NamedTuple((types.int64, _vector, _matrix), State)


class Workspace(NamedTuple):
    """Scratch arrays; r is the larger of the numbers of moving states and of components."""

    points: Array  # shape (n_tiles + 1, n * LANES); sigma points; the last block is the centre
    images: Array  # shape (n_tiles + 1, c * LANES); predicted measurements of the points
    # `odd` and `regression` have three spare rows, because matrix products come four rows at a time.
    odd: Array  # shape (r + 3, m); odd part of the images: weighted difference of each pair
    regression: Array  # shape (r + 3, m); derivative of each image by the columns of the factor
    spread: Array  # shape (r, padded)
    lower: Array  # shape (r, r); without spare rows
    product: Array  # shape (4 * PAIRS,)
    process: Array  # scratch of the process
    gain: Array  # shape (width,)
    measured: Array  # shape (m + 1,)
    ratio: Array  # shape (m + 1,)
    share: Array  # shape (m + 1,)
    component: Indices  # shape (c,); indices of the selected components
    noise: Array  # shape (c,); noise variances of the selected components
    error: Array  # shape (c,); innovations of the selected components


WORKSPACE = types.NamedTuple((*[_matrix] * 6, *[_vector] * 6, types.int64[::1], *[_vector] * 2), Workspace)


def padded(size: int) -> int:
    """Round up to whole tiles."""
    return -(-size // TILE) * TILE


def new_workspace(basis: Basis, process: Process, n: int, n_components: int, width: int) -> Workspace:
    """Return the workspace for n states, and sensors of up to `n_components`."""
    n_tiles, m = basis.directions.shape[0], basis.present.size
    n_moving = process.noise_density.size
    most = max(n_moving, n_components)
    return Workspace(
        points=zeros_on_lines(n_tiles + 1, n * LANES),
        images=zeros_on_lines(n_tiles + 1, n_components * LANES),
        odd=zeros_on_lines(most + 3, m),
        regression=zeros_on_lines(most + 3, m),
        spread=zeros_on_lines(most, padded(2 * most + m + 1)),
        lower=zeros_on_lines(most, most),
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
