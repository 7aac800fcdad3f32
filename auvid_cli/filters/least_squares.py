"""Fisher information of whitened measurements as a square root, and nonlinear least squares on such rows."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from auvid_cli.arrays import Array
from auvid_cli.filters.problem import Gaussian, Indices, JointProblem, segment_indices
from auvid_cli.filters.sensitivities import Response, responses
from auvid_cli.filters.smoother_forward import weight
from auvid_cli.numerics import compiled, types

_matrix = types.float64[:, ::1]
# Rows of one QR step: with the triangle they fit into the first-level cache.
_CHUNK = 96
# Smallest singular value of the scaled factor, relative to the largest; smaller ones are rounding of a long run.
_ROUNDING = 1e-12
# Component along an unobserved direction, relative to the norm, from which a combination of states is unobserved.
_MIN_COMPONENT = 1e-9
# scipy's type hints reject its own arguments.
least_squares: Any = scipy.optimize.least_squares


@compiled(types.void(_matrix, _matrix, _matrix), reassociate=True)
def _compress(triangle, rows, columns):
    """Replace a triangle by the R factor of itself stacked on rows, in place.

    The triangle of modified Gram-Schmidt, including the right-hand side in its last column, is as accurate as
    Householder's (Bjorck 1967). A zero column gets a row of zeros. LAPACK's threads would slow down filters that run in
    parallel. `columns`, shape (width, width + `_CHUNK`), is scratch.
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
    """Covariance ``root root'``, and infinite variance along unobserved directions."""

    root: Array  # shape (n, m)
    # Shape (n, q); each column is a direction without information. For a whole state they are orthonormal in `unit`.
    unobserved: Array
    unit: Array  # shape (n,); scale of each entry of the state

    def deviation(self, combinations: Array) -> Array:
        """Return standard deviations of linear combinations, shape (..., n); infinite if unobserved."""
        finite = np.sqrt(np.square(combinations @ self.root).sum(axis=-1))
        return np.where(self._is_unobserved(combinations).any(axis=-1), np.inf, finite)

    def covariance(self, combinations: Array) -> Array:
        """Return the covariance of linear combinations, shape (m, n), with infinite entries if unobserved."""
        root, share = combinations @ self.root, combinations @ self.unobserved
        share[~self._is_unobserved(combinations)] = 0.0
        common, size = share @ share.T, np.linalg.norm(share, axis=1)
        infinite = np.abs(common) > _MIN_COMPONENT * np.outer(size, size)
        return root @ root.T + np.where(infinite, np.copysign(np.inf, common), 0.0)

    def of(self, place: Indices) -> "Uncertainty":
        """Return the uncertainty of some components."""
        return Uncertainty(np.linalg.qr(self.root[place].T)[1].T, self.unobserved[place], self.unit[place])

    def _is_unobserved(self, combinations: Array) -> NDArray[np.bool_]:
        size = np.sqrt(np.square(combinations * self.unit).sum(axis=-1, keepdims=True))
        return np.abs(combinations @ self.unobserved) > _MIN_COMPONENT * size


