"""Nonlinear least squares of motions left to themselves, on compressed rows."""

from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from auvid_cli.filters.huber import weight
from auvid_cli.filters.information import Information, jointly
from auvid_cli.filters.problem import Gaussian
from auvid_cli.filters.segments import JointProblem
from auvid_cli.filters.sensitivities import Response, responses

Array = NDArray[np.float64]

# scipy's hints know nothing of what it takes.
least_squares: Any = scipy.optimize.least_squares


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
    share: float = 1.0

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
            self._latest = state.copy(), jointly(by_segment, self._problem.n_parameters) if by_segment else None
        return self._latest[1]

    def _by_segment(self, state: Array) -> list[Information]:
        """Return the information of each segment; none if the motion or its squares blow up in one."""
        process, sensors, segments, _ = self._problem
        by_segment = []
        for timelines, place in zip(segments, self._problem.places, strict=True):
            information = Information.none(place.size)
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
