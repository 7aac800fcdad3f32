"""Nonlinear least squares of the motion left to itself, on compressed rows."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from auvid_cli.filters.information import Information
from auvid_cli.filters.problem import Belief, Process, Sensors, Timeline
from auvid_cli.filters.sensitivities import responses

Array = NDArray[np.float64]

# scipy's hints know nothing of what it takes.
least_squares: Any = scipy.optimize.least_squares


class Fit(NamedTuple):
    """The initial state that fits best.

    Attributes
    ----------
    state : ndarray, shape (n,)
    information : Information
        Of the readings, at this state.
    converged : bool
    evaluations : int
        How often the motion was computed along the data.
    """

    state: Array
    information: Information
    converged: bool
    evaluations: int


def fit(
    process: Process,
    sensors: Sensors,
    timelines: Iterable[Timeline],
    start: Array,
    belief: Belief | None,
    bounds: tuple[Array, Array],
    tolerance: float,
    max_evaluations: int,
) -> Fit | None:
    """Fit the initial state to readings, and to a belief about it if there is one.

    Parameters
    ----------
    process, sensors
        See `auvid_cli.filters.problem`.
    timelines : iterable of Timeline
        Gone through once for each evaluation.
    start : ndarray, shape (n,)
        Within the bounds.
    belief : Belief or None
    bounds : tuple of ndarray, shape (n,)
        Lower and upper.
    tolerance : float
        A step that makes the sum of squares smaller by less than this share of it, or changes the state by less, is
        the last.
    max_evaluations : int
        At least one.

    Returns
    -------
    Fit or None
        None if the motion from `start` blows up. A trial step from which it does is taken back and made shorter.
    """
    problem = _Problem(process, sensors, timelines, start.size, belief)
    if problem.information(start) is None:
        return None
    found = least_squares(
        problem.residuals,
        start,
        problem.jacobian,
        bounds,
        # Columns differ by orders of magnitude, with the length of the run too.
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        # A gradient has no scale of its own to be judged by.
        gtol=None,
        max_nfev=max_evaluations,
    )
    information = problem.information(found.x)
    assert information is not None, "least squares ends where it has been"
    return Fit(found.x, information, found.status > 0, found.nfev)


class _Problem:
    """What the solver asks for; it asks for residuals and derivative at one state after the other."""

    def __init__(
        self, process: Process, sensors: Sensors, timelines: Iterable[Timeline], n: int, belief: Belief | None
    ) -> None:
        self._model = process, sensors, timelines
        self._n = n
        self._mean = np.zeros(n) if belief is None else belief.mean
        self._weight = np.zeros((0, n)) if belief is None else np.linalg.inv(belief.factor).astype(np.float64)
        self._latest: tuple[Array, Information | None] | None = None

    def information(self, state: Array) -> Information | None:
        """Of all readings; None if the motion from that state blows up."""
        if self._latest is None or not np.array_equal(self._latest[0], state):
            total = Information.none(self._n)
            for response in responses(*self._model, state):
                if response.blew_up:
                    total = None
                    break
                total = total.with_response(response)
            self._latest = state.copy(), total if total is not None and total.is_finite else None
        return self._latest[1]

    def residuals(self, state: Array) -> Array:
        """Predicted less measured, compressed; infinite where the motion blows up, which the solver takes back."""
        found = self.information(state)
        if found is None:
            return np.full(2 * self._n + 1 + len(self._weight), np.inf)
        of_belief = self._weight @ (state - self._mean)
        return np.concatenate([-found.projected, [found.remaining], np.zeros(self._n), of_belief])

    def jacobian(self, state: Array) -> Array:
        """Of `residuals`."""
        found = self.information(state)
        assert found is not None, "the solver steps only to where the residuals are finite"
        # A zero residual that grows along directions of which the readings say nothing: the state stays where it is
        # along these, and the solver's matrix has full rank, without which its steps are as long as they may be.
        kept = np.zeros((self._n, self._n))
        if not self._weight.size:
            unseen = found.unseen()
            kept[: len(unseen)] = unseen
        return np.vstack([found.factor, np.zeros(self._n), kept, self._weight])
