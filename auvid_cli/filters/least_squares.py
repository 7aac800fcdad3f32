"""Fisher information of whitened measurements as a square root, and nonlinear least squares on such rows."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from numba import types
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from auvid_cli.compilation import compiled
from auvid_cli.filters.problem import Gaussian, Indices
from auvid_cli.filters.segments import JointProblem, segment_indices
from auvid_cli.filters.sensitivities import Response, responses
from auvid_cli.filters.smoother_forward import weight

Array = NDArray[np.float64]
_matrix = types.float64[:, ::1]
# Rows that are worked on at once: with the triangle they fit into the cache nearest to the processor.
_CHUNK = 96
# Singular values of the scaled factor below this share of the largest are the rounding of a long run.
_ROUNDING = 1e-12
# A combination of states has a share in a direction without information if it is more than rounding.
_SHARE = 1e-9
# scipy's hints know nothing of what it takes.
least_squares: Any = scipy.optimize.least_squares


@compiled(types.void(_matrix, _matrix, _matrix), reassociate=True)
def _compress(triangle, rows, columns):
    """Replace a square matrix by the triangle of the QR decomposition of itself above some rows, in place.

    Modified Gram-Schmidt, whose triangle is as accurate as Householder's, the last column as right-hand side included
    (Bjorck 1967). A column that vanishes gets a row of zeros. Compiled instead of LAPACK's, whose threads get in each
    other's way where filters run side by side. `columns` is scratch, a row of it a column.
    """
    width = rows.shape[1]
    for begin in range(0, rows.shape[0], _CHUNK):
        for j in range(width):
            for i in range(width):
                columns[j, i] = triangle[i, j]
            for i in range(_CHUNK):
                columns[j, width + i] = rows[begin + i, j] if begin + i < rows.shape[0] else 0.0
        for i in range(width):
            column = columns[i]
            square = 0.0
            for k in range(width + _CHUNK):
                square += column[k] * column[k]
            norm = np.sqrt(square)
            triangle[i, i] = norm
            for j in range(i + 1, width):
                other = columns[j]
                dot = 0.0
                for k in range(width + _CHUNK):
                    dot += other[k] * column[k]
                triangle[i, j] = 0.0 if square == 0.0 else dot / norm
                triangle[j, i] = 0.0
                share = 0.0 if square == 0.0 else dot / square
                for k in range(width + _CHUNK):
                    other[k] -= share * column[k]


class Uncertainty(NamedTuple):
    """Covariance ``root root'``, and infinite variance along the columns of `unobserved`.

    Attributes
    ----------
    root : ndarray, shape (n, m)
    blind : ndarray, shape (n, q)
        Directions of which the measurements say nothing; of a whole state orthonormal in units of `unit`.
    unit : ndarray, shape (n,)
        By which entries of the state are made comparable.
    """

    root: Array
    unobserved: Array
    unit: Array

    def deviation(self, combinations: Array) -> Array:
        """Find standard deviations of linear combinations, shape (..., n), of the state; infinite where it is blind."""
        known = np.sqrt(np.square(combinations @ self.root).sum(axis=-1))
        return np.where(self._unknown(combinations).any(axis=-1), np.inf, known)

    def covariance(self, combinations: Array) -> Array:
        """Return the covariance matrix of the rows of a matrix, shape (m, n), with infinities where it is blind."""
        root, share = combinations @ self.root, combinations @ self.unobserved
        share[~self._unknown(combinations)] = 0.0
        common, size = share @ share.T, np.linalg.norm(share, axis=1)
        infinite = np.abs(common) > _SHARE * np.outer(size, size)
        return root @ root.T + np.where(infinite, np.copysign(np.inf, common), 0.0)

    def of(self, place: Indices) -> "Uncertainty":
        """Return that of some components."""
        return Uncertainty(np.linalg.qr(self.root[place].T)[1].T, self.unobserved[place], self.unit[place])

    def _unknown(self, combinations: Array) -> NDArray[np.bool_]:
        size = np.sqrt(np.square(combinations * self.unit).sum(axis=-1, keepdims=True))
        return np.abs(combinations @ self.unobserved) > _SHARE * size


class Information(NamedTuple):
    """What measurements say about a state, as the least-squares problem ``|factor dx - projected|^2 + remaining^2``.

    With the derivative J and the innovation r of all measurements, both whitened, it has the same sum of squares
    ``|J dx - r|^2`` for every dx. No estimate without bias has a covariance below the inverse of ``factor' factor``
    at the true state (Cramer and Rao).

    Attributes
    ----------
    factor : ndarray, shape (n, n)
        ``factor' factor = J' J``; upper triangular as it comes from rows.
    projected : ndarray, shape (n,)
        ``factor' projected = J' r``.
    remaining : float
        Norm of the part of r that no dx explains.
    n_measurements : int
        Scalar measurements, components that are present.
    """

    factor: Array
    projected: Array
    remaining: float
    n_measurements: int

    @classmethod
    def empty(cls, n: int) -> "Information":
        """Make one that says nothing about a state of n components."""
        return cls(np.zeros((n, n)), np.zeros(n), 0.0, 0)

    @classmethod
    def of_gaussian(cls, gaussian: Gaussian, state: Array) -> "Information":
        """Make one of what a Gaussian says, as rows about `state`; it counts no measurements."""
        about_state = np.column_stack([np.eye(state.size), gaussian.mean - state])
        rows = solve_triangular(gaussian.factor, about_state, lower=True)
        return cls.empty(state.size).with_rows(rows, 0)

    @property
    def is_finite(self) -> bool:
        """Say whether all of it is finite."""
        return bool(
            np.isfinite(self.remaining) and np.isfinite(self.factor).all() and np.isfinite(self.projected).all()
        )

    def with_rows(self, rows: Array, n_measurements: int) -> "Information":
        """Add further rows ``[J, r]``, shape (m, n + 1), of so many measurements."""
        n = self.projected.size
        triangle = np.zeros((n + 1, n + 1))
        triangle[:n, :n], triangle[:n, n], triangle[n, n] = self.factor, self.projected, self.remaining
        _compress(triangle, np.ascontiguousarray(rows), np.empty((n + 1, n + 1 + _CHUNK)))
        return Information(
            triangle[:n, :n].copy(), triangle[:n, n].copy(), float(triangle[n, n]), self.n_measurements + n_measurements
        )

    def with_response(self, response: Response, of: NDArray[np.bool_] | slice = slice(None)) -> "Information":
        """Add the measurements of a chunk of the motion, or some of them."""
        rows = response.whitened[of]
        return self.with_rows(
            rows.reshape(-1, rows.shape[-1]), int(np.count_nonzero(~np.isnan(response.innovation[of])))
        )

    def join(self, other: "Information") -> "Information":
        """Add what independent measurements say about the same state."""
        rows = np.column_stack([other.factor, other.projected])
        last = np.append(np.zeros(other.projected.size), other.remaining)
        return self.with_rows(np.vstack([rows, last]), other.n_measurements)

    def split(self, n: int) -> "tuple[Array, Information]":
        """Tell what it says of the first n components, whatever the others are, from what it says of these besides.

        Returns
        -------
        rows : ndarray, shape (m, n_all + 1)
            As many as there are others, which can meet them all; zero for directions that are not observed.
        rest : Information
            About the first n alone.
        """
        others = self.factor[:, n:]
        size = np.linalg.norm(others, axis=0)
        directions, values, _ = np.linalg.svd(others / np.where(size > 0.0, size, 1.0), full_matrices=False)
        directions *= values > _ROUNDING * values.max(initial=0.0)
        whole = np.column_stack([self.factor, self.projected])
        rows = directions.T @ whole
        rest = whole - directions @ rows
        rest[:, n:-1] = 0.0
        last = np.append(np.zeros(self.projected.size), self.remaining)
        return rows, Information.empty(self.projected.size).with_rows(np.vstack([rest, last]), self.n_measurements)

    def uncertainty(self) -> Uncertainty:
        """Invert it: the bound of Cramer and Rao, infinite where the measurements say nothing."""
        scale, values, directions, observed = self._decomposed()
        basis = directions.T / scale[:, None]
        return Uncertainty(basis[:, observed] / values[observed], basis[:, ~observed], 1.0 / scale)

    def unobserved(self) -> Array:
        """Return rows, shape (q, n), that span the directions of which the measurements say nothing.

        They complete `factor` to full rank, with singular values like its largest.
        """
        scale, values, directions, observed = self._decomposed()
        return values.max(initial=1.0) * directions[~observed] * scale

    def _decomposed(self) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Decompose the factor: its column norms; of it scaled by these singular values, right vectors, what counts."""
        size = np.linalg.norm(self.factor, axis=0)
        scale = np.where(size > 0.0, size, 1.0)
        _, values, directions = np.linalg.svd(self.factor / scale)
        return scale, values, directions, values > _ROUNDING * values.max(initial=0.0)