class Information(NamedTuple):
    """Least-squares problem ``|factor dx - projected|^2 + remaining^2`` of a change dx of the state.

    With the whitened derivative J and innovation r of all measurements, it equals ``|J dx - r|^2`` for every dx. At the
    true state ``factor' factor`` is the Fisher information, whose inverse bounds the covariance of unbiased estimates
    (Cramer and Rao).
    """

    factor: Array  # shape (n, n); ``factor' factor = J' J``; upper triangular if built from rows
    projected: Array  # shape (n,); ``factor' projected = J' r``
    remaining: float  # norm of the residual at the minimum
    n_measurements: int  # number of scalar measurements

    @classmethod
    def empty(cls, n: int) -> "Information":
        """Return no information about n states."""
        return cls(np.zeros((n, n)), np.zeros(n), 0.0, 0)

    @classmethod
    def of_gaussian(cls, gaussian: Gaussian, state: Array) -> "Information":
        """Return the information of a prior about `state`, with no measurements."""
        about_state = np.column_stack([np.eye(state.size), gaussian.mean - state])
        rows = solve_triangular(gaussian.factor, about_state, lower=True)
        return cls.empty(state.size).with_rows(rows, 0)

    @property
    def is_finite(self) -> bool:
        """Whether all entries are finite."""
        return bool(
            np.isfinite(self.remaining) and np.isfinite(self.factor).all() and np.isfinite(self.projected).all()
        )

    def with_rows(self, rows: Array, n_measurements: int) -> "Information":
        """Add rows ``[J, r]``, shape (m, n + 1)."""
        n = self.projected.size
        triangle = np.zeros((n + 1, n + 1))
        triangle[:n, :n], triangle[:n, n], triangle[n, n] = self.factor, self.projected, self.remaining
        _compress(triangle, np.ascontiguousarray(rows), np.empty((n + 1, n + 1 + _CHUNK)))
        return Information(
            triangle[:n, :n].copy(), triangle[:n, n].copy(), float(triangle[n, n]), self.n_measurements + n_measurements
        )

    def with_response(self, response: Response, of: NDArray[np.bool_] | slice = slice(None)) -> "Information":
        """Add the measurements of a chunk, or some of them."""
        rows = response.whitened[of]
        return self.with_rows(
            rows.reshape(-1, rows.shape[-1]), int(np.count_nonzero(~np.isnan(response.innovation[of])))
        )

    def join(self, other: "Information") -> "Information":
        """Add the information of independent measurements of the same state."""
        rows = np.column_stack([other.factor, other.projected])
        last = np.append(np.zeros(other.projected.size), other.remaining)
        return self.with_rows(np.vstack([rows, last]), other.n_measurements)

    def split(self, n: int) -> "tuple[Array, Information]":
        """Separate the information about the first n components from rows that the other components fit exactly.

        Returns
        -------
        rows : ndarray, shape (n_all - n, n_all + 1)
            Zero for unobserved directions of the other components.
        rest : Information
            Marginal information about the first n.
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
        """Return the Cramer-Rao bound."""
        scale, values, directions, observed = self._decomposed()
        basis = directions.T / scale[:, None]
        return Uncertainty(basis[:, observed] / values[observed], basis[:, ~observed], 1.0 / scale)

    def unobserved(self) -> Array:
        """Return rows, shape (q, n), along unobserved directions, which complete `factor` to full rank.

        Their singular values equal the largest of `factor`.
        """
        scale, values, directions, observed = self._decomposed()
        return values.max(initial=1.0) * directions[~observed] * scale

    def _decomposed(self) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Return column norms of the factor; singular values, right vectors and observed ones of the scaled factor."""
        size = np.linalg.norm(self.factor, axis=0)
        scale = np.where(size > 0.0, size, 1.0)
        _, values, directions = np.linalg.svd(self.factor / scale)
        return scale, values, directions, values > _ROUNDING * values.max(initial=0.0)


def join_segments(by_segment: Sequence[Information], n_parameters: int) -> Information:
    """Return the information of all segments about their joint state."""
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
    """Least-squares estimate of the joint state."""

    state: Array  # shape (n,)
    information: Information  # information of the measurements, at this state
    cost: float  # sum of squares
    converged: bool
    evaluations: int  # number of simulations of the motion
    fraction: float = 1.0  # fraction of all events that were fitted

    def deviation(self, n_parameters: int) -> Array:
        """Return the standard deviations of the parameters; infinite if unobserved."""
        return self.information.uncertainty().deviation(np.eye(self.state.size)[:n_parameters])