def join_segments(by_segment: Sequence[Information], n_parameters: int) -> Information:
    """Join what segments say of their joint state, see `auvid_cli.filters.segments`."""
    n_of_segment = by_segment[0].projected.size
    n_moving = n_of_segment - n_parameters
    n = n_parameters + len(by_segment) * n_moving
    shared, factor, projected = Information.empty(n_of_segment), np.zeros((n, n)), np.zeros(n)
    for information, place in zip(by_segment, segment_indices(n, n_moving, len(by_segment)), strict=True):
        rows, rest = information.split(n_parameters)
        shared = shared.join(rest)
        factor[np.ix_(place[n_parameters:], place)] = rows[:, :-1]
        projected[place[n_parameters:]] = rows[:, -1]
    factor[:n_parameters, :n_parameters] = shared.factor[:n_parameters, :n_parameters]
    projected[:n_parameters] = shared.projected[:n_parameters]
    return Information(factor, projected, shared.remaining, shared.n_measurements)


class LeastSquaresFit(NamedTuple):
    """The joint state that fits best.

    Attributes
    ----------
    state : ndarray, shape (n,)
    information : Information
        Of the measurements, at this state.
    cost : float
        The sum of squares.
    converged : bool
    evaluations : int
        How often the motion was computed along the data.
    share : float
        How much of the events of all data it is a fit of.
    """

    state: Array
    information: Information
    cost: float
    converged: bool
    evaluations: int
    fraction: float = 1.0

    def deviation(self, n_parameters: int) -> Array:
        """Find the standard deviations of the parameters, infinite where the measurements say nothing."""
        return self.information.uncertainty().deviation(np.eye(self.state.size)[:n_parameters])


def fit_free_motion(
    problem: JointProblem,
    start: Array,
    gaussian: Gaussian | None,
    bounds: tuple[Array, Array],
    tolerance: float,
    max_evaluations: int,
) -> LeastSquaresFit | None:
    """Fit parameters and initial motions to measurements, and to a Gaussian about them if there is one.

    Parameters
    ----------
    problem : JointProblem
        Its segments are gone through once for each evaluation; its prior does not count.
    start : ndarray, shape (n,)
        Of the joint state; within the bounds.
    gaussian : Gaussian or None
    bounds : tuple of ndarray, shape (n,)
        Lower and upper.
    tolerance : float
        A step that makes the sum of squares smaller by less than this share of it, or changes the state by less, is
        the last.
    max_evaluations : int
        At least one.

    Returns
    -------
    LeastSquaresFit or None
        None if the motion from `start` blows up. A trial step from which it does is taken back and made shorter.
    """
    squares = _SumOfSquares(problem, gaussian)
    if squares.information(start) is None:
        return None
    solution = least_squares(
        squares.residuals,
        start,
        squares.jacobian,
        bounds,
        # Columns differ by orders of magnitude, with the length of the run too.
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        # A gradient has no scale of its own to be judged by.
        gtol=None,
        max_nfev=max_evaluations,
    )
    information = squares.information(solution.x)
    assert information is not None, "least squares ends where it has been"
    return LeastSquaresFit(solution.x, information, 2.0 * solution.cost, solution.status > 0, solution.nfev)


class _SumOfSquares:
    """What the solver asks for; it asks for residuals and derivative at one state after the other."""

    def __init__(self, problem: JointProblem, gaussian: Gaussian | None) -> None:
        self._problem, self._n = problem, problem.prior.mean.size
        n = self._n
        self._mean = np.zeros(n) if gaussian is None else gaussian.mean
        self._weight = np.zeros((0, n)) if gaussian is None else np.linalg.inv(gaussian.factor).astype(np.float64)
        self._latest: tuple[Array, Information | None] | None = None

    def information(self, state: Array) -> Information | None:
        """Return the information of all measurements; None if the motion from that state blows up."""
        if self._latest is None or not np.array_equal(self._latest[0], state):
            by_segment = self._by_segment(state)
            self._latest = state.copy(), join_segments(by_segment, self._problem.n_parameters) if by_segment else None
        return self._latest[1]

    def _by_segment(self, state: Array) -> list[Information]:
        """Return the information of each segment; none if the motion or its squares blow up in one."""
        process, sensors, segments, _ = self._problem
        by_segment = []
        for timelines, place in zip(segments, self._problem.indices, strict=True):
            information = Information.empty(place.size)
            for response in responses(process, sensors, timelines, state[place]):
                if response.blew_up:
                    return []
                information = _with_response(information, response, sensors.threshold)
            if not information.is_finite:
                return []
            by_segment.append(information)
        return by_segment

    def residuals(self, state: Array) -> Array:
        """Return predicted less measured, compressed; infinite where the motion blows up: the solver turns back."""
        information = self.information(state)
        if information is None:
            return np.full(2 * self._n + 1 + len(self._weight), np.inf)
        of_gaussian = self._weight @ (state - self._mean)
        return np.concatenate([-information.projected, [information.remaining], np.zeros(self._n), of_gaussian])

    def jacobian(self, state: Array) -> Array:
        """Return the derivative of `residuals`."""
        information = self.information(state)
        assert information is not None, "the solver steps only to where the residuals are finite"
        # A zero residual that grows along directions of which the measurements say nothing: the state stays where it is
        # along these, and the solver's matrix has full rank, without which its steps are as long as they may be.
        kept = np.zeros((self._n, self._n))
        if not self._weight.size:
            unobserved = information.unobserved()
            kept[: len(unobserved)] = unobserved
        return np.vstack([information.factor, np.zeros(self._n), kept, self._weight])


def _with_response(information: Information, response: Response, threshold: float) -> Information:
    """Add the measurements of a chunk of the motion, by weights that make the sum of squares that of rho."""
    if np.isinf(threshold):
        return information.with_response(response)
    square = response.whitened[..., -1] ** 2
    weights = weight(square, threshold)
    beyond = np.zeros((1, response.whitened.shape[-1]))
    beyond[0, -1] = np.sqrt((weights * (1.0 - weights) * square).sum())
    weighed = response._replace(whitened=np.sqrt(weights)[..., None] * response.whitened)
    return information.with_response(weighed).with_rows(beyond, 0)