def fit_free_motion(
    problem: JointProblem,
    start: Array,
    gaussian: Gaussian | None,
    bounds: tuple[Array, Array],
    tolerance: float,
    max_evaluations: int,
) -> LeastSquaresFit | None:
    """Fit parameters and initial motions to measurements; None if the motion from `start` diverges.

    Parameters
    ----------
    problem : JointProblem
        Its prior is ignored.
    start : ndarray, shape (n,)
        Joint state within the bounds.
    gaussian : Gaussian or None
        Prior of the joint state.
    bounds : tuple of ndarray, shape (n,)
        Lower and upper bounds.
    tolerance : float
        Relative decrease of the sum of squares, or relative change of the state, of the last step.
    max_evaluations : int
        Maximum number of simulations of the motion, at least 1.
    """
    squares = _SumOfSquares(problem, gaussian)
    if squares.information(start) is None:
        return None
    solution = least_squares(
        squares.residuals,
        start,
        squares.jacobian,
        bounds,
        # Columns differ by orders of magnitude.
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        # A gradient has no natural scale.
        gtol=None,
        max_nfev=max_evaluations,
    )
    information = squares.information(solution.x)
    assert information is not None, "the solver returns a state that it evaluated"
    return LeastSquaresFit(solution.x, information, 2.0 * solution.cost, solution.status > 0, solution.nfev)


class _SumOfSquares:
    """Residuals and derivative of the solver; the information at the latest state is kept for both."""

    def __init__(self, problem: JointProblem, gaussian: Gaussian | None) -> None:
        self._problem, self._n = problem, problem.prior.mean.size
        n = self._n
        self._mean = np.zeros(n) if gaussian is None else gaussian.mean
        self._weight = np.zeros((0, n)) if gaussian is None else np.linalg.inv(gaussian.factor).astype(np.float64)
        self._latest: tuple[Array, Information | None] | None = None

    def information(self, state: Array) -> Information | None:
        """Return the information of all measurements; None if the motion diverges."""
        if self._latest is None or not np.array_equal(self._latest[0], state):
            by_segment = self._by_segment(state)
            self._latest = state.copy(), join_segments(by_segment, self._problem.n_parameters) if by_segment else None
        return self._latest[1]

    def _by_segment(self, state: Array) -> list[Information]:
        """Return the information of each segment; empty if the motion or its squares diverge."""
        process, sensors, segments, _ = self._problem
        by_segment = []
        for timelines, place in zip(segments, self._problem.indices, strict=True):
            information = Information.empty(place.size)
            for response in responses(process, sensors, timelines, state[place]):
                if response.diverged:
                    return []
                information = _with_response(information, response, sensors.threshold)
            if not information.is_finite:
                return []
            by_segment.append(information)
        return by_segment

    def residuals(self, state: Array) -> Array:
        """Return compressed residuals, predicted less measured; infinite if the motion diverges."""
        information = self.information(state)
        if information is None:
            return np.full(2 * self._n + 1 + len(self._weight), np.inf)
        of_gaussian = self._weight @ (state - self._mean)
        return np.concatenate([-information.projected, [information.remaining], np.zeros(self._n), of_gaussian])

    def jacobian(self, state: Array) -> Array:
        """Return the derivative of `residuals`."""
        information = self.information(state)
        assert information is not None, "the solver accepts only finite residuals"
        # Zero residuals with a slope along unobserved directions keep the state from moving along these.
        kept = np.zeros((self._n, self._n))
        if not self._weight.size:
            unobserved = information.unobserved()
            kept[: len(unobserved)] = unobserved
        return np.vstack([information.factor, np.zeros(self._n), kept, self._weight])


def _with_response(information: Information, response: Response, threshold: float) -> Information:
    """Add the measurements of a chunk, with weights that make the sum of squares Huber's cost."""
    if np.isinf(threshold):
        return information.with_response(response)
    square = response.whitened[..., -1] ** 2
    weights = weight(square, threshold)
    beyond = np.zeros((1, response.whitened.shape[-1]))
    beyond[0, -1] = np.sqrt((weights * (1.0 - weights) * square).sum())
    weighed = response._replace(whitened=np.sqrt(weights)[..., None] * response.whitened)
    return information.with_response(weighed).with_rows(beyond, 0)
